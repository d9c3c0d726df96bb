"""What the command line and the packages import, and how long it takes to start them."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from thorough import nightly, some

import friction_fmus
import friction_fmus.harness
import friction_fmus.identification
import harness
from friction_fmus.blocks.catalogue import OWN_BLOCKS, Entry, catalogue, listing
from friction_fmus.blocks.law_summaries import law_paths, read_headings
from friction_fmus.lawkit.law import discover_laws

ROOT = Path(__file__).parents[2]
COMMANDS = sorted(path.stem for path in (ROOT / "friction_fmus" / "cli" / "commands").glob("[!_]*.py"))
SLOW = {
    *("casadi", "fmpy", "h5py", "jinja2", "lxml", "matplotlib", "numpy", "pandas"),
    *("platformdirs", "plotly", "pyarrow", "rich", "scipy", "threadpoolctl", "xarray", "multiprocessing"),
}
"""What neither ``--help`` nor an import of a package may import."""

PROGRAM = """
import json, resource, sys
from friction_fmus.cli.main import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code
spent = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps([sorted(sys.modules), spent.ru_utime + spent.ru_stime]), file=sys.stderr)
"""


def started(*arguments: str) -> tuple[set[str], float]:
    """The modules that a command has imported at its end, and its processor time [s]."""
    pytest.importorskip("resource", reason="Windows does not count the time of a process this way")
    command = [sys.executable, "-c", PROGRAM, *arguments]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    modules, seconds = json.loads(run.stderr)
    return set(modules), seconds


@pytest.mark.parametrize(
    "arguments",
    some([[], *([command] for command in COMMANDS)], [[], *([command] for command in COMMANDS)][::4]),
    ids=" ".join,
)
def test_help_imports_no_library_and_no_block(arguments: list[str]) -> None:
    modules, _ = started(*arguments, "--help")
    assert modules & SLOW == set()
    assert modules & {"friction_fmus.lawkit.law", "friction_fmus.export.block_fmu"} == set()


@pytest.mark.parametrize("arguments", [["list"], ["list", "--json"], ["--version"]], ids=" ".join)
def test_list_and_version_import_no_library(arguments: list[str]) -> None:
    assert started(*arguments)[0] & SLOW == set()


def test_show_imports_only_what_draws_its_page_and_finds_the_cache() -> None:
    assert started("show", "LuGre")[0] & SLOW == {"platformdirs", "rich"}


@nightly
@pytest.mark.parametrize(
    ("arguments", "most"), [(["--help"], 0.3), (["list"], 0.3), (["show", "LuGre"], 0.3), (["--version"], 0.3)]
)
def test_processor_time_of_the_start(arguments: list[str], most: float) -> None:
    """Twice the 0.3 s that are promised, for slow machines; importing everything takes about 2 s."""
    assert min(started(*arguments)[1] for _ in range(3)) < 2.0 * most


@pytest.mark.parametrize("package", ["friction_fmus", "harness", "friction_fmus.harness"])
def test_a_package_imports_no_library(package: str) -> None:
    program = f"import sys, {package}; print(*sys.modules)"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment, cwd=ROOT
    )
    assert set(run.stdout.split()) & SLOW == set()


@pytest.mark.parametrize("package", ["friction_fmus", "harness", "friction_fmus.harness"])
def test_dir_lists_the_public_names_and_each_is_there(package: str) -> None:
    module = importlib.import_module(package)
    assert dir(module) == sorted(module.__all__)
    assert all(hasattr(module, name) for name in module.__all__)
    with pytest.raises(AttributeError, match=r"has no attribute 'Sistem'"):
        _ = module.Sistem


@pytest.mark.parametrize("name", ["masters", "plot"])
def test_a_function_is_not_hidden_by_the_submodule_of_its_name(name: str) -> None:
    program = f"import harness.{name}, harness; assert callable(harness.{name})"
    subprocess.run([sys.executable, "-c", program], check=True, env=os.environ | {"PYTHONPATH": str(ROOT)})


def test_no_lazy_name_is_the_name_of_a_submodule() -> None:
    """Importing the submodule would replace the name."""
    for package in (friction_fmus, harness, friction_fmus.identification):
        source = Path(str(package.__file__)).read_text(encoding="utf-8")
        submodules = {path.stem for path in Path(str(package.__file__)).parent.iterdir()}
        both = submodules & set(package.__all__)
        assert all(f"\nfrom {package.__name__}.{name} import " in source for name in both - {"harness", "study"}), both


def test_the_harness_has_a_second_name() -> None:
    from friction_fmus.harness import System

    assert System is harness.System
    assert all(getattr(friction_fmus.harness, name) is getattr(harness, name) for name in harness.__all__)
    assert friction_fmus.harness.__all__ == harness.__all__


def test_one_namespace_has_what_people_try_first() -> None:
    from friction_fmus import FmuPart, FrictionError, System, fmu, plot

    assert all(
        issubclass(getattr(friction_fmus, name), FrictionError) for name in friction_fmus.__all__ if "Error" in name
    )
    assert callable(friction_fmus.study)
    assert friction_fmus.study.run_study.__name__ == "run_study"
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"mass.k": 2.0, "mass.v_support": 0.1, "mass.F_drive": 0.0}
    with System({"mass": "Mass", "friction": "LuGre"}, wires, start) as system:
        result = system.run(0.05)  # both FMUs suggest a step of 1 ms
    assert result.sizes["time"] == 51
    assert plot(result)._repr_png_().startswith(b"\x89PNG")  # as a notebook shows it
    part = FmuPart("friction", fmu("LuGre", Fc=2, Fs="0.003 kN"))
    assert {port.name: port.start for port in part.parameters}.items() >= {"Fc": 2.0, "Fs": 3.0}.items()
    with pytest.raises(FrictionError, match="did you mean LuGre"):
        FmuPart("friction", "Lugree")


def test_the_list_is_that_of_the_catalogue() -> None:
    blocks = catalogue()
    assert list(listing()) == list(blocks)
    for name, entry in listing().items():
        block = blocks[name]
        assert entry == Entry(block.name, block.kind, block.summary, block.source, block.path, block.family)


LAW = '''
from friction_fmus.lawkit.law import FORCE, Output, law
{before}

@law({arguments}, Ts=1e-3, outputs={{"u": Output(FORCE, "force")}})
def equations():
    """Nothing."""
    return {{"u": 0.0}}

{after}
'''


@pytest.mark.parametrize(
    ("arguments", "before", "after", "names"),
    [
        ('"A", "b", source="c"', "", "", ["A"]),
        ('source="c", summary="b", name="A"', "", "", ["A"]),
        ('"A" "B", "b", source="c"', "", "", ["AB"]),
        ('NAME, "b", source="c"', 'NAME = "A"', "", ["A"]),
        ('f"A{1}", "b", source="c"', "", "", ["A1"]),
        ('"A", **TEXTS', 'TEXTS = {"summary": "b", "source": "c"}', "", ["A"]),
        (
            '"A", "b", source="c"',
            "",
            'def more():\n    """Nothing."""\n    return {"u": 0.0}\n'
            'B = law("B", "b", source="c", Ts=1e-3, outputs={"u": Output(FORCE, "force")})(more)',
            ["A", "B"],
        ),
    ],
)
def test_headings_are_those_of_the_laws(
    arguments: str, before: str, after: str, names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether they are literals, which are read, or computed, for which the file is imported."""
    path = tmp_path / "some_law.py"
    path.write_text(LAW.format(arguments=arguments, before=before, after=after), encoding="utf-8")
    literal = not (before or after or "{" in arguments)
    assert (read_headings(path) is not None) == literal
    monkeypatch.setenv(OWN_BLOCKS, str(tmp_path))
    entries = [entry for entry in listing().values() if entry.path == path]
    assert [entry.name for entry in entries] == names
    laws = [(law.name, law.summary, law.source, law.path) for law in discover_laws(path)]
    assert sorted((entry.name, entry.summary, entry.source, entry.path) for entry in entries) == sorted(laws)


def test_law_files_do_not_begin_with_an_underscore(tmp_path: Path) -> None:
    for name in ("b.py", "_shared.py", "a.py", "notes.txt"):
        (tmp_path / name).touch()
    assert [path.name for path in law_paths(tmp_path)] == ["a.py", "b.py"]


@nightly
def test_a_file_harness_py_in_the_working_folder(tmp_path: Path) -> None:
    """It is another package's, or the user's own; workers of a sweep must not find it either."""
    (tmp_path / "harness.py").write_text("raise SystemExit('the wrong one')\n")
    (tmp_path / "script.py").write_text(
        "from friction_fmus.harness import CallablePart, Experiment, System, sweep\n\n"
        "def y(t, u, x):\n    return 2.0 * u[0]\n\n"
        "def make():\n    return System([CallablePart('p', y, ['u'], ['y'])], start={'p.u': 0.0})\n\n"
        "if __name__ == '__main__':\n"
        "    found = sweep(make, [{'p.u': 1.0}, {'p.u': 2.0}], measure='final(p.y)', workers=1,\n"
        "                  experiment=Experiment(stop=1.0, step=1.0))\n"
        "    print(found['final(p.y)'].to_numpy().tolist())\n"
    )
    for command, expected in ((["-m", "friction_fmus", "show", "LuGre"], "LuGre"), (["script.py"], "[2.0, 4.0]")):
        run = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120
        )
        assert run.returncode == 0, run.stderr
        assert expected in run.stdout
