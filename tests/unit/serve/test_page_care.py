"""The page's fan, calibration wizard and releases, in a real browser at two sizes."""

import numpy as np
import pytest
from board_pictures import SIZE, views
from browsing import CHROMIUM, SIZES, browser, open_page, until
from serving import wait_for

from robot.calibrate.board import parse_board
from robot.calibrate.coverage import Coverage
from robot.calibrate.stereo import calibrate_stereo
from robot.messages import StereoFrame

__all__ = ["browser"]
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="the Debian package chromium is missing")
BOARD = "chess:8x6:24mm"


@pytest.fixture(params=SIZES)
def page(browser, house, request):
    """The page; fails on any error in its console."""
    with open_page(browser, house, request.param) as page:
        yield page


def test_the_fan_is_set_and_shows_what_others_set(page, house):
    server, robot, _ = house
    page.wait_for_selector("#fan label")
    page.check("#fan-low", force=True)
    wait_for(lambda: robot.books.settings.fan == "low")
    until(page, "sweeper.map.drawn.fan.level === 'low'")
    server.json("/api/v1/fan", "POST", body='{"level": "high"}')
    until(page, "document.querySelector('#fan-high').checked")


def test_a_zone_is_saved_cleaned_by_its_name_and_forgotten(page, house):
    _, robot, _ = house
    robot.books.forget()
    page.click("#tab-map")
    page.click("#draw-zones")
    page.evaluate("sweeper.map.sketch.shapes = [[0, 0, 1, 1]], sweeper.map.onSketch()")
    page.fill("#sketch-name", "Rug")
    page.keyboard.press("Enter")
    page.click("[aria-label='Clean Rug']")
    wait_for(lambda: robot.asked and robot.asked[-1] == ("clean zones", ("Rug",)))
    page.click("[aria-label='Remove Rug']")
    until(page, "(sweeper.map.drawn.annotations.zones || []).length === 0")
    robot.state = "docked"


def test_the_wizard_shows_coverage_and_row_errors_and_saves(page, house):
    from axe_playwright_python.sync_playwright import Axe

    _, robot, _ = house
    desk = robot.books.desk
    page.click("#tab-health")
    page.click("#cal-open")
    page.fill("#cal-board", "a tray")
    page.click("#cal-form button")
    until(page, "document.querySelector('#toast').textContent.includes('is no board')")
    page.fill("#cal-board", BOARD)
    page.click("#cal-form button")
    wait_for(lambda: desk._sitting is not None and desk._sitting.is_alive())
    assert page.is_disabled("#cal-save")
    desk.frame(StereoFrame(0, 1, *[np.full((480, 640), 90, np.uint8)] * 2))
    until(page, "document.querySelector('#cal-seen').textContent === 'No board in sight.'")
    look_at(desk._sitting)
    until(page, "document.querySelector('#cal-rows').className === 'ok'")
    assert page.inner_text("#cal-views") == "14 of 20"
    assert page.evaluate("document.querySelectorAll('#cal-cells .often').length") > 5
    assert [v["id"] for v in Axe().run(page).response["violations"]] == []
    page.click("#cal-save")
    until(page, "document.querySelector('#cal-advice').textContent.includes('stereo.yaml')")
    page.click("#cal-close")
    wait_for(lambda: not desk._sitting.is_alive())


def look_at(sitting):
    """As if the board had been shown at fourteen places."""
    board = parse_board(BOARD)
    seen, coverage = views(board), Coverage(SIZE)
    for view in seen:
        coverage.add(view.left)
    sitting.result = calibrate_stereo(seen, board, SIZE)
    sitting.told = {
        **sitting.told,
        "views": len(seen),
        "seen": "taken",
        "counts": coverage.counts.tolist(),
        "covered_pct": 100.0 * coverage.share,
        "advice": coverage.advice(),
        "rms_px": sitting.result.rms_px,
        "epipolar_unseen_px": sitting.result.unseen_epipolar_px,
    }


def test_eyes_that_are_exact_need_no_wizard(page, house):
    house[1].books.desk._why_not = "the eyes are exact"
    page.click("#tab-health")
    until(page, "document.querySelector('#cal-why-not').textContent === 'The eyes are exact.'")
    assert not page.is_visible("#cal-open")
    house[1].books.desk._why_not = ""


def test_releases_are_shown_with_what_to_type(browser, house):
    home = house[2] / "opt"
    home.mkdir()
    (home / "current").symlink_to("releases/0.2.0-bbbb")
    (home / "previous").symlink_to("releases/0.1.0-aaaa")
    with open_page(browser, house, "phone") as page:
        page.click("#tab-health")
        until(page, "document.querySelector('#slots').textContent.includes('0.2.0-bbbb')")
        assert "install.sh --update" in page.inner_text("#update-words")
        assert "rollback" in page.inner_text("#rollback-words")
    (home / "current").unlink()
