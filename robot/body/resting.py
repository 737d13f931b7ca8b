"""When the robot rests, and what begins a run: one answer for track, diary, books and home."""

from __future__ import annotations

RESTING = frozenset({"none", "idle", "docked", "done", "error"})
NO_RUN = RESTING | {"manual", "lifted", "lost"}  # in somebody's hands, or found out after


def begins_run(state: str) -> bool:
    """Whether a run begins here, if none is going on; one that is goes on until it rests."""
    return state not in NO_RUN
