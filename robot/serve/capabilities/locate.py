"""Be heard."""

from robot.serve.capability import ANY, Button, request_capability

CAPABILITY = request_capability(
    "locate",
    "Locate",
    "Beep, so that the robot can be found.",
    Button("Find it", ANY, vacuum="locate"),
)
