"""How hard the fan works."""

from robot.serve.capability import (
    FAN_LEVELS,
    Capability,
    Schema,
    has_verbs,
    listed,
    listing_operation,
    verb_operation,
)

LEVEL: Schema = {"type": "string", "enum": list(FAN_LEVELS)}

CAPABILITY = Capability(
    "fan",
    "Fan",
    "How hard the fan works, now and in every later run; the robot keeps the level.",
    (
        listing_operation(
            "fan", "/fan", "The level, and all there are.",
            listed(level=LEVEL, levels={"type": "array", "items": {"type": "string"}}),
        ),
        verb_operation("fan", "/fan", "Set the level.", {"level": LEVEL}),
    ),
    has_verbs("fan"),
)  # fmt: skip
