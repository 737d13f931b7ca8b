"""The page's map editor, plan and drive pad, in a real browser at two sizes."""

import time

import pytest
from browsing import CHROMIUM, SIZES, browser, open_page, until
from serving import wait_for

__all__ = ["browser"]
NAMES = "(sweeper.map.drawn.rooms || []).map((room) => room.name).join()"
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="the Debian package chromium is missing")


@pytest.fixture(params=SIZES)
def page(browser, house, request):
    """The page, with the rooms as found, unnamed; fails on any error in its console."""
    house[1].books.forget()
    house[1].asked.clear()
    with open_page(browser, house, request.param) as page:
        # The server may still show what the test before named and drew.
        until(page, f"({NAMES}) === 'room 1,room 2'")
        for kind in ("no_go", "walls", "zones"):
            until(page, f"{drawn(kind)} === 0")
        yield page


def drag(page, start, end):
    """From one place of the map to another, metres."""
    at = """([x, y]) => {
      const m = sweeper.map, b = m.canvas.getBoundingClientRect();
      return [b.left + m.width / 2 + (x - m.centre.x) * m.scale,
              b.top + m.height / 2 - (y - m.centre.y) * m.scale];
    }"""
    page.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")
    page.mouse.move(*page.evaluate(at, start))
    page.mouse.down()
    page.mouse.move(*page.evaluate(at, end), steps=4)
    page.mouse.up()


def drawn(what):
    return f"((sweeper.map.drawn.annotations || {{}}).{what} || []).length"


def test_zones_areas_walls_and_places_are_drawn(page, house):
    _, robot, _ = house
    page.click("#tab-map")
    page.click("#draw-zones")
    assert page.is_disabled("#sketch-done")
    drag(page, (-0.5, -0.5), (0.5, 0.5))
    drag(page, (-1.0, 0.6), (-0.4, 1.1))
    assert page.inner_text("#sketch-done") == "Clean 2 zones"
    page.click("#sketch-done")
    wait_for(lambda: robot.asked and robot.asked[-1][0] == "clean zones")
    corners = [float(value) for value in robot.asked[-1][1]]
    assert corners == pytest.approx([-0.5, -0.5, 0.5, 0.5, -1.0, 0.6, -0.4, 1.1], abs=0.03)

    page.click("#draw-no-go")
    drag(page, (0.7, 0.7), (1.2, 1.2))
    page.click("#sketch-done")
    until(page, f"{drawn('no_go')} === 1")
    page.click("#draw-wall")
    drag(page, (-1.0, 1.0), (0.0, 1.0))
    page.click("#sketch-done")
    until(page, f"{drawn('walls')} === 1")
    page.click("[aria-label='Remove wall 1']")
    until(page, f"{drawn('walls')} === 0")
    page.click("#drawings-undo")
    until(page, f"{drawn('walls')} === 1")
    page.click("#draw-go-to")
    drag(page, (0.5, 0.5), (0.5, 0.5))
    page.click("#sketch-done")
    wait_for(lambda: robot.asked[-1][0] == "go to")
    page.fill("#snapshot-name", "summer")
    page.keyboard.press("Enter")
    page.wait_for_selector("[aria-label='Restore summer']")
    page.click("[aria-label='Restore summer']")


def test_a_refusal_is_told_and_the_drawing_stays(page):
    page.click("#tab-map")
    page.click("#draw-no-go")
    drag(page, (-0.3, -0.3), (0.3, 0.3))
    page.click("#sketch-done")
    until(page, "document.querySelector('#toast').textContent.includes('catch the robot')")
    assert page.evaluate("sweeper.map.sketch.shapes.length") == 1
    page.click("#sketch-cancel")
    assert not page.is_visible("#sketchbar")


def test_a_zone_can_be_drawn_with_the_keyboard(page, house):
    _, robot, _ = house
    page.click("#tab-map")
    page.focus("#draw-zones")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "map"
    page.keyboard.press("Enter")
    for key in ["ArrowRight"] * 6 + ["ArrowUp"] * 4:
        page.keyboard.press(key)
    page.keyboard.press("Enter")
    page.focus("#sketch-done")
    page.keyboard.press("Enter")
    wait_for(lambda: robot.asked and robot.asked[-1][0] == "clean zones")
    x0, y0, x1, y1 = (float(value) for value in robot.asked[-1][1])
    assert (x1 - x0, y1 - y0) == pytest.approx((0.6, 0.4))
    page.click("#draw-wall")
    page.keyboard.press("Escape")
    assert not page.is_visible("#sketchbar")


def test_rooms_are_named_split_joined_and_cleaned(page, house):
    _, robot, _ = house
    page.click("#tab-map")
    for _ in range(3):  # the stand-in has seen only a part of its rooms
        page.click("#farther")
    drag(page, (2.0, 0.5), (2.0, 0.5))  # a tap on the right one
    assert page.is_checked("[data-name='room 2']")
    page.fill("#room-name", "Kitchen")
    page.keyboard.press("Enter")
    until(page, f"({NAMES}).includes('Kitchen')")
    page.click("#rooms-split")
    drag(page, (-2.2, 0.0), (1.1, 0.0))
    page.click("#sketch-done")
    until(page, f"({NAMES}).split(',').length === 3")
    page.check("[data-name='room 2']")
    page.check("[data-name='room 3']")
    page.click("#rooms-join")
    until(page, f"({NAMES}).split(',').length === 2")
    page.check("[data-name='Kitchen']")
    page.click("#rooms-clean")
    wait_for(lambda: robot.asked and robot.asked[-1] == ("clean rooms", ("Kitchen",)))


def test_the_plan_is_edited_and_parts_are_cared_for(page, house):
    _, robot, _ = house
    robot.books.books._hours["filter"] = 119.0
    robot.books.map("room name", ("room 2", "Kitchen"))
    page.click("#tab-plan")
    page.check("#day-mon")
    page.check("#day-sat")
    page.fill("#schedule-time", "07:15")
    page.check("#plan-room-0")
    page.click("#schedule-form button")
    page.wait_for_selector("#schedule li")
    assert "07:15 Mon, Sat" in page.inner_text("#schedule")
    page.click("#schedule li button")
    until(page, "document.querySelector('#schedule').children.length === 0")
    page.wait_for_selector("#parts li")
    page.click("[aria-label='filter: cared for']")
    until(page, "document.querySelector('#parts').innerText.includes('100 %')")
    wait_for(lambda: robot.books.books._hours["filter"] == 0.0)


def stopped(robot):
    return bool(robot.by_hand) and robot.by_hand[-1][1:] == (0.0, 0.0)


def test_it_drives_while_a_button_is_held(page, house):
    _, robot, _ = house
    page.click("#drive-box summary")
    button = page.locator("[data-way='forward']")
    for let_go in ("mouse", "key", "blur"):
        robot.by_hand.clear()
        if let_go == "key":
            button.focus()
            page.keyboard.down("ArrowUp")
        else:
            button.hover()
            page.mouse.down()
        wait_for(lambda: len(robot.by_hand) >= 3)
        assert robot.by_hand[-1][1] == pytest.approx(0.15) and robot.by_hand[-1][2] == 0.0
        before = time.monotonic()
        if let_go == "mouse":
            page.mouse.up()
        elif let_go == "key":
            page.keyboard.up("ArrowUp")
        else:
            page.evaluate("window.dispatchEvent(new Event('blur'))")
        wait_for(lambda: stopped(robot))
        print(f"{let_go}: stood {1000 * (robot.by_hand[-1][0] - before):.0f} ms later")
        count = len(robot.by_hand)
        page.wait_for_timeout(400)
        assert len(robot.by_hand) == count
        page.mouse.up()
    robot.state = "docked"


def test_a_page_that_vanishes_does_not_drive_on(browser, house):
    _, robot, _ = house
    robot.by_hand.clear()
    with open_page(browser, house, "phone") as page:
        page.click("#drive-box summary")
        page.locator("[data-way='left']").hover()
        page.mouse.down()
        wait_for(lambda: len(robot.by_hand) >= 2)
        page.goto("about:blank")
        wait_for(lambda: stopped(robot))
    robot.state = "docked"
