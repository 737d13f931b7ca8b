"""`sweeper log info|cut|export` on the command line; what is heavy is loaded only when asked."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

FORMATS = ("tum", "map_server", "euroc", "png", "mp4")


def add_log_verbs(logs: Any, verb: Callable[..., argparse.ArgumentParser], write: Any) -> None:
    """The verbs; `verb` makes a parser, `write` hands over the JSON."""

    def done(arguments: argparse.Namespace, result: dict[str, Any], sentence: str) -> int:
        write(arguments.json, result)
        if arguments.json != "-":
            print(sentence)
        return 0

    def info(arguments: argparse.Namespace) -> int:
        from robot.body.records.log_files import log_info

        result = log_info(arguments.log)
        lines = [f"{key}: {value}" for key, value in result.items() if key != "messages"]
        lines += [f"  {name}: {count}" for name, count in result["messages"].items()]
        return done(arguments, result, "\n".join(lines))

    def cut_out(arguments: argparse.Namespace) -> int:
        from robot.log.cut import cut

        pictures = not arguments.no_pictures
        result = cut(
            arguments.log, arguments.out, arguments.start, arguments.end, pictures=pictures
        )
        return done(arguments, asdict(result), result.sentence())

    def export(arguments: argparse.Namespace) -> int:
        from robot.body.records.log_files import export_log

        files = export_log(arguments.log, arguments.out, arguments.to)
        return done(arguments, {"files": files}, f"wrote {', '.join(files)} to {arguments.out}.")

    def tidy_up(arguments: argparse.Namespace) -> int:
        from robot.body.records.tidy import tidy

        result = tidy(arguments.folder, arguments.keep_runs, arguments.keep_mb)
        sentence = f"{result['kept']} runs kept, {len(result['removed'])} removed."
        return done(arguments, result, sentence)

    tidy_verb = verb(logs, "tidy", "keep the recent runs, remove the older ones", tidy_up)
    tidy_verb.add_argument("folder", type=Path, metavar="DIR", help="the folder of runs")
    tidy_verb.add_argument("--keep-runs", type=int, default=60, help="at most; default 60")
    tidy_verb.add_argument("--keep-mb", type=float, default=500.0, help="at most; default 500")
    info_verb = verb(logs, "info", "what is in a log", info)
    cut_verb = verb(logs, "cut", "a part of a log as a log of its own", cut_out)
    export_verb = verb(logs, "export", "a log in the formats of other tools", export)
    for parser in (info_verb, cut_verb, export_verb):
        parser.add_argument("log", type=Path, metavar="LOG")
    cut_verb.add_argument("out", type=Path, metavar="OUT", help="the new log")
    cut_verb.add_argument("--from", dest="start", type=float, default=0.0, metavar="S")
    cut_verb.add_argument("--to", dest="end", type=float, default=math.inf, metavar="S")
    cut_verb.add_argument("--no-pictures", action="store_true", help="for handing it on")
    export_verb.add_argument("out", type=Path, metavar="DIR")
    export_verb.add_argument("--to", choices=FORMATS, required=True)
