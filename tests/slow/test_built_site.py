"""The site is built without a warning, and works without a network."""

from __future__ import annotations

import importlib
import inspect
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from lxml import html
from playwright.sync_api import sync_playwright

from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.check import RULES

ROOT = Path(__file__).parents[2]
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PUBLIC = ("", ".lawkit.law", ".identification", ".conditions", ".procedures", ".doctor", ".check", ".codegen")
PRINTED = {
    "models_compared": [
        "drift in µm per cycle: {'LuGre': 6.09, 'ElastoPlastic': 0.0, 'GMS': 0.0}",
        "'Dahl': 'stuck for 0 % of the time'",
    ],
    "compensated_loop": ["13 conditions, 0 of them violated", "law.c"],
}
"""What the notebooks must print; 6.09 µm is that of docs/effects.md, from an independent computation."""
OUTSIDE = r"(?:@import|url\()\s*[\"']?(https?:[^\"')]*)"
MODULES = [*(f"friction_fmus{name}" for name in PUBLIC), "harness"]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site, built with its notebooks."""
    folder = tmp_path_factory.mktemp("site")
    command = [str(Path(sys.executable).parent / "mkdocs"), "build", "--strict", "--site-dir", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    made = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return folder


def test_the_site_is_whole_and_asks_no_other_host(site: Path) -> None:
    paths = [path for path in sorted(site.rglob("*.html")) if path.name != "404.html"]
    pages = {path: html.parse(str(path)).getroot() for path in paths}
    assert len(pages) > 25
    assert broken_links(pages) == []
    assert loaded_from_elsewhere(pages) == []
    assert [sheet for path in site.rglob("*.css") for sheet in re.findall(OUTSIDE, path.read_text("utf-8"))] == []
    assert missing_in_the_reference(site / "api") == []
    cells = {cell.text_content() for cell in pages[site / "check.html"].iter("td")}
    assert [rule for rule in RULES.values() if not {rule.id, rule.summary} <= cells] == []
    for name, said in PRINTED.items():
        page = pages[site / "notebooks" / f"{name}.html"]
        assert [text for text in said if text not in page.text_content()] == []
        assert page.xpath("//article//img")


@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
def test_search_works_on_a_page_opened_as_a_file_and_a_phone_shows_it_whole(site: Path) -> None:
    sandbox = ["--no-sandbox"] if os.getuid() == 0 else []  # which Chromium does not have for root
    requests: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=sandbox)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("request", lambda request: requests.append(request.url))
        page.goto((site / "index.html").as_uri())
        page.click(".md-search__input")
        page.keyboard.type("hunting")
        page.wait_for_selector(".md-search-result__item >> text=Effects of friction", timeout=60_000)
        phone = browser.new_page(viewport={"width": 360, "height": 740}, is_mobile=True, has_touch=True)
        for name in ("index", "which-compensator", "models", "check"):  # their tables scroll by themselves
            phone.goto((site / f"{name}.html").as_uri())
            assert phone.evaluate("document.documentElement.scrollWidth") <= 360, name
        browser.close()
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
@pytest.mark.parametrize("width", [1280, 360])
def test_pages_of_blocks_and_the_lab_are_live(site: Path, width: int) -> None:
    """A model is loaded by its own page only; a page that does not name one loads none."""
    sandbox = ["--no-sandbox"] if os.getuid() == 0 else []  # which Chromium does not have for root
    messages: list[str] = []
    requests: list[str] = []
    assert {path.stem for path in (site / "blocks").glob("*.html")} == {*catalogue(), "index"}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=sandbox)
        page = browser.new_page(viewport={"width": width, "height": 800})
        page.on("request", lambda request: requests.append(request.url))
        page.on("console", lambda message: messages.append(message.text))
        page.on("pageerror", lambda error: messages.append(str(error)))
        for name in ("blocks/LuGre", "blocks/Mass", "blocks/LuGreObserver", "blocks/LeuvenFeedforward", "lab"):
            requests.clear()
            page.goto((site / f"{name}.html").as_uri())
            page.wait_for_selector("[data-ready]", timeout=60_000)
            pictures = "[...document.querySelectorAll('canvas')].map((each) => each.toDataURL()).join()"
            before = page.evaluate(pictures)
            page.locator(".slider input[type=range]").first.press("ArrowLeft")
            page.locator(".slider input[type=range]").first.press("PageDown")
            page.wait_for_function("performance.getEntriesByName('redraw').length > 0")
            assert page.evaluate(pictures) != before, name
            assert page.evaluate("document.documentElement.scrollWidth") <= width, name
            loaded = {path for url in requests if "/models/" in (path := urlsplit(url).path)}
            assert len(loaded) == (1 if name != "lab" else 3), loaded
            assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []
        requests.clear()
        page.goto((site / "blocks" / "index.html").as_uri())
        assert [url for url in requests if "/models/" in url] == []
        browser.close()
    assert messages == []


def broken_links(pages: dict[Path, html.HtmlElement]) -> list[str]:
    """Links to files or anchors that do not exist."""
    anchors = {path: set(page.xpath("//@id | //a/@name")) for path, page in pages.items()}
    broken = []
    for path, page in pages.items():
        for target in page.xpath("//a/@href | //img/@src | //script/@src | //link/@href"):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            goal = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            goal = goal / "index.html" if goal.is_dir() else goal
            found = not parts.fragment or goal not in anchors or unquote(parts.fragment) in anchors[goal]
            if not (goal.is_file() and found):
                broken.append(f"{path.name}: {target}")
    return broken


def loaded_from_elsewhere(pages: dict[Path, html.HtmlElement]) -> list[str]:
    """Scripts, pictures and styles that a page would load from another host."""
    what = "//script/@src | //img/@src | //iframe/@src | //link[not(@rel='canonical')]/@href"
    return [target for page in pages.values() for target in page.xpath(what) if urlsplit(target).netloc]


def missing_in_the_reference(folder: Path) -> list[str]:
    """Public functions and classes without a place in the pages of the API."""
    ids = {each for page in folder.glob("*.html") for each in html.parse(str(page)).xpath("//@id")}
    missing = []
    for name in MODULES:
        module = importlib.import_module(name)
        values = {each: getattr(module, each) for each in module.__all__}
        public = [each for each, value in values.items() if inspect.isroutine(value) or inspect.isclass(value)]
        missing += [f"{name}.{each}" for each in public if not {f"{name}.{each}", f"{name}.{each}.{each}"} & ids]
    return missing
