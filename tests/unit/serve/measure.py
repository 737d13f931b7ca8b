"""The figures of docs in robot/serve/README.md: `python tests/unit/serve/measure.py`.

A stand-in ticks at 50 Hz in this process, the server is a process of its own as on a robot. Ticks
are measured in turns of a second and a half: the attackers are held (SIGSTOP) and let go in turn,
so that whatever else the machine does disturbs calm and attacked ticks alike. A ratio is told with
its range of 90 % over turns drawn again (bootstrap). Server and attackers stand behind the runtime
when the processor is short, 18 to 1 as the units' `CPUWeight` has it; SWEEPER_EQUAL=1 makes them
its equals. What a tick costs is told in CPU time of its thread, too, which other programs do not
lengthen. An order over HTTP is timed beside the same order straight to the runtime's socket.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from serving import Served, free_port, wait_for
from standin import NS, StandIn
from websockets.sync.client import connect

from robot.body.talk.control import ask
from robot.serve.guard.keys import Keyring

TURNS, TURN_S, SETTLE_S = int(os.environ.get("SWEEPER_TURNS", "60")), 1.5, 0.3
KINDS = ("tick_wall_ms", "tick_late_ms", "tick_cpu_ms", "tick_done_ms")


class Ticking(StandIn):
    """Measures what each tick costs, how late it begins, and how long after its time it is done."""

    def __init__(self, path):
        self.costs, self.lates, self.cpu, self.dones = [], [], [], []  # before the thread begins
        super().__init__(path)

    def run(self):
        start, tick = time.monotonic(), 0
        while not self.stopping.is_set():
            tick += 1
            due = start + tick * 0.02
            time.sleep(max(0.0, due - time.monotonic()))
            begun, cpu = time.monotonic(), time.thread_time()
            start += max(0.0, begun - due - 0.02)  # a beat that was missed is not made up for
            self.beat(int((begun - start) * NS), tick)
            done = time.monotonic()
            self.costs.append(done - begun)
            self.cpu.append(time.thread_time() - cpu)
            self.lates.append(begun - due)
            self.dones.append(done - due)


def attackers(server, stop):
    """100 watching clients, 500 idle sockets, slow readers, 1 GB bodies."""
    key = {"Authorization": f"Bearer {server.token}"}
    live = f"ws://127.0.0.1:{server.port}/api/v1/live"
    held = []

    def watch():
        while not stop.is_set():
            try:
                with connect(live, additional_headers=key, ping_interval=None) as line:
                    while not stop.is_set():
                        line.recv(timeout=30)
            except Exception:  # hung up on: come again
                stop.wait(0.5)

    def idle():
        while not stop.is_set():
            for _ in range(500):
                try:
                    held.append(socket.create_connection(("127.0.0.1", server.port), timeout=5))
                except OSError:
                    break
            stop.wait(5)
            for connection in held:
                connection.close()
            held.clear()

    def body():
        head = (
            f"POST /api/v1/start HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
            f"Authorization: Bearer {server.token}\r\nContent-Length: 1000000000\r\n\r\n"
        )
        while not stop.is_set():
            try:
                with socket.create_connection(("127.0.0.1", server.port), timeout=5) as client:
                    client.sendall(head.encode())
                    for _ in range(1000):
                        client.sendall(bytes(1_000_000))
            except OSError:
                stop.wait(0.05)

    def slow():
        while not stop.is_set():
            try:
                with connect(live, additional_headers=key, max_queue=1, ping_interval=None) as line:
                    stop.wait(20)
                    line.close()
            except Exception:
                stop.wait(0.5)

    kinds = [watch] * 100 + [idle] + [body] * 2 + [slow] * 5
    threads = [threading.Thread(target=kind, daemon=True) for kind in kinds]
    for thread in threads:
        thread.start()
    return threads


def attack(url_port, token):
    """Runs in a process of its own until its standard input closes."""
    server = Served.__new__(Served)
    server.port, server.token = url_port, token
    stop = threading.Event()
    attackers(server, stop)
    sys.stdin.read()
    stop.set()


def resident_mb(pid):
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return 0.0


def behind(words, **more):
    """A process that gets what others leave: a session of its own, at the end of the queue."""
    process = subprocess.Popen(words, start_new_session=True, **more)
    group = Path(f"/proc/{process.pid}/autogroup")
    if group.exists() and not os.environ.get("SWEEPER_EQUAL"):
        time.sleep(0.2)  # until it has its session
        group.write_text("13")  # a weight of 56 against 1024
    return process


def main():
    folder = Path(tempfile.mkdtemp())
    keys = Keyring(folder / "serve-keys.json")
    token, port = keys.new_token("measure"), free_port()
    robot = Ticking(folder / "control.sock")
    words = ["--socket", str(folder / "control.sock"), "--runs", str(folder), "--port", str(port)]
    process = behind([sys.executable, "-m", "robot", "serve", *words], stdout=subprocess.DEVNULL)
    server = Served.__new__(Served)
    server.port, server.token, server.url = port, token, f"http://127.0.0.1:{port}"
    figures = {"load_before": os.getloadavg()[0]}
    try:
        wait_for(lambda: _connected(server), 120)
        figures["resident_mb"] = round(resident_mb(process.pid), 1)
        server.json("/api/v1/start", "POST")
        figures["command_ms"] = command_ms(server)
        figures["order_ms"] = order_ms(server, robot, folder / "control.sock")
        server.json("/api/v1/start", "POST")
        calm, busy, most_mb, lines = under_attack(robot, process.pid, port, token)
        figures["attackers_connections"] = lines
        figures["attacked_resident_mb"] = round(most_mb, 1)
        figures["ticks"] = [sum(len(turn[0]) for turn in turns) for turns in (calm, busy)]
        for index, kind in enumerate(KINDS):
            for quantile in (50.0, 99.0, 99.9):
                pair = [[turn[index] for turn in turns] for turns in (calm, busy)]
                figures[f"{kind}_p{quantile:g}"] = compared(*pair, quantile)
    finally:
        process.terminate()
        process.wait(timeout=20)
        robot.close()
    print(json.dumps(figures, indent=2))


def under_attack(robot, server_pid, port, token):
    """Turns of ticks while the attackers are held, and while they are at it; serve's most MB; the
    median number of connections that the attackers hold.
    """
    crowd = behind(
        [sys.executable, __file__, str(port), token],
        stdin=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    calm, busy, most_mb, lines = [], [], 0.0, []
    try:
        wait_for(lambda: connections(port) > 500, 120)
        for _ in range(TURNS):
            crowd.send_signal(signal.SIGSTOP)
            calm.append(one_turn(robot))
            crowd.send_signal(signal.SIGCONT)
            busy.append(one_turn(robot))
            most_mb = max(most_mb, resident_mb(server_pid))
            lines.append(connections(port))
    finally:
        crowd.kill()
        crowd.wait(timeout=60)
        crowd.stdin.close()
    return calm, busy, most_mb, int(np.median(lines))


def connections(port):
    """How many are open to this port."""
    rows = Path("/proc/net/tcp").read_text().splitlines()[1:]
    return sum(row.split()[1].endswith(f":{port:04X}") and row.split()[3] == "01" for row in rows)


def one_turn(robot):
    """The `KINDS` of figures of each tick, after what was under way has settled."""
    time.sleep(SETTLE_S)
    kept = (robot.costs, robot.lates, robot.cpu, robot.dones)
    for values in kept:
        values.clear()
    time.sleep(TURN_S)
    return [list(values) for values in kept]


def compared(calm, busy, quantile, draws=1000):
    """[calm ms, attacked ms, ratio, its 5 % and its 95 % over turns drawn again]."""
    rng = np.random.default_rng(0)

    def ms(turns):
        return float(np.percentile(np.concatenate(turns), quantile)) * 1e3

    ratios = []
    for _ in range(draws):
        drawn = rng.integers(len(calm), size=(2, len(calm)))
        ratios.append(ms([busy[k] for k in drawn[1]]) / ms([calm[k] for k in drawn[0]]))
    low, high = np.percentile(ratios, [5, 95])
    figures = (ms(calm), ms(busy), ms(busy) / ms(calm), low, high)
    return [round(float(figure), 3) for figure in figures]


def order_ms(server, robot, control):
    """From the wish to the wheels' order, over HTTP and without: median and worst of 40."""
    taken = {"http": [], "socket": []}
    for number in range(80):
        robot.by_hand.clear()
        begun, way = time.monotonic(), ("http", "socket")[number % 2]
        if way == "http":
            body = json.dumps({"v_mps": 0.1, "yaw_rate_radps": 0.0})
            server.json("/api/v1/manual", "POST", body=body)
        else:
            ask(control, "manual", ["0.1", "0.0"])
        wait_for(lambda: robot.by_hand)
        taken[way].append(1e3 * (robot.by_hand[0][0] - begun))
    return {way: [round(float(np.median(t)), 1), round(max(t), 1)] for way, t in taken.items()}


def command_ms(server):
    """From the request to the robot's changed state as a page sees it: median and worst of 20."""
    key = {"Authorization": f"Bearer {server.token}"}
    taken = []
    with connect(f"ws://127.0.0.1:{server.port}/api/v1/live", additional_headers=key) as line:
        for number in range(20):
            verb, state = (("pause", "paused"), ("resume", "clean"))[number % 2]
            begun = time.monotonic()
            server.json(f"/api/v1/{verb}", "POST")
            while True:
                news = line.recv(timeout=10)
                if isinstance(news, str) and json.loads(news).get("state") == state:
                    break
            taken.append((time.monotonic() - begun) * 1e3)
    return {"median": round(float(np.median(taken)), 1), "worst": round(max(taken), 1)}


def _connected(server):
    try:
        return server.json("/api/v1/status")[1]["connected"]
    except OSError:
        return False


if __name__ == "__main__":
    attack(int(sys.argv[1]), sys.argv[2]) if len(sys.argv) == 3 else main()
