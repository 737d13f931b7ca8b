"""The rooms of the home, as people know them."""

from robot.serve.capability import (
    Capability,
    Schema,
    has_verbs,
    listed,
    listing_operation,
    verb_operation,
)
from robot.serve.fields import METRES, NAME, many

ROOM: Schema = {
    "type": "object",
    "required": ["name", "area_m2", "at_m"],
    "properties": {
        "name": {"type": "string"},
        "area_m2": {"type": "number"},
        "at_m": {"type": "array", "items": {"type": "number"}},
        "outline_m": {"type": "array", "items": {"type": "array", "items": {"type": "number"}}},
    },
}
LINE = {"x_m": METRES, "y_m": METRES, "end_x_m": METRES, "end_y_m": METRES}

CAPABILITY = Capability(
    "rooms",
    "Rooms",
    "Clean rooms by their names; split them by a line, join two, name one.",
    (
        listing_operation(
            "rooms", "/rooms", "The rooms: name, area, a place inside, outline.",
            listed(rooms={"type": "array", "items": ROOM}),
        ),
        verb_operation(
            "clean rooms", "/rooms/clean", "Clean only these rooms.", {"rooms": many(NAME, 1, 30)}
        ),
        verb_operation("room split", "/rooms/split", "Cut a room along a line.", LINE),
        verb_operation(
            "room join", "/rooms/join", "Make two rooms one.", {"room": NAME, "other": NAME}
        ),
        verb_operation(
            "room name", "/rooms/name", "Give a room a name.", {"room": NAME, "name": NAME}
        ),
    ),
    has_verbs("rooms", "clean rooms", "room split", "room join", "room name"),
)  # fmt: skip
