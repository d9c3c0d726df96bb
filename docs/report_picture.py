"""A picture of the first screen of a report, such as docs/figures/report.png: report_picture.py REPORT PICTURE.

Needs Chromium and the extra `test`.
"""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

WIDTH = 1000  # width of the window [px]


def main() -> None:
    """Take the picture."""
    report, picture = map(Path, sys.argv[1:])
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": 1200})
        page.goto(report.resolve().as_uri())
        page.wait_for_selector("html[data-plots=drawn]")
        taken = page.locator("section:has(#result)").screenshot()
        browser.close()
    Image.open(io.BytesIO(taken)).convert("RGB").quantize(64).save(picture, optimize=True)


if __name__ == "__main__":
    main()
