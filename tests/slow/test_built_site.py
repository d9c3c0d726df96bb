"""The site is built without a warning, and works without a network."""

from __future__ import annotations

import importlib
import inspect
import json
import os
import re
import subprocess
import sys
from itertools import product
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from browser import POLICY, SCREENS, idle_controls, needs_chromium, objections, opened, served
from lxml import html
from playwright.sync_api import Browser
from thorough import nightly, some

import harness
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.check import RULES

ROOT = Path(__file__).parents[2]
PUBLIC = ("", ".study", ".lawkit.law", ".identification", ".conditions", ".check", ".codegen")
PRINTED = {
    "models_compared": ["LuGre: 6.09 µm per cycle", "ElastoPlastic: 0.0 µm per cycle", "Dahl: 0 %"],
    "compensated_loop": ["LuGre, exact", "law.c"],
}
"""What the notebooks must print; 6.09 µm is that of docs/effects.md, from an independent computation."""
OUTSIDE = r"(?:@import|url\()\s*[\"']?(https?:[^\"')]*)"
OWN = ("file:", "data:", "blob:")
IDLE = re.compile(r'"idle":(\[[^\]]*\])')
SCANNED = ("Coulomb", "ImpulsiveControl", "LeuvenFeedforward", "LuGre", "Mass", "Stiction")
LIVE = ("lab", "blocks/LuGre", "blocks/Mass", "blocks/LuGreObserver")
READ = (
    *("index", "five-minutes", "which-model", "effects", "study-of-an-axis", "first-fmu", "check", "command-line"),
    *("blocks/index", "api/index", "api/friction_fmus", "api/tools", "notebooks/models_compared"),
)
"""Pages with live figures, and others, in which axe looks for faults."""
SCHEMES = {"light": "default", "dark": "slate"}
MODULES = [*(f"friction_fmus{name}" for name in PUBLIC), "harness"]

pytestmark = nightly


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


@needs_chromium
def test_search_works_on_a_page_opened_as_a_file_and_a_phone_shows_it_whole(browser: Browser, site: Path) -> None:
    with opened(browser, (site / "index.html").as_uri()) as (page, requests):
        page.click(".md-search__input")
        page.keyboard.type("hunting")
        page.wait_for_selector(".md-search-result__item >> text=Effects of friction", timeout=60_000)
    with opened(browser, (site / "index.html").as_uri(), "phone") as (phone, _):
        for name in ("index", "which-compensator", "models", "check"):  # their tables scroll by themselves
            phone.goto((site / f"{name}.html").as_uri())
            assert phone.evaluate("document.documentElement.scrollWidth") <= 390, name
    assert [url for url in requests if not url.startswith(OWN)] == []


@needs_chromium
@pytest.mark.parametrize("screen", SCREENS)
def test_pages_of_blocks_and_the_lab_are_live(browser: Browser, site: Path, screen: str) -> None:
    """A model is loaded by its own page only; a page that does not name one loads none."""
    width = SCREENS[screen]["viewport"]["width"]
    assert {path.stem for path in (site / "blocks").glob("*.html")} == {*catalogue(), "index"}
    with opened(browser, (site / "blocks" / "index.html").as_uri(), screen) as (page, requests):
        assert [url for url in requests if "/models/" in url] == []
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
            assert [url for url in requests if not url.startswith(OWN)] == []


@needs_chromium
@pytest.mark.parametrize("screen", SCREENS)
def test_a_strict_policy_and_axe_have_no_objection(browser: Browser, site: Path, screen: str) -> None:
    """As `data:`, the theme's style sheet has its icons."""
    with served(site, f"{POLICY}; img-src 'self' data:") as origin:
        for name, scheme in product((*LIVE, *READ), SCHEMES):
            with opened(browser, f"{origin}{name}.html", screen, color_scheme=scheme) as (page, requests):
                if name in LIVE:
                    page.wait_for_selector("[data-ready]", timeout=60_000)
                assert page.get_attribute("body", "data-md-color-scheme") == SCHEMES[scheme]
                assert (name, scheme, objections(page)) == (name, scheme, [])
            assert [url for url in requests if not url.startswith((origin, "data:"))] == []


@needs_chromium
@pytest.mark.parametrize("name", some(tuple(catalogue()), SCANNED))
def test_every_slider_of_a_block_moves_a_figure(browser: Browser, site: Path, name: str) -> None:
    """With sliders for all parameters, those without effect are the ones that the page leaves out."""
    script = (site / "lab" / "models" / f"{name}.js").read_text(encoding="utf-8")
    text, idle = IDLE.subn('"idle":[]', script), IDLE.search(script)
    with opened(browser, "about:blank") as (page, _):
        page.route(f"**/models/{name}.js", lambda route: route.fulfill(body=text[0], content_type="text/javascript"))
        page.goto((site / "blocks" / f"{name}.html").as_uri())
        page.wait_for_selector(f".live-block[data-ready={name}]", timeout=60_000)
        assert text[1] == 1 and idle is not None
        assert sorted(idle_controls(page)) == sorted(json.loads(idle[1]))


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
            is_state = goal.name == "lab.html" and parts.fragment.startswith("view=")
            found = not parts.fragment or is_state or goal not in anchors or unquote(parts.fragment) in anchors[goal]
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
        elsewhere = harness.__all__ if name == "friction_fmus" else ()  # on the pages of the harness
        values = {each: getattr(module, each) for each in module.__all__ if each not in elsewhere}
        public = [each for each, value in values.items() if inspect.isroutine(value) or inspect.isclass(value)]
        missing += [f"{name}.{each}" for each in public if not {f"{name}.{each}", f"{name}.{each}.{each}"} & ids]
    return missing
