"""A page opened in a real, headless Chromium, without a network."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Where screenshots are kept, to be looked at.
SCREENSHOTS = Path(os.environ.get("PIEZOEST_SCREENSHOTS") or ROOT / ".screenshots")
WIDTH, HEIGHT = 1280, 900

DRAWN = """
return [...document.querySelectorAll('.js-plotly-plot')].map(plot => ({
  width: plot.getBoundingClientRect().width,
  height: plot.getBoundingClientRect().height,
  traces: plot._fullData.length,
  points: plot._fullData.map(trace => (trace.x || trace.y || []).length),
  drawn: [...plot.querySelectorAll('.trace path, .trace .bars path, .point path')]
    .filter(path => (path.getAttribute('d') || '').length > 10).length,
  titles: [...plot.querySelectorAll('.xtitle, .ytitle, .annotation-text')].map(text => text.textContent),
}));
"""


def find_browser() -> tuple[str, str]:
    """Paths of Chromium and of its driver; the test is skipped where one is absent."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if browser is None or driver is None:
        missing = "chromium" if browser is None else "chromedriver"
        pytest.skip(f"no {missing} on this machine: make tools installs it")
    pytest.importorskip("selenium")
    return browser, driver


@contextmanager
def chromium(width: int = WIDTH) -> Iterator[Any]:
    """A browser that resolves no name, and logs its console and its requests."""
    browser, path = find_browser()
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--no-first-run",
        "--hide-scrollbars",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--window-size={width},{HEIGHT}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(path))
    try:
        yield driver
    finally:
        driver.quit()


def requests_of(driver: Any) -> list[str]:
    """Addresses that the page asked for since the last call."""
    messages = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    return [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]


def console_of(driver: Any) -> list[str]:
    """What the page wrote on the console since the last call, except for plain words."""
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] != "INFO"]


def screenshot(driver: Any, name: str) -> Path:
    """Save the whole page as a picture."""
    height = driver.execute_script("return document.documentElement.scrollHeight")
    driver.set_window_size(driver.get_window_size()["width"], min(int(height) + 150, 12_000))
    SCREENSHOTS.mkdir(exist_ok=True)
    path = SCREENSHOTS / f"{name}.png"
    assert driver.save_screenshot(str(path))
    return path


def check_report(path: Path, plots: int) -> tuple[list[dict[str, Any]], str]:
    """A report opened from disk: it draws, says nothing on the console and asks for nothing.

    Returns what is known of each plot, and the text of the page.
    """
    from selenium.webdriver.support.ui import WebDriverWait

    with chromium() as driver:
        driver.get(path.resolve().as_uri())
        WebDriverWait(driver, 60).until(
            lambda it: it.execute_script(
                "return document.readyState === 'complete' && "
                f"document.querySelectorAll('.js-plotly-plot .main-svg').length >= {plots}"
            )
        )
        found = driver.execute_script(DRAWN)
        text = driver.find_element("tag name", "body").text
        wide = driver.execute_script("return document.documentElement.scrollWidth")
        picture = screenshot(driver, path.stem)
        console, requests = console_of(driver), requests_of(driver)
    assert len(found) == plots
    for plot in found:
        assert plot["width"] > 300, plot
        assert plot["height"] > 200, plot
        assert plot["traces"] >= 1, plot
        assert plot["drawn"] >= 1, plot
        assert sum(plot["points"]) > 1, plot
    assert console == []
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []
    assert any(url.startswith("file:") for url in requests)
    assert wide <= WIDTH, "the page is wider than the window"
    assert picture.stat().st_size > 20_000
    return found, text
