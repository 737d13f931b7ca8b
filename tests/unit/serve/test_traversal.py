"""A thousand ways to ask for a file that is not a run's: none gets one."""

import itertools
import socket
from urllib.parse import quote

import pytest

from robot.serve.runs import FILES, Runs

RUN = "20260102-030405-clean"
UPS = (
    "..",
    "%2e%2e",
    "%2E.",
    "..%00",
    ".",
    "%252e%252e",
    "..;",
    "%c0%ae%c0%ae",
    "．．",
    "...",
    "....",
)
SLASHES = ("/", "%2f", "\\", "%5c", "//", "/./", "%252f", "%c0%af")
TARGETS = ("secret.txt", "etc/passwd", "keys.json", RUN + "/secret.txt")
STARTS = ("/api/v1/runs/", f"/api/v1/runs/{RUN}/", "/api/v1/logs/", "/", "/static/")


def variants():
    for start, up, slash, target, depth in itertools.product(
        STARTS, UPS, SLASHES, TARGETS, (1, 2, 6)
    ):
        yield start + (up + slash) * depth + target.replace("/", slash)


def test_no_variant_escapes(house):
    server, *_ = house
    paths = list(variants())[::3] + [
        f"/api/v1/runs/{RUN}/secret.txt",
        f"/api/v1/runs/{RUN}/trajectory.tum",  # a link that leads out
        f"/api/v1/runs/{RUN}/log.mcap%00.png",
        f"/api/v1/runs/{RUN}%00/log.mcap",
        "/api/v1/runs/latest/log.mcap",
        "/api/v1/logs/log-000002.mcap",  # a link that leads out
        f"/api/v1/runs//{RUN}/log.mcap",
    ]
    assert len(paths) >= 1000
    escaped, tried = [], 0
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as client:
        reader = client.makefile("rb")
        for path in paths:
            raw = quote(path, safe="/%\\;.:")
            client.sendall(
                f"GET {raw} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
                f"Authorization: Bearer {server.token}\r\n\r\n".encode()
            )
            status, body = read_answer(reader)
            tried += 1
            if status == 200 or b"SECRET" in body or b"root:" in body:
                escaped.append((path, status))
    print(f"{tried} variants, {len(escaped)} escapes")
    assert escaped == [] and tried == len(paths)


def read_answer(reader):
    status = int(reader.readline().split()[1])
    length = 0
    while (line := reader.readline()) not in (b"\r\n", b""):
        name, _, value = line.partition(b":")
        if name.lower() == b"content-length":
            length = int(value)
    return status, reader.read(length)


@pytest.mark.parametrize("run", ["..", ".", "", "latest", "a/b", "20260102-030405-x/../y", "\0"])
def test_only_listed_folders_are_runs(tmp_path, run):
    (tmp_path / "runs").mkdir()
    (tmp_path / "log.mcap").write_text("no")
    runs = Runs(tmp_path / "runs")
    assert all(runs.file(run, name) is None for name in FILES)


def test_linked_folders_and_files_are_not_followed(tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "log.mcap").write_text("no")
    root = tmp_path / "runs"
    (root / "20260101-000000-a").mkdir(parents=True)
    (root / "20260101-000001-b").symlink_to(outside)
    (root / "20260101-000000-a" / "log.mcap").symlink_to(outside / "log.mcap")
    runs = Runs(root)
    assert runs.file("20260101-000001-b", "log.mcap") is None
    assert runs.file("20260101-000000-a", "log.mcap") is None
    assert [run["id"] for run in runs.newest(9)] == ["20260101-000000-a"]


def test_odd_summaries_do_no_harm(tmp_path):
    from starlette.responses import JSONResponse

    for number, text in enumerate(["", "[1]", "{", '{"a": NaN}', "9" * 100, r'{"a": "\ud800"}']):
        folder = tmp_path / f"20260101-00000{number}-a"
        folder.mkdir()
        (folder / "summary.json").write_text(text)
    listed = Runs(tmp_path).newest(10)
    assert len(listed) == 6 and JSONResponse({"runs": listed}).body
    assert not Runs(tmp_path / "none").present and Runs(tmp_path / "none").newest(3) == []
