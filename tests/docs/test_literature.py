"""docs/literature.md has every claim of the report with a script that shows it, and is what it would be written as."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from matplotlib.figure import Figure

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FIGURES = {f"Figure {number}" for number in ("1.1", "1.2", "1.3", "1.4", "1.5", "1.6", "1.7", "2.1", "2.2", "2.3")}
EQUATIONS = {f"(1.{number})" for number in range(1, 24)} | {f"(2.{number})" for number in range(1, 6)}
FOLDERS = ("models", "compensation")
BEYOND = {
    "compensation/bumpless_start": "a start without a jump, which the report does not discuss",
    "compensation/friction_from_displacements": "an estimator that the report does not know",
    "compensation/quadrant_glitches": "a measure of the report's applications, in cascade_on_a_circle",
    "models/feedforward_under_load": "gears under load, which the report does not discuss",
    "models/friction_under_load": "screws and worms, which the report does not discuss",
    "models/optimal_motion": "a method of optimal control, which the report does not know",
    "compensation/sliding_mode": "implicit laws, which the report does not know",
}
"""Scripts that no claim needs, and why they are there."""
REMEDY = "run `python examples/literature.py docs`"


@pytest.fixture
def literature(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "examples")
    import literature

    return literature


def test_page_is_what_the_table_and_the_effects_say(literature: ModuleType) -> None:
    """Its numbers are those of docs/effects.md and figures.csv; test_examples.py compares both with the scripts."""
    assert (DOCS / "literature.md").read_text(encoding="utf-8") == literature.page(DOCS), REMEDY


def test_no_claim_is_without_a_script_or_the_reason_why_nothing_can_test_it(literature: ModuleType) -> None:
    for claim in literature.read().claim:
        assert claim["verdict"] in literature.VERDICTS, claim["says"]
        shown, noted = bool(claim.get("scripts")), bool(claim.get("note"))
        assert shown == (claim["verdict"] != "not tested"), claim["says"]
        assert noted or claim["verdict"] == "holds", claim["says"]


def test_few_claims_are_not_tested(literature: ModuleType) -> None:
    verdicts = Counter(claim["verdict"] for claim in literature.read().claim)
    assert verdicts["not tested"] < 0.15 * verdicts.total()


def test_no_equation_is_without_a_script(literature: ModuleType) -> None:
    assert all(equation["scripts"] for equation in literature.read().equation)


def test_every_script_is_there(literature: ModuleType) -> None:
    table = literature.read()
    named = {name for entry in (*table.claim, *table.equation) for name in entry.get("scripts", ())}
    assert [name for name in sorted(named) if not (ROOT / "examples" / f"{name}.py").is_file()] == []
    assert [name for name in sorted(named) if not (DOCS / "figures" / f"{Path(name).name}.png").is_file()] == []


def test_every_script_about_the_literature_is_named_by_a_claim(literature: ModuleType) -> None:
    table = literature.read()
    named = {name for claim in (*table.claim, *table.equation) for name in claim.get("scripts", ())}
    there = {f"{folder}/{p.stem}" for folder in FOLDERS for p in (ROOT / "examples" / folder).glob("[!_]*.py")}
    assert sorted(there - named) == sorted(BEYOND)


def test_every_section_has_claims(literature: ModuleType) -> None:
    table = literature.read()
    titles = [section["title"] for section in table.section]
    assert {claim["section"] for claim in table.claim} <= set(titles)
    empty = set(titles) - {claim["section"] for claim in table.claim}
    assert empty <= {"Chapter 2: friction compensation"}


def test_table_of_paragraphs_is_complete_and_its_files_are_there(literature: ModuleType) -> None:
    rows = literature.paragraphs()
    assert [row for row in rows if not all(row.values())] == []
    files = {file for row in rows for file in (*row["files"].split(), *row["shown by"].split())}
    assert [file for file in sorted(files) if not (ROOT / file).is_file()] == []
    of = {kind: [row["what"] for row in rows if row["kind"] == kind] for kind in {row["kind"] for row in rows}}
    assert of.keys() == {"system", "method", "figure", "equation"}
    assert sorted(of["equation"]) == sorted(EQUATIONS)
    assert sorted(figure.partition(":")[0] for figure in of["figure"]) == sorted(FIGURES)
    assert len(set(of["system"] + of["method"])) == len(of["system"] + of["method"])


def test_what_shows_a_block_of_the_table_of_paragraphs_names_it(literature: ModuleType) -> None:
    names = {law.path: law.name for law in discover_laws(laws_folder())}
    for row in literature.paragraphs():
        shown = "".join((ROOT / file).read_text(encoding="utf-8") for file in row["shown by"].split())
        files = [ROOT / file for file in row["files"].split() if file.startswith(("fmu_src", "friction_fmus/laws"))]
        assert [name for file in files if (name := names.get(file, file.stem)) not in shown] == [], row["what"]


def test_a_number_is_a_measured_figure_or_part_of_what_is_printed(literature: ModuleType) -> None:
    script = literature.Script("effects.md#a", "A", "It is 1.5e-3 m after 12 s, and 0.", frozenset({"error"}))
    for given in ("error", "It is # m after # s", "# s, and #"):
        literature.confirm(script, given)
    for missing in ("It is # N", "It is 1.5e-3 m", "late error"):
        with pytest.raises(literature.MissingNumberError, match=re.escape(missing)):
            literature.confirm(script, missing)


def test_a_claim_that_names_a_missing_number_is_not_written(
    literature: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = literature.read()
    wrong: dict[str, Any] = dict(table.claim[0]) | {"scripts": ["models/stick_slip"], "numbers": ["no such # number"]}
    monkeypatch.setattr(literature, "read", lambda: table._replace(claim=[wrong]))
    with pytest.raises(literature.MissingNumberError, match="no such # number"):
        literature.page(DOCS)


def test_sentences_are_not_those_of_the_report(literature: ModuleType) -> None:
    """Each claim is short: one or two sentences of our own."""
    assert [claim["says"] for claim in literature.read().claim if len(claim["says"]) > 180] == []


def test_a_diagram_is_drawn_only_with_all_the_wires_of_its_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "examples" / "compensation")
    import _diagram

    boxes = {name: _diagram.Box(name, (3.0 * i, 0.0), "Mass") for i, name in enumerate(("a", "b", "c"))}
    wires = ["a.y -> b.u", "b.y -> c.u", "b.z -> c.w"]
    arrows = [_diagram.Arrow("a", "b", "r"), _diagram.Arrow("b", "c")]
    axis = Figure().add_subplot()
    _diagram.draw(axis, boxes, wires, arrows)
    assert [text.get_text() for text in axis.texts if text.get_text()] == ["r", "a", "b", "c"]
    for wrong in (arrows[:1], [*arrows, _diagram.Arrow("a", "c")]):
        with pytest.raises(AssertionError, match="not as wired"):
            _diagram.draw(Figure().add_subplot(), boxes, wires, wrong)


def test_command_of_the_page_writes_it(tmp_path: Path) -> None:
    shutil.copy(DOCS / "effects.md", tmp_path)
    page = (DOCS / "literature.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^\$ python (\S+) docs$", page, re.M)
    run = subprocess.run(
        [sys.executable, command, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "literature.md").read_text(encoding="utf-8") == page
