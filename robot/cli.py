"""The command line: every verb, its manual, and its exit code."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from firmware_bridge.errors import BridgeError
from robot.bench.verbs import add_verbs as add_bench_verbs
from robot.body.wheels import add_verbs as add_wheels_verbs
from robot.errors import SweeperError

EXIT_DONE, EXIT_FAILED, EXIT_USAGE = 0, 1, 2

MANUAL = """\
Sweeper drives a robot vacuum that sees with two cameras: live on the robot, in the built-in
simulator, on recorded stereo frames, or replaying a log.

A first drive:   sweeper run                     clean the built-in flat, watch, read the summary
What happened:   sweeper replay runs/latest/log.mcap
Your frames:     sweeper bench pipeline --frames DIR
Is it ready:     sweeper check
"""
EXIT_CODES = (
    "Exit codes: 0 done (Ctrl-C or SIGTERM end a run in order: it stops and writes its summary); "
    "1 the run or the comparison failed; 2 the input is wrong."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit code. User mistakes end as one sentence on stderr."""
    for pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        # Matrices are small here: threads would wait for each other, on a busy core for long.
        os.environ.setdefault(pool, "1")
    arguments = parser().parse_args(argv)
    verb: Callable[[argparse.Namespace], int] = arguments.function
    try:
        return verb(arguments)
    except (SweeperError, BridgeError) as error:
        print(f"sweeper: {error}", file=sys.stderr)
        return EXIT_USAGE
    except KeyboardInterrupt:
        print("sweeper: stopped by the keyboard.", file=sys.stderr)
        return EXIT_FAILED


def parser() -> argparse.ArgumentParser:
    """The grammar of the command line, which is also its manual."""
    top = argparse.ArgumentParser(
        prog="sweeper",
        description=MANUAL,
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = top.add_subparsers(title="verbs", metavar="VERB", required=True)

    run = _verb(verbs, "run", "clean a home, live or in the simulator", _run)
    _add_run_options(run)
    run.add_argument("--wait", action="store_true", help="wait for `sweeper ask start`")

    record = _verb(verbs, "record", "like run, and keep every camera frame in the log", _run)
    _add_run_options(record)
    record.set_defaults(frames=True)
    record.add_argument(
        "--clean", dest="wait", action="store_false", help="also drive (default: only watch)"
    )

    replay = _verb(verbs, "replay", "feed a log to the brain and compare its commands", _replay)
    replay.add_argument("log", type=Path, metavar="LOG", help="log.mcap of a run")
    replay.add_argument(
        "--from",
        dest="source",
        choices=("events", "frames"),
        default="events",
        help="frames: run perception again (needs a log of `sweeper record`)",
    )

    bench = verbs.add_parser("bench", help="measure: pipeline, stereo, slam, coverage, home")
    benches = bench.add_subparsers(title="benchmarks", metavar="BENCH", required=True)
    add_bench_verbs(benches, _verb, _write_json)

    log = verbs.add_parser("log", help="work on logs: info, cut, export, recover")
    logs = log.add_subparsers(title="log commands", metavar="COMMAND", required=True)
    recover = _verb(logs, "recover", "save what a damaged log still holds", _log_recover)
    recover.add_argument("log", type=Path, metavar="LOG", help="a truncated or damaged log.mcap")
    recover.add_argument("out", type=Path, metavar="OUT", help="the new log")

    from robot.body.records.log_verbs import add_log_verbs

    add_log_verbs(logs, _verb, _write_json)

    from robot.body.calibration.verbs import add_verbs as add_calibrate_verbs

    calibrate = verbs.add_parser(
        "calibrate", help="cameras, gyro, wheels: stereo, imu, wheels, camera-pose, sync, ..."
    )
    calibrations = calibrate.add_subparsers(title="calibrations", metavar="WHAT", required=True)
    add_calibrate_verbs(calibrations, _verb, _write_json)

    check = _verb(
        verbs, "check", "is this machine ready to drive? every finding has a remedy", _check
    )
    check.add_argument("--config", type=Path, help="TOML file with differences to the defaults")
    check.add_argument(
        "--bundle", type=Path, metavar="FILE", help="also write a .tar.gz for a helper: no secrets"
    )

    check.add_argument(
        "--beside", action="store_true", help="beside a running robot: leave its devices alone"
    )

    from robot.body.talk.asking import add_ask_options

    ask = _verb(verbs, "ask", "ask a running robot: start, dock, clean rooms, go to, ...", _ask)
    add_ask_options(ask)

    from robot.serve.verbs import add_options as add_serve_options

    add_serve_options(_verb(verbs, "serve", "web page, API and MQTT of a running robot", _serve))

    wheels = verbs.add_parser("wheels", help="the motor controller: stop, monitor, drive, ...")
    controls = wheels.add_subparsers(title="controls", metavar="CONTROL", required=True)
    add_wheels_verbs(controls, _verb, _write_json)
    return top


def _verb(
    verbs: Any, name: str, summary: str, function: Callable[[argparse.Namespace], int]
) -> argparse.ArgumentParser:
    verb: argparse.ArgumentParser = verbs.add_parser(
        name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.", epilog=EXIT_CODES
    )
    verb.add_argument("--json", metavar="FILE", help="write the result as JSON; - for stdout")
    verb.set_defaults(function=function)
    return verb


def _add_run_options(verb: argparse.ArgumentParser) -> None:
    verb.set_defaults(frames=False)
    verb.add_argument("--body", choices=("sim", "live"), default="sim", help="default: sim")
    verb.add_argument("--scene", default="flat", help="name, random:SEED, TOML, GLB or OBJ (sim)")
    verb.add_argument("--seed", type=int, default=1, help="of every chance in the simulator")
    verb.add_argument("--duration-s", type=float, help="end after this much robot time")
    verb.add_argument("--config", type=Path, help="TOML file with differences to the defaults")
    verb.add_argument("--out", type=Path, default=Path("runs"), help="folder of run folders")
    verb.add_argument("--no-progress", action="store_true", help="no progress bar")
    verb.add_argument("--real-time", action="store_true", help="no faster than the clock (sim)")
    verb.add_argument(
        "--drawn",
        action="store_true",
        help="draw what is seen from perception's measured errors, without pictures (sim)",
    )
    verb.add_argument("--socket", type=Path, help="control socket: be watched, steered")
    verb.add_argument(
        "--log-ring", type=Path, metavar="DIR", help="log into a ring in this folder, in RAM"
    )
    verb.add_argument("--home", type=Path, help="folder of the map: known at the start, kept after")


# ---------------------------------------------------------------------- verbs


def _run(arguments: argparse.Namespace) -> int:
    from robot.body.cleaning import RunOptions, run_cleaning
    from robot.body.ending import Ending
    from robot.config import load_config
    from robot.progress import Progress, print_summary

    if arguments.duration_s is not None and arguments.duration_s <= 0:
        raise SweeperError(f"--duration-s {arguments.duration_s}: give more than 0 seconds.")
    shown = not arguments.no_progress and sys.stderr.isatty()
    with Ending() as ending, Progress(enabled=shown) as progress:
        summary = run_cleaning(
            RunOptions(
                body=arguments.body,
                scene=arguments.scene,
                seed=arguments.seed,
                duration_s=arguments.duration_s,
                out=arguments.out,
                frames=arguments.frames,
                wait=arguments.wait,
                real_time=arguments.real_time,
                drawn=arguments.drawn,
                socket=arguments.socket,
                log_ring=arguments.log_ring,
                home=arguments.home,
            ),
            load_config(arguments.config),
            progress.update,
            ending.asked,
        )
    if arguments.json != "-":
        print_summary(summary)
    _write_json(arguments.json, summary)
    return EXIT_DONE if summary["state"] != "error" else EXIT_FAILED


def _replay(arguments: argparse.Namespace) -> int:
    from robot.body.replayed import replay

    result = replay(arguments.log, from_frames=arguments.source == "frames")
    _write_json(arguments.json, result.as_json())
    if arguments.json != "-":
        print(result.sentence())
    return EXIT_DONE if result.identical else EXIT_FAILED


def _log_recover(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from robot.log.recover import recover

    result = recover(arguments.log, arguments.out)
    _write_json(arguments.json, asdict(result))
    if arguments.json != "-":
        print(result.sentence())
    return EXIT_DONE


def _check(arguments: argparse.Namespace) -> int:
    from robot.body.checks.check import check, check_running
    from robot.config import load_config
    from robot.progress import print_table

    config = load_config(arguments.config)
    findings = check_running(config) if arguments.beside else check(config)
    if arguments.json != "-":
        print_table("check", findings)
    if arguments.bundle is not None:
        from robot.body.checks.bundle import write_bundle
        from robot.body.checks.machine import Machine

        write_bundle(arguments.bundle, config, findings, Machine())
    _write_json(arguments.json, {"checks": findings})
    return EXIT_FAILED if any(f["level"] == "error" for f in findings) else EXIT_DONE


def _ask(arguments: argparse.Namespace) -> int:
    from robot.body.talk.asking import ask_for, sentences

    answer = ask_for(arguments)
    if arguments.json != "-":
        print(sentences(answer))
    _write_json(arguments.json, answer)
    return EXIT_DONE if answer.get("accepted") else EXIT_USAGE


def _serve(arguments: argparse.Namespace) -> int:
    from robot.serve.verbs import run

    _write_json(arguments.json, run(arguments))
    return EXIT_DONE


def _write_json(target: str | None, result: dict[str, Any]) -> None:
    if target is None:
        return
    text = json.dumps(result, indent=2, allow_nan=False)
    if target == "-":
        print(text)
        return
    try:
        Path(target).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise SweeperError(
            f"--json {target}: cannot be written ({error.strerror}); give a writable path or -."
        ) from None


if __name__ == "__main__":
    sys.exit(main())
