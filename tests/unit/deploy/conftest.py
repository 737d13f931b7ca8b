"""A folder that stands for the card; the deploy folder's files as modules."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "deploy"))


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    """Nothing here outlives the test: the disk need not be waited for."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture
def root(tmp_path):
    made = tmp_path / "card"
    (made / "boot/firmware").mkdir(parents=True)
    (made / "boot/firmware/config.txt").write_text("# Pi\narm_64bit=1\n\n[pi4]\narm_boost=1\n")
    return made
