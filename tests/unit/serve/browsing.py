"""Helpers of the tests with a real browser."""

import shutil
from contextlib import contextmanager

import pytest
from serving import wait_for

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SIZES = {"phone": (390, 844), "desktop": (1280, 800)}


def until(page, expression):
    """Wait for it without `eval`, which the page's content policy forbids."""
    wait_for(lambda: page.evaluate(expression), 60)


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"], timeout=120_000
        )
        yield browser
        browser.close()


@contextmanager
def open_page(browser, house, size):
    """The robot's page, let in by the printed address; fails on any error in its console.

    A request that the robot refuses is no error of the page.
    """
    server, robot, _ = house
    robot.state = "docked"
    width, height = SIZES[size]
    context = browser.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(60_000)
    page = context.new_page()
    errors = []
    page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"{server.url}/?token={server.token}")
    page.wait_for_selector("#do-start")
    until(page, "sweeper.map.tiles.size > 0")
    yield page
    context.close()
    assert [error for error in errors if "409 (Conflict)" not in error] == []
