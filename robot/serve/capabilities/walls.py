"""Lines that the robot does not cross."""

from robot.serve.capability import Capability, has_verbs, verb_operation
from robot.serve.fields import METRES, NAME

LINE = {"x_m": METRES, "y_m": METRES, "end_x_m": METRES, "end_y_m": METRES}
CAPABILITY = Capability(
    "walls",
    "Virtual walls",
    "Draw a line that the robot does not cross.",
    (
        verb_operation("wall add", "/walls/add", "Draw a wall.", LINE),
        verb_operation("wall remove", "/walls/remove", "Take a wall away.", {"name": NAME}),
    ),
    has_verbs("wall add", "wall remove"),
)
