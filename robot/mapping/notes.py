"""The drawings of one map over time: what holds now, what can be undone, and snapshots by name.

One object, to be stored beside the map it belongs to.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.errors import MapError
from robot.mapping.annotations import MAX_NAME, Annotations

MAX_UNDO = 30
MAX_SNAPSHOTS = 10


class MapNotes:
    """Annotations with their history. `version` grows with every change."""

    def __init__(self, current: Annotations | None = None) -> None:
        self.current = current or Annotations()
        self.version = 0
        self._past: list[Annotations] = []
        self._snapshots: dict[str, Annotations] = {}

    @property
    def snapshots(self) -> list[str]:
        """Names of what was kept, the oldest first."""
        return list(self._snapshots)

    def change(self, annotations: Annotations) -> None:
        """Let these hold from now on; the ones before can be had back."""
        if annotations == self.current:
            return
        self._past = [*self._past, self.current][-MAX_UNDO:]
        self.current = annotations
        self.version += 1

    def undo(self) -> None:
        """Take the last change back. Raises MapError when there is none."""
        if not self._past:
            raise MapError("nothing was changed that could be undone; there is no need to.")
        self.current = self._past.pop()
        self.version += 1

    def keep(self, name: str) -> None:
        """Remember what holds now under a name, instead of what had it before."""
        if not 0 < len(name) <= MAX_NAME:
            raise MapError(f"a snapshot's name has 1 to {MAX_NAME} letters; shorten it.")
        if name not in self._snapshots and len(self._snapshots) >= MAX_SNAPSHOTS:
            raise MapError(f"there are {MAX_SNAPSHOTS} snapshots already; take a name again.")
        self._snapshots[name] = self.current
        self.version += 1

    def restore(self, name: str) -> None:
        """Let a snapshot hold again, which can be undone, too. Raises MapError for an unknown."""
        if name not in self._snapshots:
            known = ", ".join(self._snapshots) or "none"
            raise MapError(f"no snapshot is called {name!r}; there is: {known}.")
        self.change(self._snapshots[name])

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "current": self.current.to_dict(),
            "past": [annotations.to_dict() for annotations in self._past],
            "snapshots": {name: kept.to_dict() for name, kept in self._snapshots.items()},
        }

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any], name: str = "map") -> MapNotes:
        """What `to_dict` gave. Raises MapError."""
        if not isinstance(plain, Mapping) or not plain.keys() <= {"current", "past", "snapshots"}:
            raise MapError(f"{name}: notes hold current, past and snapshots; correct that.")
        past, snapshots = plain.get("past", []), plain.get("snapshots", {})
        if not isinstance(past, list) or not isinstance(snapshots, Mapping):
            raise MapError(f"{name}: past is a list and snapshots a table; correct that.")
        notes = cls(Annotations.from_dict(plain.get("current", {}), name))
        notes._past = [Annotations.from_dict(p, name) for p in past][-MAX_UNDO:]
        for key in list(snapshots)[:MAX_SNAPSHOTS]:
            notes._snapshots[str(key)] = Annotations.from_dict(snapshots[key], name)
        return notes
