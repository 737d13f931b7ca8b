"""A stand-in for the runtime: the real socket, outlook and publisher around a scripted robot."""

import math
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from standin_books import StandInBooks

from robot.body.talk.control import ControlSocket
from robot.body.talk.outlook import Outlook
from robot.body.talk.publisher import Publisher
from robot.geometry.se2 import SE2
from robot.messages import (
    Battery,
    Contact,
    Grid,
    LinkState,
    MapReport,
    MissionState,
    PoseEstimate,
    Seen,
    Tick,
)

NS = 1_000_000_000
AFTER = {"start": "clean", "pause": "paused", "resume": "clean", "stop": "idle", "dock": "return",
         "spot": "spot", "clean rooms": "room", "clean zones": "zone", "go to": "goto",
         "manual": "manual"}  # fmt: skip


class NoLog:
    """An `EventLog` that keeps nothing."""

    def event(self, event):
        pass

    command = event

    def flush(self):
        pass


class StandIn(threading.Thread):
    """Obeys every request at once, drives in a circle while cleaning, sees its floor grow."""

    def __init__(self, path, *, images=True, start=True):
        super().__init__(daemon=True)
        self.requests, self.asked, self.by_hand = [], [], []
        self.state, self.reason = "docked", "switched on"
        self.cells = np.full((160, 200), -1, np.int8)
        self.swept = np.zeros(self.cells.shape, bool)
        self.angle = 0.0
        self.looked = None
        if images:
            grey = np.tile(np.arange(320, dtype=np.uint8), (240, 1))
            self.looked = (grey, np.tile(np.linspace(0, 60, 320, dtype=np.float32), (240, 1)))
        self.outlook = Outlook(NoLog(), self, "sim", 0.17)
        check = [{"code": "disk", "level": "warn", "cause": "12 MB free", "remedy": "delete runs"}]
        self.publisher = Publisher(self.outlook, lambda: self.looked, lambda: check)
        self.control = ControlSocket(path, self.publisher.adopt)
        self.books = StandInBooks(NoLog(), Path(tempfile.mkdtemp(prefix="sweeper-books-")))
        self.control.books = self.books.verbs
        self.stopping = threading.Event()
        self._explore()
        if start:
            self.publisher.start()
            self.start()

    def view(self):
        return Grid(0.025, -2.0, -2.0, self.cells.copy()), self.swept.copy()

    def close(self):
        self.stopping.set()
        if self.is_alive():
            self.join(timeout=5)
        self.publisher.stop()
        self.control.close()

    def run(self):
        start = time.monotonic()
        tick = 0
        while not self.stopping.is_set():
            tick += 1
            time.sleep(max(0.0, start + tick * 0.02 - time.monotonic()))
            self.beat(int((time.monotonic() - start) * NS), tick)

    def beat(self, t_ns, tick):
        """One tick, as the loop would live it."""
        outlook = self.outlook
        for request in self.control.poll(t_ns):
            self.obey(request, t_ns)
        if self.state == "clean":
            self.angle += 0.01
            if self.angle > 2.0 * math.pi:  # round and round, and always something new
                self.angle = 0.0
                self.swept[:] = False
            self._explore()
        if tick % 5 == 0:
            cov = np.diag([4e-4, 1e-4, 2e-3])
            pose = SE2(math.sin(self.angle), 1.0 - math.cos(self.angle), self.angle)
            outlook.command(PoseEstimate(t_ns, pose, cov, "ok"))
            outlook.event(Seen(t_ns, t_ns, tick, (), None, 1.0, stage_ms={"disparity": 12.5}))
            if self.looked is not None:
                self.looked = (self.looked[0], self.looked[1])
        if tick % 50 == 1:
            outlook.event(Battery(t_ns, 15.2, 83.0))
            outlook.event(Contact(t_ns, charging=self.state == "docked"))
            outlook.event(LinkState(t_ns, True))
            outlook.command(self.mission(t_ns))
            landmarks = np.array([[1.0, 0.5], [-0.5, 1.5]])
            covs = np.array([[[0.01, 0.0], [0.0, 0.004]]] * 2)
            outlook.command(MapReport(t_ns, *self.view(), landmarks, covs))
        outlook.event(Tick(t_ns))

    def obey(self, request, t_ns):
        """Note it, and be in the state that follows."""
        self.asked.append((request.verb, request.args))
        if request.verb == "manual":
            self.by_hand.append((time.monotonic(), *map(float, request.args)))
        else:
            self.requests.append(request.verb)
        self.state = AFTER.get(request.verb, self.state)
        self.reason = f"{request.verb} was requested"
        self.outlook.command(self.mission(t_ns))

    def mission(self, t_ns):
        area = float(self.swept.sum()) * 0.025**2
        return MissionState(t_ns, self.state, self.reason, area, 9.0)

    def _explore(self):
        x, y = math.sin(self.angle), 1.0 - math.cos(self.angle)
        column, row = int((x + 2.0) / 0.025), int((y + 2.0) / 0.025)
        rows, columns = np.ogrid[: self.cells.shape[0], : self.cells.shape[1]]
        far = np.hypot(rows - row, columns - column)
        self.cells[(far < 40) & (self.cells < 0)] = 0
        self.cells[0:3, 40:] = 100
        self.swept |= far < 4
