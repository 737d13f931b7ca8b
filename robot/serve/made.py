"""Files made by a `sweeper` process of its own: this one stays small and need not wait for it."""

from __future__ import annotations

import asyncio
import sys
import tempfile
from pathlib import Path


async def made(words: list[str], option: str, name: str, patience_s: float) -> bytes | None:
    """What `sweeper WORDS OPTION name` writes, in a folder that is thrown away; None: nothing.

    Findings that are errors make `sweeper check` fail; what it wrote counts all the same.
    """
    quiet = asyncio.subprocess.DEVNULL
    with tempfile.TemporaryDirectory(prefix="sweeper-made-") as folder:
        target = Path(folder) / name
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "robot", *words, option, str(target), stdin=quiet, stdout=quiet
        )
        try:
            await asyncio.wait_for(process.wait(), patience_s)
        except TimeoutError:
            return None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        return target.read_bytes() if target.is_file() else None
