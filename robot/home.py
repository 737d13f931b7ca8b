"""All that the robot knows of a home, to be kept over night."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from robot.geometry.se2 import SE2
from robot.mapping.grid import GridMemory
from robot.slam.memory import SlamMemory


@dataclass(frozen=True, slots=True, eq=False)
class Home:
    """One map. Everything stands in the same `world`, so that drawings stay where they are.

    `notes` are the drawings of people as plain dictionaries and lists (`MapNotes.to_dict`), and
    `settings` what they have set (`Settings.to_dict`).
    """

    slam: SlamMemory
    grid: GridMemory
    world_from_docked: SE2 | None  # None: the dock was never seen
    docked_from_marker: SE2
    notes: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
