"""Something to send along when asking for help."""

import asyncio
import sys
import tempfile
from pathlib import Path

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot

PATIENCE_S = 120.0
_one_at_a_time = asyncio.Semaphore(1)


async def read(robot: Robot, request: Request) -> Response:
    """Made by a process of its own, which leaves the running robot's devices alone."""
    if _one_at_a_time.locked():
        return JSONResponse({"error": "a bundle is being made already; wait for it"}, 429)
    async with _one_at_a_time:
        with tempfile.TemporaryDirectory(prefix="sweeper-bundle-") as folder:
            data = await _make(Path(folder) / "bundle.tar.gz", robot.config)
    if data is None:
        return JSONResponse({"error": "the bundle could not be made; see the journal"}, 503)
    name = f"sweeper-{robot.robot_id}-support.tar.gz"
    headers = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(data, media_type="application/gzip", headers=headers)


async def _make(target: Path, config: Path | None) -> bytes | None:
    words = ["check", "--beside", "--bundle", str(target)]
    words += ["--config", str(config)] if config is not None else []
    quiet = asyncio.subprocess.DEVNULL
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "robot", *words, stdin=quiet, stdout=quiet
    )
    try:
        await asyncio.wait_for(process.wait(), PATIENCE_S)
    except TimeoutError:
        return None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    # Findings that are errors make the check fail; the bundle is there all the same.
    return target.read_bytes() if target.is_file() else None


CAPABILITY = Capability(
    "bundle",
    "Support bundle",
    "Findings, settings, versions, journal and summaries as a .tar.gz: no secrets, no images.",
    (
        Operation(
            "GET", "/bundle", "Make one and download it.", read, media="application/gzip",
            refusals=(503,),
        ),
    ),
)  # fmt: skip
