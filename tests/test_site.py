"""The site is built without a warning, works without a network, and its derived tables are current."""

from __future__ import annotations

import importlib
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote, urlsplit

import lief
import pytest
from lxml import etree, html
from playwright.sync_api import sync_playwright

from friction_fmus import fmu
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.blocks.probe import OUTPUT, PARAMETER
from harness.platforms import NATIVE

ROOT = Path(__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
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


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    return importlib.import_module("tables")


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


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_outputs(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert [cell["source"] for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []


def test_tables_of_the_pages_are_what_the_blocks_say(tables: ModuleType) -> None:
    found = tables.pages()
    assert {path.name for path in found} == {"capabilities.md", "which-compensator.md", "which-model.md"}
    stale = [path.name for path in found if (text := path.read_text(encoding="utf-8")) != tables.filled(text)]
    assert stale == [], "run `python docs/tables.py`"


@pytest.mark.parametrize("name", ["LuGre", "Mass", "PID", "ImpulsiveControl", "Encoder"])
def test_page_of_capabilities_says_what_the_fmu_declares(name: str) -> None:
    page = (ROOT / "docs" / "capabilities.md").read_text(encoding="utf-8")
    with zipfile.ZipFile(fmu(name)) as archive:
        simulation = etree.fromstring(archive.read("modelDescription.xml")).find("CoSimulation")
        binary = next(member for member in archive.namelist() if member.startswith(f"binaries/{NATIVE.folder}/"))
        library = lief.parse(list(archive.read(binary)))
    assert simulation is not None
    declared = {key: value for key, value in simulation.attrib.items() if key != "modelIdentifier"}
    first = page.partition("<!-- /table -->")[0]
    assert dict(re.findall(r"^\| `(\w+)` \| `(\w+)` \|", first, re.M)) == declared
    functions = {symbol.name for symbol in library.exported_symbols if str(symbol.name).startswith("fmi2")}
    assert f"all {len(functions)} of co-simulation are exported" in page


def test_models_to_begin_with_show_what_the_motion_asks_for(tables: ModuleType) -> None:
    for row, suited in [(row, tables.suited_models(row)) for row in tables.MOTIONS] + [
        (row, tables.answering_models(row)) for row in tables.QUESTIONS
    ]:
        assert tables.choices(row.name)
        assert set(tables.choices(row.name)) <= set(suited), row.name


def test_compensators_named_get_by_with_the_signals_at_hand(tables: ModuleType) -> None:
    for situation in tables.SITUATIONS:
        assert tables.begin(situation)
        assert {*tables.choices(situation.name)} <= set(tables.suited_compensators(situation)), situation.known


def test_blocks_name_needs_that_there_are(tables: ModuleType) -> None:
    known = {row.name for row in (*tables.MOTIONS, *tables.QUESTIONS, *tables.SITUATIONS)}
    named = [need for block in tables.catalogue().values() for need in block.about.needs]
    assert set(named) == known


def test_every_model_and_compensator_is_on_its_decision_page() -> None:
    named = {page: (ROOT / "docs" / page).read_text("utf-8") for page in ("which-model.md", "which-compensator.md")}
    for block in catalogue().values():
        if block.kind == "friction":
            assert block.name in named["which-model.md"]
        elif block.kind in ("law", "controller"):
            assert f"| **{block.name}** |" in named["which-compensator.md"]


def test_what_estimates_friction_has_a_gain(tables: ModuleType) -> None:
    for block in tables.of_kind("law", "controller"):
        named = {(v.name, v.role) for v in tables.described(block.name).variables}
        assert ("F_hat", OUTPUT) not in named or ("gain", PARAMETER) in named, block.name
