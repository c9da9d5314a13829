"""The explorer's page in a browser without a display, where Chromium is on the machine.

Nothing is asked of another machine, nothing is complained of, the keyboard is enough, at two widths.
"""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from filippov.app import Explorer
from filippov.models import registry

playwright = pytest.importorskip("playwright.sync_api")
pytest.importorskip("dash")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine"),
    # Its asyncio loop closes its streams when the process ends.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
WAIT = 60_000


@dataclass
class Visit:
    """A page with what it asked for and what it said."""

    page: Any
    asked: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def redrawn(self, text: str) -> None:
        """Wait until the link holds a text: the redraw that it belongs to is there."""
        self.page.locator(f'#link[href*="{text}"]').wait_for(state="attached", timeout=WAIT)


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    made = Explorer(registry.get("hunting"), t_span=(0, 5))
    yield made
    made.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


def visit(browser: Any, explorer: Explorer, query: str, width: int) -> Visit:
    made = Visit(browser.new_page(viewport={"width": width, "height": 900}))
    made.page.on("request", lambda request: made.asked.append(request.url))
    made.page.on("console", lambda message: made.said.append(message.text))
    made.page.on("pageerror", lambda error: made.said.append(str(error)))
    made.page.goto(explorer.url + query)
    made.page.locator("#message", has_text="Solved to").wait_for(timeout=WAIT)
    made.page.locator("#figure-diagram .legendtext", has_text="iterates").wait_for(timeout=WAIT)
    return made


@pytest.mark.parametrize("width", [1280, 390])
def test_16_8_the_page_at_both_widths(browser: Any, explorer: Explorer, width: int) -> None:
    seen = visit(browser, explorer, "?p.P=20.0&order=2", width)
    page = seen.page
    assert page.input_value("#p-P") == page.input_value("#range-p-P") == "20"
    # By the keyboard alone: from the box to its slider, a step on, and the page and its link follow.
    page.focus("#range-p-P")
    page.keyboard.press("ArrowRight")
    seen.redrawn("p.P=20.2")
    assert page.input_value("#p-P") == "20.2"
    assert "p.P=20.2" in page.url
    page.fill("#p-m", "")
    page.locator("#message.bad", has_text="p.m: nothing was given").wait_for(timeout=WAIT)
    page.fill("#p-m", "1.5")
    seen.redrawn("p.m=1.5")
    assert "Solved to t = 5" in page.text_content("#message")
    wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert wide[0] <= wide[1], "the page is wider than the window"
    for box in page.locator(".plot").all():
        place = box.bounding_box()
        assert place["x"] >= 0
        assert place["x"] + place["width"] <= width
        assert place["height"] > 200
    sizes = page.evaluate(
        "[...document.querySelectorAll('.plot text, label, input')]"
        ".map(e => parseFloat(getComputedStyle(e).fontSize))"
    )
    assert min(sizes) >= 11
    unnamed = "[...document.querySelectorAll('input')].filter(e => !e.labels.length && !e.ariaHidden).length"
    assert page.evaluate(unnamed) == 0, "a control without a name"
    own = explorer.url.partition("?")[0]
    assert seen.asked
    assert all(url.startswith((own, "data:", "blob:")) for url in seen.asked), seen.asked
    assert not seen.said
    page.close()


def test_16_2_the_page_plays_the_solution(browser: Any, explorer: Explorer) -> None:
    """A line and a point go along the solution, by the button and by the keyboard."""
    seen = visit(browser, explorer, "", 1280)
    page = seen.page
    page.click("#play")
    page.locator("#moment-told", has_text="time [s] = 5, mode").wait_for(timeout=WAIT)
    assert page.text_content("#play") == "Play"
    assert page.locator("#figure-time .film-line").bounding_box()["height"] > 200
    page.focus("#moment")
    places = []
    for key in ("Home", "End"):
        page.keyboard.press(key)
        box = page.locator("#figure-phase .film-point").bounding_box()
        places.append((box["x"] + box["width"] / 2, box["y"] + box["height"] / 2))
    wanted = page.evaluate(
        "([x, v]) => { const plot = document.querySelector('#figure-phase .js-plotly-plot');"
        "const {xaxis, yaxis} = plot._fullLayout, box = plot.getBoundingClientRect();"
        "return [box.x + xaxis._offset + xaxis.l2p(x), box.y + yaxis._offset + yaxis.l2p(v)]; }",
        [float(value) for value in explorer.solution().x_end[:2]],
    )
    assert max(abs(a - b) for a, b in zip(places[1], wanted, strict=True)) < 2
    assert places[0] != places[1]
    assert not seen.said
    page.close()


def test_16_8_a_link_that_is_wrong_says_so(browser: Any, explorer: Explorer) -> None:
    seen = visit(browser, explorer, "?p.Q=20.0", 1280)
    assert "The link was not taken: unknown setting 'p.Q'" in seen.page.text_content("#message")
    assert not seen.said
    seen.page.close()
