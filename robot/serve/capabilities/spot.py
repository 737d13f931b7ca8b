"""Clean where the robot stands."""

from robot.serve.capability import RESTING, Button, request_capability

SIDE = {"type": "number", "minimum": 0.6, "maximum": 4.0}
CAPABILITY = request_capability(
    "spot",
    "Clean a spot",
    "Clean a square around the place where the robot stands; `side_m` long, 1.5 by default.",
    Button("Spot", RESTING, vacuum="clean_spot"),
    {"side_m": SIDE},
)
