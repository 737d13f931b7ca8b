"""The folder in which the robot keeps its home: written so that a power cut loses nothing.

A new file is written beside the old one and flushed to the card before it takes its name, and the
one before stays as the previous generation. At every moment either is whole.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from robot.body.kept.home_file import decode_home, encode_home
from robot.errors import MapError
from robot.home import Home

NAME, PREVIOUS = "home.npz", "home.previous.npz"


class HomeStore:
    """Loads and saves the home in one folder."""

    def __init__(self, folder: Path) -> None:
        self.path, self.previous = folder / NAME, folder / PREVIOUS

    def load(self, warn: Callable[[str], None]) -> tuple[bytes, Home] | None:
        """The newest whole home with its bytes; None where there never was one.

        A damaged newest one is reported to `warn` and the previous one taken. Raises MapError when
        no generation is whole: nothing is overwritten before somebody has seen to it.
        """
        problems: list[MapError] = []
        for path in (self.path, self.previous):
            try:
                data = path.read_bytes()
            except FileNotFoundError:
                continue
            except OSError as error:
                raise MapError(
                    f"{path}: cannot be read ({error.strerror}); see to its permissions."
                ) from None
            try:
                home = decode_home(data, str(path))
            except MapError as error:
                problems.append(error)
                continue
            for problem in problems:
                warn(f"{problem} The previous generation is used meanwhile.")
            return data, home
        if problems:
            raise problems[0]
        return None

    def save(self, home: Home) -> None:
        """Keep `home`. Raises MapError where the folder cannot be written; the old one stays."""
        data = encode_home(home)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.exists():
                write_whole(self.previous, self.path.read_bytes())
            write_whole(self.path, data)
        except OSError as error:
            raise MapError(
                f"{self.path}: the map cannot be saved ({error.strerror}); free some space or give "
                "a writable folder."
            ) from None


def write_whole(path: Path, data: bytes) -> None:
    """Replace a file's content so that it is the old or the new one, whenever the power goes."""
    partial = path.with_name(path.name + ".partial")
    with open(partial, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
