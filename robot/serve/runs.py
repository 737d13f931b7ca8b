"""Past runs on the disk: only listed folders, only files of known names, and no links."""

from __future__ import annotations

import contextlib
import json
import os
import re
import stat
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

from starlette.concurrency import iterate_in_threadpool
from starlette.responses import JSONResponse, Response, StreamingResponse

FILES = {
    "map.png": "image/png",
    "map.pgm": "image/x-portable-graymap",
    "map.yaml": "text/plain; charset=utf-8",
    "summary.json": "application/json",
    "trajectory.tum": "text/plain; charset=utf-8",
    "log.mcap": "application/octet-stream",
}
MAX_LISTED = 100
MAX_SUMMARY_BYTES = 1 << 20
_ID = re.compile(r"[0-9]{8}-[0-9]{6}[A-Za-z0-9_.-]{0,80}")
_SEGMENT = re.compile(r"(before-)?log-[0-9]{6}\.mcap")  # of the ring, or saved from it
_BLOCK = 1 << 16


class Runs:
    """The folder of run folders."""

    def __init__(self, root: Path) -> None:
        self._root = root

    @property
    def present(self) -> bool:
        """Whether there is such a folder."""
        return self._root.is_dir()

    def newest(self, limit: int) -> list[dict[str, Any]]:
        """Id, files with their sizes, and summary (None while the run goes on)."""
        return [self._describe(run) for run in sorted(self._ids(), reverse=True)[:limit]]

    def file(self, run: str, name: str) -> Path | None:
        """The file's path, if the run is listed and the name is one of ours."""
        if not (name in FILES or _SEGMENT.fullmatch(name)) or run not in self._ids():
            return None
        path = self._root / run / name
        return path if _size(path) is not None else None

    def _ids(self) -> set[str]:
        try:
            with os.scandir(self._root) as entries:
                return {
                    entry.name
                    for entry in entries
                    if _ID.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False)
                }
        except OSError:
            return set()

    def _describe(self, run: str) -> dict[str, Any]:
        folder = self._root / run
        names = [*FILES, *sorted(_segments(folder))]
        sizes = {name: size for name in names if (size := _size(folder / name)) is not None}
        summary = None
        if 0 < sizes.get("summary.json", 0) <= MAX_SUMMARY_BYTES:
            with contextlib.suppress(OSError, ValueError, RecursionError):
                read = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
                # Whatever else wrote it: NaN and half characters cannot be handed on.
                json.dumps(read, allow_nan=False, ensure_ascii=False).encode()
                summary = _brief(read) if isinstance(read, dict) else None
        return {"id": run, "files": sizes, "summary": summary}


class Ring:
    """The folder of log segments that the runtime keeps in memory; the oldest give way."""

    def __init__(self, root: Path | None) -> None:
        self._root = root

    @property
    def present(self) -> bool:
        """Whether there is such a folder."""
        return self._root is not None and self._root.is_dir()

    def newest(self) -> list[dict[str, Any]]:
        """Name, bytes and end of each segment, the newest first."""
        found = []
        for path in [self._root / name for name in _segments(self._root)] if self._root else []:
            with contextlib.suppress(OSError):
                state = path.lstat()
                if stat.S_ISREG(state.st_mode):
                    ended_s = round(state.st_mtime, 1)
                    found.append({"name": path.name, "bytes": state.st_size, "ended_s": ended_s})
        return sorted(found, key=lambda segment: str(segment["name"]), reverse=True)

    def file(self, name: str) -> Path | None:
        """The segment's path, if it is there and no link."""
        if self._root is None or not _SEGMENT.fullmatch(name):
            return None
        path = self._root / name
        return path if _size(path) is not None else None


NO_RING = Ring(None)


def _segments(folder: Path) -> list[str]:
    try:
        return [name for name in os.listdir(folder) if _SEGMENT.fullmatch(name)]
    except OSError:
        return []


def send_file(path: Path, download_name: str) -> Response:
    """The file as it is now: a log that is being written does not outgrow its stated length."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    except OSError:
        return JSONResponse({"error": "there is no such run or file"}, 404)
    size = os.fstat(handle).st_size
    headers = {"content-length": str(size)}
    if path.suffix != ".png":
        headers["content-disposition"] = f'attachment; filename="{download_name}"'
    blocks = iterate_in_threadpool(_blocks(handle, size))
    return _File(blocks, handle, FILES.get(path.name, FILES["log.mcap"]), headers)


class _File(StreamingResponse):
    """Closes its handle, also when nobody reads to the end."""

    def __init__(
        self, blocks: AsyncIterator[bytes], handle: int, media: str, headers: dict[str, str]
    ) -> None:
        super().__init__(blocks, media_type=media, headers=headers)
        self._handle = handle

    async def __call__(self, *arguments: Any) -> None:
        try:
            await super().__call__(*arguments)
        finally:
            os.close(self._handle)


def _blocks(handle: int, size: int) -> Iterator[bytes]:
    left = size
    while left > 0:
        block = os.read(handle, min(_BLOCK, left))
        # A file that shrinks meanwhile would leave the reader waiting.
        block = block or bytes(min(_BLOCK, left))
        left -= len(block)
        yield block


def _size(path: Path) -> int | None:
    """Of a regular file that is no link."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_size if stat.S_ISREG(found.st_mode) else None


def _brief(summary: dict[str, Any]) -> dict[str, Any]:
    """The figures that a list shows."""
    return {k: v for k, v in summary.items() if k not in ("stage_ms", "log")}
