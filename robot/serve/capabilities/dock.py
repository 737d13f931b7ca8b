"""Go home."""

from robot.serve.capability import ACTIVE, Button, request_capability

CAPABILITY = request_capability(
    "dock",
    "Return to the dock",
    "Drive back to the dock and charge.",
    Button(
        "Dock",
        (ACTIVE - {"return", "dock"}) | {"paused", "idle", "error"},
        vacuum="return_home",
    ),
)
