"""README and the pages tell the truth: their commands and programs are run, their links lead somewhere."""

from __future__ import annotations

import importlib
import os
import re
import shlex
import subprocess
import sys
import tomllib
import zipfile
from inspect import isclass, isroutine
from pathlib import Path

import fmpy
import pytest
import yaml
from thorough import landing, nightly

import harness
from friction_fmus import build, fmu
from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import Block, catalogue
from friction_fmus.blocks.macros import paragraphs
from friction_fmus.cli.main import parser
from friction_fmus.fmi.documentation import notes_as_html
from friction_fmus.version import VERSION
from harness import DropOut, System

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
FRICTION = [block for block in catalogue().values() if block.kind == "friction"]
ADDING = [ROOT / "docs" / "adding-a-model.md", ROOT / "docs" / "adding-a-law.md"]
TUTORIALS = [
    *("index.md", "first-fmu.md", "which-model.md", "which-compensator.md", "harness-tutorial.md"),
    *("your-own-solver.md", "five-minutes.md", "microcontroller.md", "command-line.md", "modelica.md"),
    "simulators.md",
]
INSTALL = """python3 -m venv .venv
source .venv/bin/activate   # Windows: .venv\\Scripts\\activate
pip install -e .
"""


def blocks(page: Path, mark: str) -> list[str]:
    """The code blocks of a page that stand below ``<!-- mark -->``."""
    pattern = rf"<!-- {mark} -->\n```\w+\n(.*?)^```$"
    return re.findall(pattern, page.read_text(encoding="utf-8"), re.S | re.M)


def run(command: str, folder: Path) -> str:
    """One command line of a page, with the programs of this environment."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        shlex.split(command), cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, f"{command}: {result.stderr}"
    return result.stdout


def write_files(folder: Path) -> None:
    """The files that the pages on adding tell the reader to write."""
    for page, name in zip(ADDING, ("SmoothCoulomb.c", "viscous_feedforward.py"), strict=True):
        (text,) = blocks(page, f"file: {name}")
        (folder / name).write_text(text, encoding="utf-8")


@nightly
def test_commands_of_the_readme_work(tmp_path: Path) -> None:
    for command in "".join(blocks(ROOT / "README.md", "commands")).splitlines():
        run(command, tmp_path)
    with zipfile.ZipFile(tmp_path / "fmus" / "MyFriction.fmu") as archive:
        assert "binaries/win64/MyFriction.dll" in archive.namelist()
        assert {"20", "25"} <= set(re.findall(r'start="(\d+)(?:\.0)?"', archive.read("modelDescription.xml").decode()))
    for written in ("out/report.html", "c/lugre_feedforward.c", "web/LuGre-wasm/package.json"):
        assert (tmp_path / written).is_file()


def test_readme_installs_as_the_page_on_installation_says() -> None:
    assert blocks(ROOT / "README.md", "install") == blocks(ROOT / "docs" / "install.md", "install") == [INSTALL]


def test_readme_counts_the_blocks() -> None:
    (said,) = re.findall(r"more than (\d+) friction models and compensators", (ROOT / "README.md").read_text("utf-8"))
    assert int(said) < sum(block.kind in ("friction", "compensator") for block in catalogue().values())


def test_the_citation_names_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    required = {"cff-version", "message", "title", "authors"}  # of the schema of the Citation File Format 1.2.0
    assert required <= citation.keys()
    assert (str(citation["version"]), citation["license"]) == (VERSION, "MIT")


@nightly
def test_commands_of_the_check_page_work(tmp_path: Path) -> None:
    (commands,) = blocks(ROOT / "docs" / "check.md", "commands")
    for command in commands.splitlines():
        run(command, tmp_path)
    assert '"version": "2.1.0"' in (tmp_path / "check.sarif").read_text(encoding="utf-8")


@nightly
def test_commands_of_the_page_on_importers_work(tmp_path: Path) -> None:
    (commands,) = blocks(ROOT / "docs" / "interop.md", "commands")
    for command in commands.splitlines():
        run(command, tmp_path)
    assert (tmp_path / "LuGre.csv").read_text(encoding="utf-8").splitlines()[-1].startswith("1.0,")


def test_versions_of_the_page_on_importers_are_the_pinned_ones() -> None:
    page = (ROOT / "docs" / "interop.md").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for pinned in project["project"]["optional-dependencies"]["interop"]:
        name, version = pinned.split(";")[0].split("==")
        assert f"| {name} {version} " in page


def test_python_of_the_readme_gives_the_published_stick_slip(tmp_path: Path) -> None:
    (program,) = blocks(ROOT / "README.md", "python")
    program += "\nprint(result['mass.x'].attrs['units'], float(result['mass.x'][-1]))"
    result = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    unit, position = result.stdout.split()
    assert (tmp_path / "stick_slip.png").is_file()
    assert unit == "m"
    # x(20 s) = 1.272596 m (benchmark B5), and one slip of 2 x (1.507988 - 0.741239) N / (2 N/m) more
    assert float(position) == pytest.approx(1.272596 + 0.63627, abs=2e-3)


@nightly
def test_program_of_the_harness_page(tmp_path: Path) -> None:
    """Gauss-Seidel misses what it hands over, and is wrong by a quarter of a metre, as the page says."""
    program, drive, *_ = blocks(ROOT / "docs" / "harness.md", "python")
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    (tmp_path / "drive.py").write_text(drive + "assert abs(F).max() > 1.0\n", encoding="utf-8")
    defect, error = (float(word) for word in run(f"{sys.executable} program.py", tmp_path).split())
    run(f"{sys.executable} drive.py", tmp_path)
    assert defect > 0.05
    assert error == pytest.approx(0.26, abs=0.01)


def test_batches_of_the_harness_page(tmp_path: Path) -> None:
    """All copies are stepped, those that have moved less than 5 mm return to their start, the others do not."""
    *_, program = blocks(ROOT / "docs" / "harness.md", "python")
    program = program.replace(
        "    axes.close()\n", "    x = axes.values[:, 0]\n    print(sorted(x)[0], x.max())\n    axes.close()\n"
    )
    (tmp_path / "batches.py").write_text(program, encoding="utf-8")
    failures, places = run(f"{sys.executable} batches.py", tmp_path).splitlines()
    least, most = (float(word) for word in places.split())
    assert failures == "{}"
    assert 0.0 <= least <= most < 0.02
    assert most > 5e-3


@nightly
@pytest.mark.parametrize("name", TUTORIALS)
def test_tutorial_works_and_prints_what_it_says(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its commands, those of this project in this process, and then all of its programs as one."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / name
    for command in "".join(blocks(page, "commands")).splitlines():
        program, *arguments = shlex.split(command)
        if program == "friction-fmus":
            assert main(arguments) == 0, command
        else:
            run(command, tmp_path)
    if programs := blocks(page, "python"):
        (tmp_path / "program.py").write_text("\n".join(programs), encoding="utf-8")
        assert run(f"{sys.executable} program.py", tmp_path) == "".join(blocks(page, "output: python"))


def test_steps_for_other_tools_give_the_position_that_is_said() -> None:
    """All parts at once on held values, as libcosim and ecos step them, at the step of the page.

    `tests/interop/test_omsimulator.py` has the scheme of OMSimulator.
    """
    page = (ROOT / "docs" / "first-fmu.md").read_text(encoding="utf-8")
    (said,) = re.findall(r"After 20 s the mass is at x = ([\d.]+) m", page)
    with System.from_toml(ROOT / "examples" / "stick_slip.toml", resolve=fmu) as system:
        run = system.run(stop=20.0, step=1e-4, master="jacobi")
    assert float(said) == pytest.approx(1.272596, abs=5e-5)  # benchmark B5
    assert float(run["mass.x"][-1]) == pytest.approx(1.272596, abs=2e-4)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_programs_and_commands_are_marked_to_be_run(page: Path) -> None:
    """Except the scripts of effects, long runs by hand, and the commands of the pages on adding."""
    text = page.read_text(encoding="utf-8")
    fences = re.findall(r"^(<!-- [^\n]* -->\n)?```(sh|python)\n(.*?)^```$", text, re.S | re.M)
    known = r"python examples/\w+/\w+\.py figures\n|tests/nightly\.sh\n|tests/slow/sanitized\.sh.*"
    known += r"|(friction-fmus [^\n]*\n)+" if page in ADDING else ""
    assert [code for mark, _, code in fences if not mark and not re.fullmatch(known, code, re.S)] == []


def test_manipulators_of_the_harness_page_are_read(tmp_path: Path) -> None:
    """The tables of the page, in a system file."""
    page = (ROOT / "docs" / "harness.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^```toml\n(.*?)^```$", page, re.S | re.M)
    (wire,) = re.findall(r"`(\{ wire = [^`]*\})`", page.replace("\n", " "))
    shown = wire.replace("a.y", "mass.v").replace("b.u", "friction.v")
    text = (ROOT / "examples" / "stick_slip.toml").read_text(encoding="utf-8")
    path = tmp_path / "system.toml"
    path.write_text(text.replace('"mass.v -> friction.v"', shown) + "\n" + table, encoding="utf-8")
    with System.from_toml(path, resolve=fmu) as system:
        assert (system.wires[0].gain, system.wires[0].offset, system.wires[0].delay) == (2.0, 1.0, 1)
        assert system.experiment is not None
        assert system.experiment.manipulators == (DropOut("friction.v", 0.2, seed=1, start=5.0, stop=6.0),)


def test_system_shown_on_the_first_page_is_the_example(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "five-minutes.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```toml\n(.*?)^```$", page, re.S | re.M)
    (tmp_path / "shown.toml").write_text(shown, encoding="utf-8")

    def find(name: str) -> Path:
        return build(name, tmp_path)

    with (
        System.from_toml(tmp_path / "shown.toml", find) as a,
        System.from_toml(ROOT / "examples" / "stick_slip.toml", find) as b,
    ):
        assert (a.wires, a.start) == (b.wires, b.start)
        assert (a.experiment.stop, a.experiment.step) == (b.experiment.stop, b.experiment.step)


@nightly
def test_a_new_friction_model_is_one_file(tmp_path: Path) -> None:
    write_files(tmp_path)
    for page in ADDING:
        for command in re.findall(r"^friction-fmus .*$", page.read_text(encoding="utf-8"), re.M):
            run(command, tmp_path)
    result = fmpy.simulate_fmu(
        str(tmp_path / "fmus" / "SmoothCoulomb.fmu"), start_values={"v": 1.0}, stop_time=1.0, step_size=1e-2
    )
    # Fc = 2.5 N was set; tanh(1/1e-3) = 1 and the lag of 10 ms is over: F = Fc + Fv v
    assert result["F"][-1] == pytest.approx(2.5 + 0.4, rel=1e-9)
    law = fmpy.simulate_fmu(
        str(tmp_path / "fmus" / "ViscousFeedforward.fmu"), start_values={"rd": 2.0, "rdd": 3.0}, stop_time=0.01
    )
    assert law["u"][-1] == 1.0 * 3.0 + 0.4 * 2.0


def test_rows_named_in_the_guide_are_those_of_block_h() -> None:
    header = (ROOT / "fmu_src" / "block.h").read_text(encoding="utf-8")
    kinds = set(re.findall(r"^#define (\w+)\(name, [^)]*\)\s+(?:SCALAR|VECTOR|DYNAMICS?|INPUT)\(", header, re.M))
    guide = ADDING[0].read_text(encoding="utf-8")
    assert kinds
    assert [kind for kind in sorted(kinds) if f"`{kind}`" not in guide] == []


def test_there_are_no_more_pages_than_people_read() -> None:
    assert len(list((ROOT / "docs").glob("*.md"))) <= 40


def test_a_picture_or_a_table_is_on_the_first_two_screens_of_a_page() -> None:
    """Of pages for users, and of all but the shortest; a screen of 1400 px by 900 px shows some 30 lines."""
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\n  - Development:")[0]
    late = []
    for page in PAGES:
        lines = page.read_text(encoding="utf-8").splitlines()
        seen = [bool(re.search(r"!\[|<img |^\|[-: |]+\|$|<!-- (table: \w+|rules) -->", line)) for line in lines]
        if page.name in navigation and len(lines) > 60 and True not in seen[:60]:
            late.append(page.name)
    assert late == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_within_sentences_have_the_arguments_that_they_need(page: Path) -> None:
    for words in re.findall(r"`(friction-fmus [^`]*)`", page.read_text(encoding="utf-8")):
        _, *arguments = shlex.split(words)
        if len(arguments) > 1 and "--help" not in arguments:  # not the name of a command
            assert parser().parse_args(arguments), words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        file = page.parent / target.replace("lab.md", "lab/index.html")
        notebook = ROOT / "examples" / "notebooks" / f"{file.stem}.ipynb"
        assert (notebook if file.parent.name == "notebooks" else file).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_that_are_named_are_there(page: Path) -> None:
    named = re.findall(r"\btests/[\w/-]+(?:\.\w+)?", page.read_text(encoding="utf-8"))
    assert [path for path in named if not (ROOT / path).exists()] == []


@landing
def test_sentences_are_not_those_of_another_language(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parent)
    assert importlib.import_module("wording").candidates() == []


def test_the_reference_has_every_class_and_function_of_the_harness() -> None:
    """`slow/test_built_site.py` finds all other names in the built pages."""
    pages = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "api").glob("*.md"))
    shown = {name.rpartition(".")[2] for name in re.findall(r"^::: (\S+)$", pages, re.M)}
    public = {name: getattr(harness, name) for name in harness.__all__}
    assert {name for name, value in public.items() if isclass(value) or isroutine(value)} <= shown


def test_changelog_names_every_block() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert [name for name in catalogue() if f"`{name}`" not in text] == []


@pytest.mark.parametrize("block", FRICTION, ids=lambda block: block.name)
def test_a_friction_model_says_what_one_chooses_by(block: Block) -> None:
    parts = paragraphs(block.notes)
    leads = [part.lead for part in parts if part.lead]
    assert leads == ["Use it", "Limits:"]
    assert all(len(part.text.split()) >= 10 for part in parts if part.lead)
    assert block.source
    assert block.bibtex
    assert block.features
    assert any(part.equations for part in parts)
    assert [line for part in parts if part.equations for line in part.lines if len(line) > 76] == []


def test_notes_are_prose_equations_lists_and_leads() -> None:
    notes = "A spring,\nsoft.\n\n    F = k x\n      + d v\n\nHere:\n- one\n  more\n- two\n\nLimits: k >\n0."
    spring, equations, here, one, two, limits = paragraphs(notes)
    assert (spring.text, spring.equations, spring.lead) == ("A spring, soft.", False, "")
    assert (equations.text, equations.equations) == ("F = k x\n  + d v", True)
    assert (here.text, here.item, one.text, one.item, two.text) == ("Here:", False, "one more", True, "two")
    assert (limits.lead, limits.text) == ("Limits:", "k > 0.")
    assert notes_as_html(notes) == (
        "<p>A spring, soft.</p>\n<pre>F = k x\n  + d v</pre>\n<p>Here:</p>\n"
        "<ul>\n<li>one more</li>\n<li>two</li>\n</ul>\n<p><b>Limits:</b> k &gt; 0.</p>"
    )
