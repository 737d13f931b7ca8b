"""Clean rectangles only, or zones that were saved under a name."""

from robot.serve.capability import Capability, has_verbs, verb_operation
from robot.serve.fields import METRES, NAME, many

CAPABILITY = Capability(
    "zones",
    "Zones",
    "Clean only these rectangles: each is x y x y of two opposite corners, metres of the map. "
    "Zones can be saved under a name; `map`'s drawings list them.",
    (
        verb_operation(
            "clean zones", "/zones/clean", "Clean these rectangles.",
            {"zones_m": many(many(METRES, 4, 4), 1, 10)},
        ),
        verb_operation(
            "clean zones", "/zones/clean-named", "Clean these zones, by their names.",
            {"zones": many(NAME, 1, 20)},
        ),
        verb_operation(
            "zone add", "/zones/add", "Save a zone: two opposite corners, or three and more.",
            {"name": NAME, "corners_m": many(many(METRES, 2, 2), 2, 64)},
        ),
        verb_operation("zone remove", "/zones/remove", "Forget a saved zone.", {"name": NAME}),
    ),
    has_verbs("clean zones", "zone add", "zone remove"),
)  # fmt: skip
