"""What the mission wants the wheels and brushes to do; only the safety gate makes it an order."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Wish:
    """Forward speed, turn rate (left positive), brush and fan (0 to 1), and why.

    `wheel_only`: creep without sight, brush and fan off; the caller answers for the way.
    """

    v_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    brush: float = 0.0
    fan: float = 0.0
    reason: str = ""
    wheel_only: bool = False


def halt(reason: str) -> Wish:
    """Stand still with everything off."""
    return Wish(reason=reason)
