"""When the robot cleans by itself."""

from robot.serve.capability import (
    Capability,
    Schema,
    has_verbs,
    listed,
    listing_operation,
    verb_operation,
)
from robot.serve.fields import NAME, many

TEXTS: Schema = {"type": "array", "items": {"type": "string"}}
ENTRY: Schema = {
    "type": "object",
    "required": ["days", "at", "words"],
    "properties": {"days": TEXTS, "at": {"type": "string"}, "words": TEXTS},
}
DAYS: Schema = {
    "type": "string",
    "minLength": 1,
    "maxLength": 60,
    "description": "daily, or such as mon,wed,fri",
}
TIME: Schema = {"type": "string", "minLength": 4, "maxLength": 5, "description": "such as 09:30"}
NUMBER: Schema = {"type": "integer", "minimum": 1, "maximum": 1000}

CAPABILITY = Capability(
    "schedules",
    "Schedule",
    "Every week on these days, at this time, a request such as start or clean rooms Kitchen.",
    (
        listing_operation(
            "schedule list", "/schedules", "All entries, in the order of their numbers 1, 2, ...",
            listed(entries={"type": "array", "items": ENTRY}),
        ),
        verb_operation(
            "schedule add", "/schedules/add", "One entry more; `words` is the request.",
            {"days": DAYS, "time": TIME, "words": many(NAME, 1, 30)}, ("words",),
        ),
        verb_operation(
            "schedule remove", "/schedules/remove", "One entry less.", {"number": NUMBER}
        ),
    ),
    has_verbs("schedule list", "schedule add", "schedule remove"),
)  # fmt: skip
