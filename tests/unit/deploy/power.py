"""A power cut at every step of what touches the card: what may be left is laid out in folders.

`record` runs a function while every change under a folder is noted: writes, syncs, new names,
renames, links, removals. `aftermaths` then builds what a cut after each step may leave. A write
that was not synced may be lost, torn in half or there; names (creations, renames, links, removals)
that were not synced by a sync of their folder may be lost, but only from the newest on, as a
journalling file system keeps their order. Never more than that is lost, and never less is tried.
"""

import builtins
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Step:
    """One change; `data` is a file's whole content after a write."""

    what: str  # write, sync, sync_folder, create, rename, link, remove, mkdir, rmdir, chmod
    path: str
    data: bytes = b""
    other: str = ""


class _Written:
    """A file opened for writing whose content is noted when it is flushed or closed."""

    def __init__(self, file, note, path):
        self._file, self._note, self._path, self._last = file, note, path, b""

    def __getattr__(self, name):
        return getattr(self._file, name)

    def _tell(self):
        data = Path(self._path).read_bytes()
        if data != self._last:
            self._last = data
            self._note(Step("write", self._path, data))

    def flush(self):
        self._file.flush()
        self._tell()

    def close(self):
        if not self._file.closed:
            self._file.close()
            self._tell()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()


@contextmanager
def watched(root: Path, note: Callable[[Step], None]) -> Iterator[None]:
    """Note every change under `root` that goes through open and os."""
    root = str(root)
    names = ("fsync", "replace", "rename", "symlink", "unlink", "remove", "mkdir", "rmdir")
    real = {name: getattr(os, name) for name in names}
    real_open = builtins.open

    def inside(path):
        return os.path.abspath(os.fspath(path)).startswith(root + os.sep)

    def name(path, dir_fd=None):
        if dir_fd is not None:
            path = os.path.join(os.readlink(f"/proc/self/fd/{dir_fd}"), os.fspath(path))
        return os.path.abspath(os.fspath(path))

    def opened(file, mode="r", *rest, **options):
        if isinstance(file, int) or not set(mode) & set("wax+") or not inside(file):
            return real_open(file, mode, *rest, **options)
        path = name(file)
        there = os.path.lexists(path)
        note(Step("write", path, b"") if there and "w" in mode else Step("create", path))
        return _Written(real_open(file, mode, *rest, **options), note, path)

    def fsync(descriptor):
        real["fsync"](descriptor)
        path = os.readlink(f"/proc/self/fd/{descriptor}")
        if inside(path) or path == root:
            note(Step("sync_folder" if os.path.isdir(path) else "sync", path))

    def moving(how):
        def move(source, target, **options):
            real[how](source, target, **options)
            if inside(target):
                note(Step("rename", name(source), other=name(target)))

        return move

    def symlink(target, link, *rest, **options):
        real["symlink"](target, link, *rest, **options)
        if inside(link):
            note(Step("link", name(link), other=os.fspath(target)))

    def removing(how, what):
        def remove(path, *rest, dir_fd=None, **options):
            full = name(path, dir_fd)
            real[how](path, *rest, dir_fd=dir_fd, **options)
            if inside(full):
                note(Step(what, full))

        return remove

    def mkdir(path, *rest, **options):
        real["mkdir"](path, *rest, **options)
        if inside(path):
            note(Step("mkdir", name(path)))

    changed = {
        "fsync": fsync, "replace": moving("replace"), "rename": moving("rename"),
        "symlink": symlink, "unlink": removing("unlink", "remove"),
        "remove": removing("remove", "remove"), "mkdir": mkdir, "rmdir": removing("rmdir", "rmdir"),
    }  # fmt: skip
    builtins.open = opened
    for key, function in changed.items():
        setattr(os, key, function)
    try:
        yield
    finally:
        builtins.open = real_open
        for key, function in real.items():
            setattr(os, key, function)


def record(root: Path, function: Callable[[], None]) -> list[Step]:
    """The steps of a function that changes files under `root`."""
    steps: list[Step] = []
    with watched(root, steps.append):
        function()
    return steps


def aftermaths(
    before: Path, root: Path, steps: list[Step], scratch: Path, stride: int = 1
) -> Iterator[tuple[str, Path]]:
    """What a cut after each step may leave: a name for it, and a folder.

    `before` is a copy of `root` from before the steps. `stride` thins out the cuts.
    """
    for cut in range(0, len(steps) + 1, stride):
        done = steps[:cut]
        safe = _names_that_are_safe(done)
        for lost in sorted({0, 1, len(done) - safe}):
            upto = len(done) - lost
            if upto < safe:
                continue
            for torn in ("whole", "half", "empty"):
                shutil.rmtree(scratch, ignore_errors=True)
                shutil.copytree(before, scratch, symlinks=True)
                _replay(done, upto, torn, str(root), str(scratch))
                yield f"cut {cut}, {lost} names lost, writes {torn}", scratch


def _names_that_are_safe(done: list[Step]) -> int:
    """Number of steps whose names must be there: those before the last sync of a folder."""
    synced = [k for k, step in enumerate(done) if step.what == "sync_folder"]
    return synced[-1] + 1 if synced else 0


def _replay(done: list[Step], upto: int, torn: str, root: str, scratch: str) -> None:
    """Lay out the steps: names up to `upto`, contents synced or torn."""

    def place(path: str) -> str:
        return scratch + path.removeprefix(root)

    synced_at = {}
    for k, step in enumerate(done):
        if step.what == "sync":
            synced_at[step.path] = k
    for k, step in enumerate(done):
        if k >= upto and step.what != "write":
            continue
        path = place(step.path)
        if step.what == "create":
            Path(path).touch()
        elif step.what == "write" and os.path.isfile(path):
            kept = synced_at.get(step.path, -1) > k or torn == "whole"
            data = (
                step.data if kept else b"" if torn == "empty" else step.data[: len(step.data) // 2]
            )
            Path(path).write_bytes(data)
        elif step.what == "rename" and os.path.lexists(path):
            os.replace(path, place(step.other))
        elif step.what == "link":
            os.symlink(step.other, path)
        elif step.what == "remove" and os.path.lexists(path):
            os.unlink(path)
        elif step.what == "mkdir":
            os.makedirs(path, exist_ok=True)
        elif step.what == "rmdir" and os.path.isdir(path):
            shutil.rmtree(path)
