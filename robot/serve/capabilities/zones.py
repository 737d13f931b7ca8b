"""Clean rectangles only."""

from robot.serve.capability import Capability, has_verbs, verb_operation
from robot.serve.fields import METRES, many

CAPABILITY = Capability(
    "zones",
    "Zones",
    "Clean only these rectangles: each is x y x y of two opposite corners, metres of the map.",
    (
        verb_operation(
            "clean zones", "/zones/clean", "Clean these rectangles.",
            {"zones_m": many(many(METRES, 4, 4), 1, 10)},
        ),
    ),
    has_verbs("clean zones"),
)  # fmt: skip
