"""The whole bridge on a bad line: short trials here, ten million bytes where marked long."""

from __future__ import annotations

from pathlib import Path

import noise_trials
import pytest

FULL = pytest.param(10**7, marks=[pytest.mark.long, pytest.mark.timeout(3600)])
CLEAN = {"expired", "link_lost"}


@pytest.mark.parametrize("total", [150_000, FULL])
@pytest.mark.parametrize("share", [0.001, 0.01])
def test_up_to_one_percent_stops_nothing(firmware_binary: Path, share: float, total: int) -> None:
    report = noise_trials.at_share(firmware_binary, share, total)
    assert set(report) == {"bytes", "hurt"}, report
    assert report["hurt"] > 0.7 * share * total


@pytest.mark.parametrize("total", [200_000, FULL])
def test_five_percent_stops_cleanly_if_at_all(firmware_binary: Path, total: int) -> None:
    report = noise_trials.at_share(firmware_binary, 0.05, total)
    assert set(report) - {"bytes", "hurt"} <= CLEAN, report


@pytest.mark.parametrize("total", [200_000, FULL])
def test_twenty_percent_stops_and_recovers(firmware_binary: Path, total: int) -> None:
    report = noise_trials.hopeless(firmware_binary, 0.2, total)
    assert report["stopped rounds"] >= 10
    assert report["worst recovery ms"] <= 1000
    assert set(report) - {"bytes", "stopped rounds", "worst recovery ms"} <= CLEAN, report


@pytest.mark.parametrize(
    "count", [20, pytest.param(1000, marks=[pytest.mark.long, pytest.mark.timeout(3600)])]
)
def test_bursts(firmware_binary: Path, count: int) -> None:
    report = noise_trials.bursts(firmware_binary, count)
    assert report["worst recovery ms"] <= 1000
    assert set(report) - {"bursts", "worst recovery ms"} <= CLEAN, report
