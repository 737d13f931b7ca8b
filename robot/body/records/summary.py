"""What a run amounts to: `summary.json` and the pictures, maps and tracks beside it."""

from __future__ import annotations

import json
import math
import resource
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot.body.records.observe import NS, Observer
from robot.config import Config, RobotConfig, dump_config
from robot.evaluate.coverage import Sweep
from robot.evaluate.latency import percentiles
from robot.evaluate.report import draw_map
from robot.evaluate.trajectory import compare_tracks
from robot.geometry.se2 import SE2
from robot.log.export import write_tum
from robot.mapping.annotations import Annotations
from robot.mapping.map_server import grid_to_map_server
from robot.mapping.rooms import segment_rooms

if TYPE_CHECKING:
    from robot.body.live import LiveBody
    from robot.body.simulated import SimulatedBody
    from robot.sim.base import SimBase
    from robot.sim.world import World


class Judge:
    """Knows the simulator's truth, and measures a run against it. The brain never meets it."""

    def __init__(self, world: World, base: SimBase, robot: RobotConfig) -> None:
        self.world, self.base = world, base
        self.floor = world.reachable(robot)
        self._sweep, self._swept_s = Sweep(self.floor, robot.brush_width_m), -math.inf
        self._radius_m, self.no_go_entered = robot.radius_m, False

    def look(self, world_from_base: SE2, annotations: Annotations) -> None:
        """Where the robot truly is, and what is forbidden now: did its footprint enter?"""
        away_m = annotations.distance_m(world_from_base.x_m, world_from_base.y_m)
        self.no_go_entered |= away_m < self._radius_m

    def covered_pct(self, track: np.ndarray) -> float:
        """Share of the reachable floor swept along a true track (n, 4) that goes on at its end."""
        new = track[track[:, 0] > self._swept_s]
        if len(new):
            self._sweep.add(self.in_scene(new))
            self._swept_s = float(new[-1, 0])
        return self._sweep.covered_pct()

    def in_scene(self, track: np.ndarray) -> np.ndarray:
        """A track (n, 4) of `world` (the start pose) in the scene's own coordinates."""
        moved = track.copy()
        moved[:, 1:3] = self.world.start.apply(track[:, 1:3])
        moved[:, 3] += self.world.start.yaw_rad
        return moved

    def figures(self, track: np.ndarray) -> dict[str, Any]:
        """The part of the summary that only truth can tell."""
        base = self.base
        return {
            "covered_pct": round(self.covered_pct(track), 2),
            "contacts": len(base.contacts),
            "max_contact_mps": max((speed for _, speed in base.contacts), default=0.0),
            "cliff_entered": base.cliff_entered,
            "no_go_entered": self.no_go_entered,
            "docked": base.charging,
        }


def summarise(
    observer: Observer,
    body: SimulatedBody | LiveBody,
    judge: Judge | None,
    scene: str,
    seed: int,
    wall_s: float,
) -> dict[str, Any]:
    """The figures of a run; what could not be measured is None."""
    duration_s = observer.t_ns / NS
    track = observer.true_track if judge else observer.estimates
    compared = compare_tracks(observer.estimates, observer.true_track) if judge else None
    truth: dict[str, Any] = judge.figures(observer.true_track) if judge else {}
    stages = observer.stage_ms | body.stage_ms
    return {
        "scene": scene if judge else None,
        "seed": seed if judge else None,
        "duration_s": round(duration_s, 2),
        "real_time_factor": round(duration_s / wall_s, 2) if wall_s > 0 else None,
        "covered_pct": truth.get("covered_pct"),
        "ate_rmse_m": compared.ate_rmse_m if compared else None,
        "yaw_rmse_rad": compared.yaw_rmse_rad if compared else None,
        "path_m": float(np.hypot(*np.diff(track[:, 1:3], axis=0).T).sum()),
        "contacts": truth.get("contacts"),
        "max_contact_mps": truth.get("max_contact_mps"),
        "cliff_entered": truth.get("cliff_entered"),
        "no_go_entered": truth.get("no_go_entered"),
        "docked": truth.get("docked", observer.charging),
        "state": observer.mission.state,
        "reason": observer.mission.reason,
        "frames": body.frames,
        "frames_dropped": body.frames_dropped,
        "stage_ms": {stage: percentiles(ms) for stage, ms in stages.items() if len(ms)},
        "peak_rss_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1),
    }


def write_run_folder(
    folder: Path, summary: dict[str, Any], observer: Observer, judge: Judge | None, config: Config
) -> None:
    """Write everything but the log into the run folder."""
    (folder / "config.toml").write_text(dump_config(config), encoding="utf-8")
    (folder / "trajectory.tum").write_text(write_tum(observer.estimates), encoding="utf-8")
    if judge:
        (folder / "truth.tum").write_text(write_tum(observer.true_track), encoding="utf-8")
    if observer.map is not None:
        pgm, yaml_text = grid_to_map_server(observer.map.grid, "map.pgm")
        (folder / "map.pgm").write_bytes(pgm)
        (folder / "map.yaml").write_text(yaml_text, encoding="utf-8")
        picture = draw_map(
            observer.map,
            segment_rooms(observer.map.grid),
            observer.estimates,
            observer.true_track if judge else None,
        )
        (folder / "map.png").write_bytes(picture)
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
