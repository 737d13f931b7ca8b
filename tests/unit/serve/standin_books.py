"""What the stand-in answers at once: the real books and map editor, on a home of two rooms."""

import json
from types import SimpleNamespace

import numpy as np

from robot.body.calibration.wizard import CalibrationDesk
from robot.body.kept.books import Books
from robot.errors import RequestError
from robot.geometry.se2 import SE2
from robot.mapping.annotations import Annotations
from robot.mapping.named_rooms import make_rooms
from robot.mapping.notes import MapNotes
from robot.messages import Grid
from robot.mission.asks import _fan
from robot.mission.editing import edit
from robot.mission.settings import Settings
from robot.mission.verbs import VERBS

MAP_VERBS = [verb.name for verb in VERBS if verb.place == "map"]


class StandInBooks:
    """`verbs` is what `ControlSocket.books` holds."""

    def __init__(self, log, folder):
        cells = np.full((160, 200), 0, np.int8)
        self.grid = Grid(0.025, -2.0, -2.0, cells)
        self.labels = np.ones(cells.shape, np.int32)
        self.labels[:, 120:] = 2
        self.notes = MapNotes()
        self.books = Books(log, folder)
        self.settings = Settings()
        self.desk = CalibrationDesk(folder, lambda: True)
        self.verbs = {**self.books.verbs(), **self.desk.verbs(), "fan": self.fan}
        for name in MAP_VERBS:
            self.verbs[name] = lambda args, name=name: self.map(name, args)

    def map(self, verb, args):
        now = SimpleNamespace(
            notes=self.notes, pose=SE2(0.0, 0.0, 0.0),
            sight=SimpleNamespace(world_from_docked=None),
            robot=SimpleNamespace(radius_m=0.17), config=SimpleNamespace(no_go_margin_m=0.05),
        )  # fmt: skip
        rooms = make_rooms(self.grid, self.labels, self.notes.current)
        reply = edit(verb, args, now, rooms)
        if not reply.accepted:
            raise RequestError(reply.reason)
        data = {"data": json.loads(reply.data)} if reply.data else {}
        return {"reason": reply.reason, **data}

    def fan(self, args):
        reply = _fan(None, self, args)  # needs no mission
        return {"reason": reply.reason, "data": json.loads(reply.data)}

    def forget(self):
        """As before the first change."""
        self.notes = MapNotes(Annotations())
