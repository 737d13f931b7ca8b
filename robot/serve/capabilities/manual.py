"""Drive by hand: a dead man's handle."""

from robot.serve.capability import Capability, has_verbs, verb_operation

SPEED = {"type": "number", "minimum": -1.0, "maximum": 1.0}
YAW_RATE = {"type": "number", "minimum": -6.0, "maximum": 6.0}
CAPABILITY = Capability(
    "manual",
    "Drive by hand",
    "Drive for a fraction of a second; ask again and again, or the robot stops. The live line is "
    "quicker: see `robot/serve/driver.py`.",
    (
        verb_operation(
            "manual", "/manual", "Drive for a moment.",
            {"v_mps": SPEED, "yaw_rate_radps": YAW_RATE},
        ),
    ),
    has_verbs("manual"),
)  # fmt: skip
