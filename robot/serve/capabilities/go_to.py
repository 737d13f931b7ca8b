"""Drive to a place."""

from robot.serve.capability import Capability, has_verbs, verb_operation
from robot.serve.fields import METRES

CAPABILITY = Capability(
    "go_to",
    "Go to a place",
    "Drive to a place of the map and wait there.",
    (verb_operation("go to", "/go-to", "Drive there.", {"x_m": METRES, "y_m": METRES}),),
    has_verbs("go to"),
)
