"""A picture of next steps and ladder of a report, such as docs/figures/report.png: report_picture.py REPORT PICTURE.

Needs Chromium and the extra `test`.
"""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

WIDTH, MARGIN = 1000, 20
"""Width of the window, and what is left free around the picture [px]."""


def main() -> None:
    """Take the pictures and stack them."""
    report, picture = map(Path, sys.argv[1:])
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": 1200})
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("html[data-plots=drawn]")
        parts = [
            Image.open(io.BytesIO(page.locator(part).screenshot()))
            for part in ("section:has(#steps)", "figure:has(#ladder-plot)")
        ]
        browser.close()
    size = (parts[0].width + 2 * MARGIN, sum(part.height + MARGIN for part in parts) + MARGIN)
    whole = Image.new("RGB", size, "white")
    whole.paste(parts[0], (MARGIN, MARGIN))
    whole.paste(parts[1], (MARGIN, parts[0].height + 2 * MARGIN))
    whole.quantize(64).save(picture, optimize=True)


if __name__ == "__main__":
    main()
