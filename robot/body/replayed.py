"""The replayed body: a log's events again, and the brain's answers compared with the logged ones.

Nothing moves. The comparison is bit for bit, on the text that the log holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from robot.config import Config
from robot.errors import LogError
from robot.log.codec import decode, encode
from robot.log.header import LogHeader
from robot.log.reader import Entry, Kind, LogReader
from robot.messages import Command, Event, Seen, StereoFrame
from robot.run import run

if TYPE_CHECKING:
    from robot.brain import Brain


class Sees(Protocol):
    """What `robot.perception.chain.Perception` offers here."""

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen: ...


@dataclass(frozen=True, slots=True)
class Difference:
    """The first place where the replay and the log disagree.

    `index` counts the logged commands (from 0), `event` the events (from 1); `expected` is the
    logged text, `got` the replayed one, each empty where there is none.
    """

    index: int
    event: int
    t_ns: int
    what: str
    expected: str
    got: str

    def sentence(self) -> str:
        """For people: where, and which field."""
        return (
            f"at {self.t_ns / 1e9:.3f} s (event {self.event}, command {self.index}): {self.what}."
        )


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """What was compared, up to the end of the log or the first difference."""

    identical: bool
    events: int
    commands: int
    first_difference: Difference | None

    def as_json(self) -> dict[str, Any]:
        """As the command line prints it."""
        return asdict(self)

    def sentence(self) -> str:
        """One line for people."""
        if self.first_difference is None:
            return f"identical: {self.events} events gave the same {self.commands} commands."
        return f"different {self.first_difference.sentence()}"


class ReplayedBody:
    """Yields a log's events in order of arrival and checks what is sent against the log.

    With `perception`, every `Seen` is computed again from the logged frames (its `stage_ms` are
    not compared). Events end at the first difference. Raises LogError for a log that is cut,
    damaged, or lacks the frames.
    """

    def __init__(self, log: LogReader, perception: Sees | None = None) -> None:
        log.require_complete()
        self._log = log
        self._perception = perception
        self._frames: dict[int, Entry] = {}
        self._sent: list[Command] = []
        self._events = 0
        self._commands = 0
        self._difference: Difference | None = None

    @property
    def result(self) -> ReplayResult:
        """What has been compared so far."""
        return ReplayResult(
            self._difference is None, self._events, self._commands, self._difference
        )

    def events(self) -> Iterator[Event]:
        """Every event; between two of them the commands sent since are compared."""
        current: Event | None = None
        expected: list[Entry] = []
        kinds: tuple[Kind, ...] = ("event", "command")
        for entry in self._log.entries(("frame", *kinds) if self._perception else kinds):
            if entry.kind == "frame":
                self._frames[entry.number] = entry
            elif entry.kind == "command":
                expected.append(entry)
            else:
                if not self._agrees(current, expected):
                    return
                expected = []
                current = self._event(entry)
                if self._difference is not None:
                    return
                yield current
        if self._agrees(current, expected) and self._log.ending != "complete":
            raise self._log.error()

    def send(self, command: Command) -> None:
        """Keep the command for comparison; it moves nothing."""
        self._sent.append(command)

    def _event(self, entry: Entry) -> Event:
        self._events += 1
        event: Event = self._log.decoded(entry)
        if self._perception is None or not isinstance(event, Seen):
            return event
        frame = self._frames.pop(event.seq, None)
        if frame is None:
            raise LogError(
                f"{self._log.path}: the log does not hold frame {event.seq}; replay it without "
                "`--from frames`, or record a run with `sweeper record`."
            )
        for seq in [seq for seq in self._frames if seq < event.seq]:
            del self._frames[seq]  # dropped by the newest-wins slot: perception never saw it
        fresh = self._perception.see(self._log.decoded(frame), event.arrived_ns)
        logged, again = (_without_times(seen) for seen in (event, fresh))
        if logged != again:
            self._differ(event, Seen, logged, again)
        return fresh

    def _agrees(self, event: Event | None, expected: list[Entry]) -> bool:
        """Compare the answers to `event` with the logged ones."""
        sent, self._sent = self._sent, []
        for i in range(max(len(sent), len(expected))):
            got = encode(sent[i]) if i < len(sent) else b""
            entry = expected[i] if i < len(expected) else None
            same = entry is not None and i < len(sent) and type(sent[i]) is entry.type
            if entry is None or not (same and got == entry.text):
                kind = entry.type if entry else type(sent[i])
                self._differ(event, kind, entry.text if entry else b"", got, same)
                return False
            self._commands += 1
        return True

    def _differ(
        self, event: Event | None, kind: type, expected: bytes, got: bytes, same: bool = True
    ) -> None:
        self._difference = Difference(
            self._commands,
            self._events,
            event.t_ns if event else 0,
            _describe(kind, expected, got, same),
            expected.decode(),
            got.decode(),
        )


def replay(
    path: Path | str,
    from_frames: bool = False,
    make_brain: Callable[[Config], Brain] | None = None,
    make_perception: Callable[[LogHeader], Sees] | None = None,
) -> ReplayResult:
    """Feed a log to a new brain and compare its commands with the logged ones.

    `from_frames` computes landmarks and scans again from the recorded images. Raises LogError for
    a log that is missing, cut, damaged or lacks what is asked for, and ConfigError for a
    configuration that this version does not know.
    """
    with LogReader(path) as log:
        perception = None
        if from_frames:
            perception = (make_perception or _perception)(log.header)
        body = ReplayedBody(log, perception)
        if make_brain is None:
            brain = brain_of(log.header, str(path))
        else:
            brain = make_brain(log.header.config())
        run(body, brain, _NoLog())
        return body.result


def brain_of(header: LogHeader, name: str, config: Config | None = None) -> Brain:
    """The brain that wrote the log, or with another `config`. Raises ConfigError, MapError."""
    from robot.body.kept.home_file import decode_home
    from robot.brain import Brain

    home = decode_home(header.home, f"the map in {name}") if header.home else None
    return Brain(config or header.config(), home)


def _perception(header: LogHeader) -> Sees:
    """The perception that made the log: calibration from its header, network from this machine."""
    config = header.config()
    if config.perception.matcher == "given":
        raise LogError(
            "the log was made with true disparity, which frames do not hold; replay it without "
            "`--from frames`."
        )

    from robot.body.sources import open_depth, open_perception
    from robot.perception.calibration_files import parse_calibration
    from robot.perception.chain import Perception
    from robot.perception.rectify import Rectifier

    if not header.calibration:
        return open_perception(config)
    size = config.camera.width_px, config.camera.height_px
    mount = config.camera.stereo_camera().base_from_cam
    calibration = parse_calibration(header.calibration, header.calibration_name)
    rectifier = Rectifier(calibration, *size, mount)
    depth = open_depth(config, rectifier.camera)
    return Perception(config.perception, config.robot, rectifier.camera, depth, rectifier)


def _without_times(seen: Seen) -> bytes:
    fields = {name: getattr(seen, name) for name in Seen.__slots__}
    return encode(Seen(**{**fields, "stage_ms": {}}))


def _describe(kind: type, expected: bytes, got: bytes, same: bool) -> str:
    """Which field of which message differs, in words."""
    name = kind.__name__
    if not got:
        return f"the log holds a {name}, the replay sent nothing more"
    if not expected:
        return f"the replay sent a {name} that the log does not hold"
    if not same:
        return f"the log holds a {name}, the replay sent something else"
    a, b = decode(kind, expected), decode(kind, got)
    for field in kind.__slots__:  # type: ignore[attr-defined]
        left, right = encode(getattr(a, field)), encode(getattr(b, field))
        if left != right:
            return f"{name}.{field} was {_short(left)} and is now {_short(right)}"
    return f"{name} is written differently"


def _short(text: bytes) -> str:
    return text.decode() if len(text) <= 60 else f"{text[:57].decode(errors='replace')}..."


class _NoLog:
    """A replay writes no log of its own."""

    def event(self, event: Event) -> None: ...

    def command(self, command: Command) -> None: ...

    def flush(self) -> None: ...
