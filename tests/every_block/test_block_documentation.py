"""The page of documentation in every FMU: valid, accessible, complete, and self-contained."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path

import html5lib
import pytest
from lxml import etree
from shell.instance import Library, load
from shell.selection import ONE_OF_EACH
from thorough import some

from friction_fmus import build, catalogue
from friction_fmus.errors import BuildError
from friction_fmus.version import VERSION

HEADINGS = ("h1", "h2", "h3", "h4", "h5", "h6")


@pytest.fixture(params=some(tuple(catalogue()), ONE_OF_EACH))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """One block of each class of branches, and all of them each night."""
    return load(build_fmu(request.param))


@pytest.fixture
def page(library: Library) -> etree._Element:
    """The page of each block; the parser refuses what HTML 5 calls a parse error."""
    return parse(library.folder / "documentation" / "index.html")


@cache
def parse(path: Path) -> etree._Element:
    parser = html5lib.HTMLParser(html5lib.getTreeBuilder("lxml"), strict=True, namespaceHTMLElements=False)
    return parser.parse(path.read_text(encoding="utf-8")).getroot()


def text(element: etree._Element) -> str:
    return " ".join("".join(element.itertext()).split())


def test_every_reference_leads_to_a_file_of_the_fmu(library: Library, page: etree._Element) -> None:
    folder = library.folder / "documentation"
    sources = [str(image.get("src")) for image in page.iter("img")]
    links = [str(link.get("href")) for link in page.iter("a")]
    assert "../model.png" in sources and "licenses/license.txt" in links
    for reference in (*sources, *(link for link in links if not link.startswith("https://"))):
        assert (folder / reference).resolve().is_relative_to(library.folder.resolve())
        assert (folder / reference).is_file(), reference
    assert not list(page.iter("script", "link", "iframe"))
    assert "url(" not in "".join(text(style) for style in page.iter("style"))


def test_a_screen_reader_finds_its_way(page: etree._Element) -> None:
    assert page.get("lang") == "en" and [text(e) for e in page.iter("title")] == [
        text(next(page.iter("h1"))).split()[0]
    ]
    levels = [HEADINGS.index(str(e.tag)) for e in page.iter(*HEADINGS)]
    assert levels[0] == 0 and levels.count(0) == 1
    assert all(b <= a + 1 for a, b in pairwise(levels))
    assert all(len(str(image.get("alt") or "")) > 5 for image in page.iter("img"))
    assert all(head.get("scope") in ("col", "row", "rowgroup") for head in page.iter("th"))
    assert all(text(table.find("caption")) for table in page.iter("table"))
    assert len(list(page.iter("main"))) == 1


def test_it_fits_on_a_phone(page: etree._Element) -> None:
    """Text flows; what cannot, equations and tables, scrolls by itself."""
    (viewport,) = (meta for meta in page.iter("meta") if meta.get("name") == "viewport")
    assert viewport.get("content") == "width=device-width, initial-scale=1"
    assert all(table.getparent().get("class") == "wide" for table in page.iter("table"))
    (style,) = (text(style) for style in page.iter("style"))
    assert "pre, .wide { overflow-x: auto; }" in style


def test_it_says_all_there_is_to_say(library: Library, page: etree._Element) -> None:
    block = catalogue()[library.identifier]
    content = text(page)
    assert block.summary in content and block.source in content and VERSION in content
    heads = [text(head) for head in page.iter("h2")]
    assert {"Variables", "FMI", "Source"} <= set(heads)
    tables = {text(table.find("caption")): table for table in page.iter("table")}
    rows = [text(head) for head in tables["Variables and their start values"].iter("th") if head.get("scope") == "row"]
    vectors = {re.sub(r"\[\d.*?\]", "[]", name) for name in library.variables if name != "time"}
    assert {re.sub(r"\[\d.*?\]", "[]", name) for name in rows} == vectors
    for entry in block.bibtex:
        assert " ".join(entry.split()) in content


def test_a_block_that_refuses_its_start_values_is_not_built(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"The start values of Dither violate frequency < 1/\(2 Ts\); choose others"):
        build("Dither", tmp_path, {"frequency": 9e3})
    assert not list(tmp_path.iterdir())
