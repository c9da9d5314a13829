"""From a step of a slider to the redrawn pictures of the explorer's page, in a browser without a display.

    python tests/benchmarks/explorer.py [--model hunting] [--parameter P] [--steps 40]

Needs Chromium and playwright (`pip install '.[explorer,browser]'`). Wall time, for the machine as it is, from
the arrow key to the first frame with the new pictures.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from playwright.sync_api import Page, sync_playwright  # noqa: E402

from filippov.app import Explorer  # noqa: E402
from filippov.models import get  # noqa: E402

WIDTHS = (1280, 390)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Milliseconds from the next key to the first frame after the link has changed.
WATCH = """() => new Promise(done => {
    const link = document.getElementById("link"), before = link.getAttribute("href");
    let begun = null;
    document.addEventListener("keydown", () => { begun = performance.now(); }, {once: true, capture: true});
    const look = () => {
        if (link.getAttribute("href") !== before) {
            requestAnimationFrame(() => done(performance.now() - begun));
        } else { requestAnimationFrame(look); }
    };
    look();
})"""


def redraws(page: Page, parameter: str, steps: int) -> list[float]:
    """Milliseconds of each step."""
    slider = f"#range-p-{parameter}"
    page.focus(slider)
    times = []
    for _ in range(steps):
        page.evaluate(f"window.step = ({WATCH})(); 0")
        page.keyboard.press("ArrowRight")
        times.append(float(page.evaluate("window.step")))
    return times


def main() -> None:
    """Print the median and the longest redraw at both widths."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--model", default="hunting")
    parser.add_argument("--parameter", default="P")
    parser.add_argument("--steps", type=int, default=40)
    given = parser.parse_args()
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SystemExit(f"no browser: install one of {', '.join(BROWSERS)}.")
    explorer = Explorer(get(given.model))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        for width in WIDTHS:
            page = browser.new_page(viewport={"width": width, "height": 900})
            page.goto(explorer.url)
            page.locator("#message", has_text="Solved to").wait_for()
            page.locator("#figure-time .main-svg").first.wait_for()
            times = redraws(page, given.parameter, given.steps)
            print(f"{width:5} px: median {statistics.median(times):.0f} ms, longest {max(times):.0f} ms")
            page.close()
        browser.close()
    explorer.close()


if __name__ == "__main__":
    main()
