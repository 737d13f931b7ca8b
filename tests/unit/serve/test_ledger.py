"""What is asked of the runtime, and when: rooms cost it a look at its whole map."""

import asyncio

from robot.serve.ledger import MUCH_NEW, Ledger
from robot.serve.world import World


class Runtime:
    """Answers every verb, and remembers which were asked."""

    def __init__(self, state):
        self.world = World()
        self.world.hello = {"verbs": ["rooms", "map show", "consumables", "fan"]}
        self.world.connected, self.world.status = True, {"state": state}
        self.asked = []

    async def request(self, verb, args=None):
        self.asked.append(verb)
        data = {"rooms": [{"name": f"room {len(self.asked)}"}], "level": "low", "levels": ["low"]}
        return {"accepted": True, "reason": "", "data": data}


def refreshed(ledger, runtime, tiles):
    """Which verbs are asked once the map has so many tiles."""
    runtime.asked.clear()
    runtime.world.tiles = {(n, 0): b"" for n in range(tiles)}
    asyncio.run(ledger._refresh())
    return runtime.asked


def test_a_resting_robot_is_always_asked_for_its_rooms():
    runtime = Runtime("docked")
    ledger = Ledger(runtime)
    assert all("rooms" in refreshed(ledger, runtime, 10) for _ in range(3))
    assert runtime.world.drawn["fan"]["level"] == "low"


def test_during_a_run_rooms_are_asked_for_only_when_much_floor_is_new():
    runtime = Runtime("clean")
    ledger = Ledger(runtime)
    assert "rooms" in refreshed(ledger, runtime, 4)
    assert "rooms" not in refreshed(ledger, runtime, 5)
    assert "rooms" in refreshed(ledger, runtime, int(4 * MUCH_NEW) + 1)
    assert "rooms" not in refreshed(ledger, runtime, int(4 * MUCH_NEW) + 1)
    assert runtime.world.drawn["rooms"] == [{"name": "room 4"}]  # the newest stay
