"""What the robot is doing, and why."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot, Schema, Sensor

NUMBER: Schema = {"type": ["number", "null"]}
ANSWER: Schema = {
    "type": "object",
    "required": ["connected", "name", "state", "reason"],
    "properties": {
        "connected": {"type": "boolean"},
        "name": {"type": "string"},
        "state": {"type": "string"},
        "reason": {"type": "string"},
        "battery_pct": NUMBER,
        "covered_m2": NUMBER,
        "remaining_m2": NUMBER,
        "pose": {"type": ["object", "null"]},
    },
}


async def read(robot: Robot, request: Request) -> Response:
    """The newest status and pose."""
    world = robot.world
    status = {k: v for k, v in world.status.items() if k != "type"}
    pose = {k: v for k, v in world.pose.items() if k != "type"} if world.pose else None
    return JSONResponse(
        {
            "connected": world.connected,
            "name": robot.name,
            "id": robot.robot_id,
            "body": world.hello.get("body"),
            "software": world.hello.get("software"),
            **status,
            "pose": pose,
        }
    )


CAPABILITY = Capability(
    "status",
    "Status",
    "State, reason, battery, covered floor, pose with its covariance.",
    (Operation("GET", "/status", "What the robot is doing, and why.", read, ANSWER),),
    sensors={
        "battery": Sensor(
            "sensor",
            {
                "name": "Battery",
                "device_class": "battery",
                "state_class": "measurement",
                "unit_of_measurement": "%",
                "value_template": "{{ value_json.battery_pct }}",
            },
        ),
        "reason": Sensor(
            "sensor",
            {
                "name": "Reason",
                "icon": "mdi:text",
                "entity_category": "diagnostic",
                "value_template": "{{ value_json.reason[:250] }}",
            },
        ),
        "problem": Sensor(
            "binary_sensor",
            {
                "name": "Problem",
                "device_class": "problem",
                "value_template": "{{ 'OFF' if value_json.error == 'none' else 'ON' }}",
            },
        ),
        "error": Sensor(
            "sensor",
            {
                "name": "Error",
                "icon": "mdi:alert-circle-outline",
                "entity_category": "diagnostic",
                "value_template": "{{ value_json.error[:250] }}",
            },
        ),
        "covered": Sensor(
            "sensor",
            {
                "name": "Covered floor",
                "unit_of_measurement": "m²",
                "state_class": "measurement",
                "icon": "mdi:floor-plan",
                "value_template": "{{ value_json.covered_m2 }}",
            },
        ),
    },
)
