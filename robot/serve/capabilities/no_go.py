"""Areas that the robot stays out of."""

from robot.serve.capability import Capability, has_verbs, verb_operation
from robot.serve.fields import METRES, NAME, many

CAPABILITY = Capability(
    "no_go",
    "No-go areas",
    "Draw an area that the robot stays out of, by two opposite corners or three and more; `map`'s "
    "drawings list them.",
    (
        verb_operation(
            "no-go add", "/no-go/add", "Draw an area.",
            {"corners_m": many(many(METRES, 2, 2), 2, 64)},
        ),
        verb_operation("no-go remove", "/no-go/remove", "Take an area away.", {"name": NAME}),
    ),
    has_verbs("no-go add", "no-go remove"),
)  # fmt: skip
