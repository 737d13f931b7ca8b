"""The last runs, as the robot's own book has them."""

from robot.serve.capability import Capability, Schema, has_verbs, listed, listing_operation

RUN: Schema = {
    "type": "object",
    "required": ["began", "asked", "duration_s", "covered_m2", "state", "reason"],
    "properties": {
        "began": {"type": "string"},
        "asked": {"type": "string"},
        "duration_s": {"type": "number"},
        "covered_m2": {"type": "number"},
        "state": {"type": "string"},
        "reason": {"type": "string"},
    },
}
CAPABILITY = Capability(
    "logbook",
    "Logbook",
    "The last runs: when, why, how long, how much floor, how they ended.",
    (
        listing_operation(
            "history", "/logbook", "The last ten runs, the newest first.",
            listed(runs={"type": "array", "items": RUN}),
        ),
    ),
    has_verbs("history"),
)  # fmt: skip
