"""The support bundle over HTTP: made by a process of its own, whole, without secrets."""

import io
import json
import tarfile
from concurrent.futures import ThreadPoolExecutor

from serving import served, wait_for


def test_the_bundle_is_whole_and_made_one_at_a_time(tmp_path):
    config = tmp_path / "robot.toml"
    config.write_text("[robot]\nradius_m = 0.18\n")
    with served(tmp_path, tmp_path / "nobody.sock", config=config) as server:
        with ThreadPoolExecutor(1) as pool:
            first = pool.submit(server.ask, "/api/v1/bundle", timeout=120)
            from robot.serve.capabilities.bundle import _one_at_a_time

            wait_for(_one_at_a_time.locked)
            assert server.ask("/api/v1/bundle")[0] == 429
            status, headers, body = first.result()
        assert status == 200 and headers["content-type"] == "application/gzip"
        assert "sweeper-t1-support.tar.gz" in headers["content-disposition"]
        assert server.token.encode() not in body
    with tarfile.open(fileobj=io.BytesIO(body)) as archive:
        names = archive.getnames()
        found = json.load(archive.extractfile("sweeper/check.json"))["checks"]
        settings = archive.extractfile("sweeper/config.toml").read().decode()
    assert {finding["code"] for finding in found} >= {"disk", "memory"}
    assert not {finding["code"] for finding in found} & {"serial", "camera"}  # devices left alone
    assert "radius_m = 0.18" in settings
    assert not any(name.endswith((".png", ".jpg", ".mcap")) for name in names)


def test_settings_that_cannot_be_read_are_told(tmp_path):
    with served(tmp_path, tmp_path / "nobody.sock", config=tmp_path / "none.toml") as server:
        status, _, body = server.ask("/api/v1/bundle", timeout=120)
    assert status == 503 and "could not be made" in json.loads(body)["error"]
