"""Parts that wear."""

from robot.serve.capability import (
    Capability,
    Schema,
    Sensor,
    has_verbs,
    listed,
    listing_operation,
    verb_operation,
)

PARTS = ("brush", "filter", "sensors")
HOURS: Schema = {"type": "object", "additionalProperties": {"type": "number"}}


def _left(part: str) -> Sensor:
    return Sensor(
        "sensor",
        {
            "name": f"{part.capitalize()} left",
            "icon": "mdi:wrench-clock",
            "unit_of_measurement": "%",
            "entity_category": "diagnostic",
            "value_template": f"{{{{ value_json.left_pct.{part} }}}}",
        },
    )


CAPABILITY = Capability(
    "consumables",
    "Parts",
    "Hours of brush, filter and sensors since their last care, and how long they are good for.",
    (
        listing_operation(
            "consumables", "/consumables", "Hours of use, and of life.",
            listed(hours=HOURS, life_h=HOURS),
        ),
        verb_operation(
            "consumables reset", "/consumables/reset", "Count anew after care.",
            {"part": {"type": "string", "enum": list(PARTS)}},
        ),
    ),
    has_verbs("consumables", "consumables reset"),
    sensors={f"{part}_left": _left(part) for part in PARTS},
)  # fmt: skip
