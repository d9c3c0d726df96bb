"""Pages of the site that follow from the blocks are current, and its notebooks have the outputs of their programs."""

from __future__ import annotations

import importlib
import json
import re
import zipfile
from copy import deepcopy
from pathlib import Path
from types import ModuleType

import lief
import nbformat
import pytest
from lxml import etree
from nbconvert.preprocessors import ExecutePreprocessor
from thorough import nightly

from friction_fmus import fmu
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.blocks.probe import OUTPUT, PARAMETER
from harness.compiling.platforms import NATIVE
from harness.masters import masters

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    return importlib.import_module("tables")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_begin_with_a_plot_and_keep_their_outputs(path: Path) -> None:
    code = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert all(cell["outputs"] for cell in code)
    assert any("image/png" in output.get("data", {}) for output in code[0]["outputs"])


@nightly
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_print_what_they_keep(path: Path, tmp_path: Path) -> None:
    kept = nbformat.read(path, as_version=4)
    run = deepcopy(kept)
    ExecutePreprocessor(timeout=300, startup_timeout=180).preprocess(run, {"metadata": {"path": str(tmp_path)}})

    def printed(notebook: nbformat.NotebookNode) -> str:
        outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
        return "".join(output.text for output in outputs if output.output_type == "stream")

    assert printed(run) == printed(kept)


@nightly
def test_every_table_stands_on_one_page_and_names_every_block(tables: ModuleType) -> None:
    pages = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}
    named = [name for text in pages.values() for name in re.findall(r"<!-- table: (\w+) -->", text)]
    assert sorted(named) == sorted(tables.TABLES)
    filled = {name: tables.filled(pages[name]) for name in ("models.md", "which-model.md", "which-compensator.md")}
    for block in catalogue().values():
        if block.kind == "friction":
            assert f"\n## {block.name}\n" in filled["models.md"]
            assert f"[{block.name}](models.md#" in filled["which-model.md"]
        elif block.kind == "compensator":
            assert f"| **{block.name}** |" in filled["which-compensator.md"]


def test_the_table_of_masters_names_all(tables: ModuleType) -> None:
    rows = tables.masters().splitlines()
    assert [re.split(r" ?\| ?", row)[1] for row in rows[2:]] == [f"`{name}`" for name in masters()]
    assert all(len(cell) > 10 for row in rows[2:] for cell in re.split(r" ?\| ?", row)[2:4])


@pytest.mark.parametrize("name", ["LuGre", "Mass", "PID", "ImpulsiveControl", "Encoder"])
def test_page_of_capabilities_says_what_the_fmu_declares(name: str, tables: ModuleType) -> None:
    page = (ROOT / "docs" / "capabilities.md").read_text(encoding="utf-8")
    with zipfile.ZipFile(fmu(name)) as archive:
        simulation = etree.fromstring(archive.read("modelDescription.xml")).find("CoSimulation")
        binary = next(member for member in archive.namelist() if member.startswith(f"binaries/{NATIVE.folder}/"))
        library = lief.parse(list(archive.read(binary)))
    assert simulation is not None
    declared = {key: value for key, value in simulation.attrib.items() if key != "modelIdentifier"}
    assert dict(re.findall(r"^\| `(\w+)` \| `(\w+)` \|", tables.capabilities(), re.M)) == declared
    functions = {symbol.name for symbol in library.exported_symbols if str(symbol.name).startswith("fmi2")}
    exchanges = catalogue()[name].no_exchange == ""
    assert len(functions) == (44 if exchanges else 34)
    assert "all 34 of co-simulation and the 10 of model exchange are exported" in page


@nightly
def test_models_to_begin_with_show_what_the_motion_asks_for(tables: ModuleType) -> None:
    for row, suited in [(row, tables.suited_models(row)) for row in tables.MOTIONS] + [
        (row, tables.answering_models(row)) for row in tables.QUESTIONS
    ]:
        assert tables.choices(row)
        assert set(tables.choices(row)) <= set(suited), row.name


@nightly
def test_compensators_named_get_by_with_the_signals_at_hand(tables: ModuleType) -> None:
    for situation in tables.SITUATIONS:
        assert tables.begin(situation)
        assert {*tables.choices(situation)} <= set(tables.suited_compensators(situation)), situation.known


def test_decision_tables_recommend_blocks_that_there_are(tables: ModuleType) -> None:
    rows = (*tables.MOTIONS, *tables.QUESTIONS, *tables.SITUATIONS)
    assert {name for row in rows for name in tables.choices(row)} <= tables.catalogue().keys()


@nightly
def test_what_estimates_friction_has_a_gain(tables: ModuleType) -> None:
    for block in tables.of_kind("compensator"):
        named = {(v.name, v.role) for v in tables.described(block.name).variables}
        assert ("F_hat", OUTPUT) not in named or ("gain", PARAMETER) in named, block.name
