"""The bibliography: every block cites, keys are unique, and the entries are BibTeX."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pybtex.database import Entry, parse_string

from friction_fmus import FrictionError, catalogue
from friction_fmus.blocks.block_declarations import FILE, bibliography, cited
from friction_fmus.blocks.catalogue import Block, find
from friction_fmus.cli.main import main

BLOCKS = list(catalogue().values())
DATA = parse_string(FILE.read_text(encoding="utf-8"), "bibtex")  # raises an error for a repeated key
REQUIRED = {
    "article": {"title", "journal", "volume", "pages", "year"},
    "inproceedings": {"title", "booktitle", "year"},
    "book": {"title", "publisher", "year"},
    "techreport": {"title", "institution", "year"},
    "manual": {"title", "organization"},
    "misc": {"title"},
}
SEEN = {
    **{"CanudasDeWit1995": "the paper", "Olsson1998": "the paper"},
    **{"Ray2001": "the abstract", "TorqueProportionalLoss2026": "an excerpt"},
}
"""What was read of the sources of which equations with numbers are given, and of two more."""


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.name)
def test_every_block_cites(block: Block) -> None:
    assert block.bibtex
    for entry in block.bibtex:
        assert len(parse_string(entry, "bibtex").entries) == 1


def test_every_entry_is_found_by_its_key_and_cited() -> None:
    assert list(bibliography()) == list(DATA.entries)
    assert list(DATA.entries) == sorted(DATA.entries, key=str.lower)
    used = {entry for block in BLOCKS for entry in block.bibtex}
    assert used == set(bibliography().values())


@pytest.mark.parametrize(("key", "entry"), DATA.entries.items())
def test_an_entry_has_what_bibtex_needs(key: str, entry: Entry) -> None:
    assert REQUIRED[entry.type] <= set(entry.fields)
    assert entry.persons.get("author") or entry.type in ("manual", "misc")
    if "year" in entry.fields:
        assert re.fullmatch(r"1[6-9]\d\d|20[0-2]\d", entry.fields["year"])
    if "pages" in entry.fields:
        first, last = map(int, entry.fields["pages"].split("--"))
        assert first < last
    if re.search(r"\d{4}$", key) and "year" in entry.fields:
        assert key.endswith(entry.fields["year"])
    assert re.fullmatch(r"10\.\d{4,}/\S+", entry.fields.get("doi", "10.1000/none"))


def test_what_was_read_stands_in_comments_and_not_in_what_users_get() -> None:
    said = re.findall(r"^% checked against (.*)\n@\w+\{(\w+),", FILE.read_text(encoding="utf-8"), re.M)
    assert {key: read for read, key in said} == SEEN
    assert [key for key, entry in DATA.entries.items() if "note" in entry.fields or "%" in bibliography()[key]] == []


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.name)
def test_the_source_names_the_authors_that_are_cited(block: Block) -> None:
    """The first author of one entry at least is in the line SOURCE, unless the block follows from a definition."""
    cites = set(block.about.cites) - {"FrictionFmus2026"}
    persons = [DATA.entries[key].persons.get("author", []) for key in cites]
    names = {"".join(part for part in person[0].last_names[-1] if part.isalpha()) for person in persons if person}
    plain = {re.sub(r"^AAstrom", "Astrom", name) for name in names}
    line = re.sub(r"[^A-Za-z]", "", block.source)
    assert not plain or any(name in line for name in plain)


def test_the_command_prints_each_entry_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cite", "Karnopp", "KarnoppMass", "KarnoppFeedforward"]) == 0
    assert list(parse_string(capsys.readouterr().out, "bibtex").entries) == ["Karnopp1985", "JohnsonLorenz1992"]
    assert main(["cite"]) == 0
    assert list(parse_string(capsys.readouterr().out, "bibtex").entries) == list(DATA.entries)


def test_a_users_block_cites_by_key_and_by_entry(tmp_path: Path) -> None:
    code = find("Viscous").code
    own = tmp_path / "Own.c"
    own.write_text(
        code.replace('"Olsson1998"', '"Dahl1976"') + "\n/* @misc{Own, title = {Mine}} */\n", encoding="utf-8"
    )
    assert find(own).bibtex == (bibliography()["Dahl1976"], "@misc{Own, title = {Mine}}")
    own.write_text(code.replace('"Olsson1998"', '"Dahl1977"'), encoding="utf-8")
    with pytest.raises(FrictionError, match=r"Own.c: the block cites 'Dahl1977', .* \(did you mean Dahl1976\?\)"):
        find(own)
    assert cited(["@misc{Own, title = {Mine}}"]) == ("@misc{Own, title = {Mine}}",)
