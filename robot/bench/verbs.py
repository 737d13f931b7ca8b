"""`sweeper bench`: the grammar of all benchmarks, each with its tables and its JSON."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robot.config import Config

Result = tuple[Mapping[str, Sequence[dict[str, Any]]], dict[str, Any]]  # tables, what --json says
Function = Callable[[argparse.Namespace], int]
AddVerb = Callable[[Any, str, str, Function], argparse.ArgumentParser]
HOME_ROW = (
    "scene", "seed", "duration_s", "covered_pct", "ate_rmse_m", "path_m", "contacts",
    "max_contact_mps", "docked",
)  # fmt: skip


def add_verbs(benches: Any, verb: AddVerb, write_json: Callable[[str | None, Any], None]) -> None:
    """The grammar of `sweeper bench`."""

    def add(
        name: str,
        summary: str,
        function: Callable[[argparse.Namespace], Result],
        config: bool = True,
    ) -> argparse.ArgumentParser:
        def run(arguments: argparse.Namespace) -> int:
            from robot.progress import print_table

            tables, result = function(arguments)
            if arguments.json != "-":
                for title, rows in tables.items():
                    print_table(title, list(rows))
            write_json(arguments.json, result)
            return 0

        made = verb(benches, name, summary, run)
        if config:
            made.add_argument("--config", type=Path, help="TOML file with differences to defaults")
        return made

    pipeline = add("pipeline", "recorded stereo frames through perception and SLAM", _pipeline)
    pipeline.add_argument(
        "--frames",
        type=Path,
        nargs="+",
        required=True,
        metavar="DIR",
        help="EuRoC ASL or KITTI odometry folders, or a folder of them",
    )
    pipeline.add_argument("--out", type=Path, default=Path("runs/pipeline"), help="for pictures")

    coverage = add("coverage", "the planner alone on map_server maps", _coverage)
    coverage.add_argument("--maps", type=Path, nargs="+", required=True, metavar="DIR")
    coverage.add_argument("--out", type=Path, default=Path("runs/coverage"), help="pictures")

    stereo = add("stereo", "matchers on stereo pairs with true disparity", _stereo, config=False)
    stereo.add_argument(
        "--pairs", type=Path, required=True, metavar="DIR", help="see docs in models/"
    )
    stereo.add_argument(
        "--matcher", "--matchers", dest="matchers", default="", metavar="NAMES",
        help="comma-separated; default: all",
    )  # fmt: skip
    stereo.add_argument("--out", type=Path, default=Path("runs/stereo"), help="for pictures")
    stereo.add_argument("--pictures", action="store_true", help="also error panels, into --out")
    stereo.add_argument("--threads", type=int, default=1, metavar="N")
    kind = stereo.add_mutually_exclusive_group()
    kind.add_argument("--native", action="store_true", help="at full size instead of 320x240")
    kind.add_argument("--stress", action="store_true", help="disturbed pictures, swapped eyes")
    kind.add_argument("--confidence", action="store_true", help="at the density SGBM keeps")

    slam = add("slam", "EKF-SLAM on recordings with known truth, and logs", _slam)
    slam.add_argument(
        "path",
        type=Path,
        metavar="PATH",
        help="MRCLAM (raw folder or .npz), Victoria Park .npz, sensor_data.dat, log.mcap, or a "
        "folder of them",
    )
    slam.add_argument("--association", choices=("known", "unknown"), help="default: both")
    slam.add_argument(
        "--perturb",
        default="",
        metavar="LIST",
        help="mirror,relabel,shift=S,drop=P,outliers=P,wrong=P,slip=P",
    )
    slam.add_argument("--growth", action="store_true", help="also frames in homes of any size")
    slam.add_argument("--out", type=Path, default=Path("runs/slam"), help="pictures and tracks")

    faults = add("faults", "twelve things that go wrong, and what the robot makes of them", _faults)
    faults.add_argument("--trials", type=int, default=10, metavar="N", help="of each fault")
    faults.add_argument("--faults", default="", metavar="LIST", help="by commas; default: all")
    faults.add_argument("--jobs", type=int, default=1, metavar="N", help="side by side")

    home = add("home", "whole cleaning runs in simulated homes, side by side", _home)
    home.add_argument(
        "--scenes", default="flat", metavar="LIST", help="names, files, random:1-5, by commas; all"
    )
    home.add_argument("--seeds", default="1-5", metavar="LIST", help='like "1,3,10-12"')
    home.add_argument("--duration-s", type=float, help="end each run after this much robot time")
    home.add_argument("--drawn", action="store_true", help="draw sights, without pictures")
    home.add_argument("--jobs", type=int, default=0, metavar="N", help="default: all cores")
    home.add_argument("--scheduler", default="", metavar="ADDRESS", help="of a Dask cluster")
    home.add_argument("--out", type=Path, default=Path("runs/home"), help="run folders, picture")

    kidnap = add("kidnap", "carried elsewhere in a known home: noticed? found again?", _kidnap)
    kidnap.add_argument("--scene", default="flat", help="name or file")
    kidnap.add_argument("--seed", type=int, default=1)
    kidnap.add_argument("--carries", type=int, default=50, metavar="N")
    kidnap.add_argument("--drawn", action="store_true", help="draw sights, without pictures")


def _config(arguments: argparse.Namespace) -> Config:
    from robot.config import load_config

    return load_config(arguments.config)


def _pipeline(arguments: argparse.Namespace) -> Result:
    from robot.bench.pipeline import bench_pipeline

    result = bench_pipeline(arguments.frames, _config(arguments), arguments.out)
    return {"pipeline": result["sequences"]}, result


def _coverage(arguments: argparse.Namespace) -> Result:
    from robot.bench.coverage import bench_coverage

    result = bench_coverage(arguments.maps, _config(arguments), arguments.out)
    return {"coverage": [*result["maps"], {"name": "mean", **result["mean"]}]}, result


def _stereo(arguments: argparse.Namespace) -> Result:
    from robot.bench.stereo.bench import StereoOrder, run_order, tables

    matchers = [m for m in arguments.matchers.split(",") if m]
    ways = [way for way in ("native", "stress", "confidence") if getattr(arguments, way)]
    order = StereoOrder(
        arguments.pairs, matchers or None, arguments.out, arguments.pictures, arguments.threads,
        ways[0] if ways else "protocol",
    )  # fmt: skip
    result = run_order(order)
    return tables(result), result


def _slam(arguments: argparse.Namespace) -> Result:
    from robot.bench.slam.bench import bench_slam

    result = bench_slam(
        arguments.path,
        arguments.association,
        arguments.out,
        arguments.perturb,
        tell=lambda line: print(line, file=sys.stderr),
        growth=arguments.growth,
        config=_config(arguments) if arguments.config else None,
    )
    tables = {"slam": result["runs"], "cost of one step": result["cost"]}
    if result["growth"]:
        tables["cost of a frame"] = result["growth"]
    return tables, result


def _faults(arguments: argparse.Namespace) -> Result:
    from robot.bench.faults.bench import bench_faults

    names = [name.strip() for name in arguments.faults.split(",") if name.strip()]
    result = bench_faults(arguments.trials, names, _config(arguments), arguments.jobs)
    return {"faults": result["faults"]}, result


def _home(arguments: argparse.Namespace) -> Result:
    from robot.bench.home import HomeOptions, bench_home, parse_scenes, parse_seeds

    options = HomeOptions(
        parse_scenes(arguments.scenes),
        parse_seeds(arguments.seeds),
        drawn=arguments.drawn,
        duration_s=arguments.duration_s,
        jobs=arguments.jobs,
        scheduler=arguments.scheduler,
        out=arguments.out,
    )
    result = bench_home(options, _config(arguments))
    rows = [{key: run[key] for key in HOME_ROW} for run in result["runs"]]
    return {"home": rows, "mean": [result["mean"]]}, result


def _kidnap(arguments: argparse.Namespace) -> Result:
    from robot.bench.kidnap import bench_kidnap

    result = bench_kidnap(
        arguments.scene,
        arguments.seed,
        arguments.carries,
        _config(arguments),
        rendered=not arguments.drawn,
    )
    return {"carried": result["carries"], "in all": [result["summary"]]}, result
