"""All that is drawn on the map, its past, and its kept versions."""

from robot.serve.capability import (
    Capability,
    has_verbs,
    listed,
    listing_operation,
    verb_operation,
)
from robot.serve.fields import NAME

CAPABILITY = Capability(
    "drawings",
    "Drawings",
    "What is drawn on the map: take the last change back, keep it all under a name, have it back.",
    (
        listing_operation(
            "map show", "/drawings", "Areas, walls, cuts, joins, names, and snapshots.",
            listed(
                annotations={"type": "object"},
                snapshots={"type": "array", "items": {"type": "string"}},
            ),
        ),
        verb_operation("map undo", "/drawings/undo", "Take the last change back."),
        verb_operation("map snapshot", "/drawings/keep", "Keep under a name.", {"name": NAME}),
        verb_operation("map restore", "/drawings/restore", "Let it hold again.", {"name": NAME}),
    ),
    has_verbs("map show", "map undo", "map snapshot", "map restore"),
)  # fmt: skip
