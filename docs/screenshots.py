"""Takes the pictures of the page Explorer, with Chromium and playwright: python docs/screenshots.py."""

import io
import shutil
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from filippov.app import Explorer
from filippov.models import get

STATIC = Path(__file__).resolve().parent / "_static"
VIEW = {"p.P": 20, "order": 2, "against": "Smooth", "width": 0.05, "over": "P", "low": 10, "high": 31}
COLOURS = 128
NARROW = 1500  # pixels of height that are kept


def main() -> None:
    """Both widths, in few colours."""
    explorer = Explorer(get("hunting"))
    explorer = Explorer(get("hunting"), view=explorer.query(VIEW))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        for width, name in ((1280, "explorer.png"), (390, "explorer-narrow.png")):
            page = browser.new_page(viewport={"width": width, "height": 1020})
            page.goto(explorer.url)
            page.locator("#figure-diagram .legendtext", has_text="iterates").wait_for(timeout=60_000)
            page.wait_for_timeout(1500)
            with Image.open(io.BytesIO(page.screenshot(full_page=True))) as taken:
                top = taken.convert("RGB").crop((0, 0, width, min(taken.height, NARROW)))
            top.quantize(COLOURS, Image.Quantize.MEDIANCUT).save(STATIC / name, optimize=True)
            page.close()
        browser.close()
    explorer.close()


if __name__ == "__main__":
    main()
