"""What people set once and the robot keeps over night, beside the drawings on its map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from robot.errors import MapError, RequestError

FAN_SHARES = {"off": 0.0, "low": 0.4, "medium": 0.7, "high": 1.0}  # of `mission.fan`


@dataclass(slots=True)
class Settings:
    """One object of the whole robot; what is set holds from the next tick on."""

    fan: str = "high"  # one of FAN_SHARES

    @property
    def fan_share(self) -> float:
        """What the fan does of its full power, wherever it runs."""
        return FAN_SHARES[self.fan]

    def set_fan(self, level: str) -> None:
        """Raises RequestError for a level that does not exist."""
        name = level.strip().lower()
        name = "high" if name == "max" else name
        if name not in FAN_SHARES:
            raise RequestError(f"the fan has no level {level[:40]!r}; {', '.join(FAN_SHARES)}.")
        self.fan = name

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it."""
        return asdict(self)

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any], name: str = "map") -> Settings:
        """What `to_dict` gave; what is missing is as on the first day. Raises MapError."""
        fan = plain.get("fan", "high") if isinstance(plain, Mapping) else None
        if not isinstance(fan, str) or fan not in FAN_SHARES:
            raise MapError(f"{name}: settings hold a fan level that does not exist; correct that.")
        return cls(fan)
