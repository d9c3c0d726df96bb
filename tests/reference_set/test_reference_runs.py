"""The reference set is built and run; what a tool does wrong is said."""

from __future__ import annotations

import os
import re
import resource
import shlex
import shutil
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy import simulate_fmu
from thorough import landing, nightly, slowness

from friction_fmus.cli.main import main
from friction_fmus.reference.case import CASES, ReferenceCase, read_case
from friction_fmus.reference.set_builder import build_case
from friction_fmus.reference.tool_runs import compare, read_junit, run_case

FMPY = {
    "fmi3_structural_parameter": "sets the structural parameter outside of configuration mode",
    "me_grazing": "sets inputs only at the ends of the steps of the solver",
    "me_input_ramp": "as before",
    "partial_step": "repeats the step for ever",
    "ssp_algebraic_loop": "its rows have the times of the beginnings of the steps, and it sets no parameters",
    "ssp_chain": "as before",
    "ssp_contact_1e5": "as before",
    "ssp_contact_1e8": "as before",
    "ssp_enumeration": "as before",
    "ssp_many_instances": "as before",
    "ssp_nested": "as before",
    "ssp_parameters": "as before",
    "ssp_sampled_loop": "as before",
    "ssp_transformation": "as before",
    "ssp_types": "as before",
    "ssp_units": "as before",
}
"""Cases that are not passed in fmpy 0.3.32, with the reason."""

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set of five cases."""
    folder = tmp_path_factory.mktemp("set")
    for name in ("input_ramp", "me_event_iteration", "me_samples_between_rows", "saved_state", "ssp_parameters"):
        build_case(read_case(CASES / name), folder)
    return folder


@pytest.fixture(scope="module")
def case(cases: Path) -> ReferenceCase:
    return read_case(cases / "input_ramp")


def test_a_built_case_has_all_that_a_tool_needs(cases: Path) -> None:
    assert {file.name for file in (cases / "input_ramp").iterdir()} == {
        *("Mass.fmu", "README.md", "bound.csv", "case.toml", "inputs.csv", "reference.csv"),
    }
    page = (cases / "input_ramp" / "README.md").read_text(encoding="utf-8")
    assert "inputs-held-one-step-late" in page
    assert "FMI 2.0.5, 4.2.4" in page
    with zipfile.ZipFile(cases / "input_ramp" / "Mass.fmu") as archive:
        folder = "extra/org.fmi-standard.fmi-ls-ref/"
        manifest = ElementTree.fromstring(archive.read(f"{folder}fmi-ls-manifest.xml"))
        assert {f"{folder}{each.get('source')}" for each in manifest} <= {*archive.namelist()}
        assert b"<ModelExchange" not in archive.read("modelDescription.xml")
    with zipfile.ZipFile(cases / "ssp_parameters" / "ssp_parameters.ssp") as archive:
        assert {"SystemStructure.ssd", "values.ssv", "mapping.ssm", "resources/mass.fmu"} <= {*archive.namelist()}


def test_variables_that_are_not_set_have_their_start_values(cases: Path) -> None:
    """The text is "none", of four bytes."""
    shown = ("y", "der(y)", "count_out", "length", "flag_out", "mode_out")
    result = simulate_fmu(cases / "me_event_iteration" / "Features.fmu", stop_time=0.125, output=shown)
    assert dict(zip(("time", *shown), result[0], strict=True)) == {
        **{"time": 0.0, "y": 0.0, "der(y)": 1.0, "count_out": 1, "length": 4, "flag_out": True, "mode_out": 1}
    }


@landing
def test_the_set_runs_in_tools_and_makes_the_tables(cases: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["--case", "input_ramp", "--case", "me_event_iteration", "--case", "saved_state"]
    assert main(["reference", "run", str(cases), "--tool", "fmpy", *names]) == 0
    assert main(["reference", "run", str(cases), "--tool", "harness"]) == 0
    page = (cases / "results" / "index.html").read_text(encoding="utf-8")
    assert capsys.readouterr().out.count("index.html") == 2
    assert page.count("<b>passed</b>") == 7
    assert page.count("<b>not supported</b>") == 1
    suite = ElementTree.parse(cases / "results" / "harness" / "junit.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("skipped")) == ("5", "0", "1")
    assert main(["reference", "run", str(cases), "--results", str(cases / "results" / "fmpy"), "--name", "again"]) == 0


def tool(code: str) -> str:
    """A command that runs a program."""
    return f"{{python}} -c '{code}' {{case}} {{output}}"


@pytest.mark.parametrize(
    ("code", "state", "detail"),
    [
        ("import sys; sys.exit(77)", "not supported", "it printed nothing"),
        ('print("no"); exit(3)', "failed", "status 3: no"),
        ("import os; os.abort()", "failed", "SIGABRT"),
        ("while True: pass", "failed", "it did not end within 0.5 s"),
        ("pass", "failed", "it wrote no input_ramp.csv"),
        ('import sys; open(sys.argv[2], "w").write("time,x\\n0,0\\n")', "failed", "have no v"),
    ],
)
def test_what_a_tool_does_wrong_is_said(
    case: ReferenceCase, tmp_path: Path, code: str, state: str, detail: str
) -> None:
    limit = 0.5 if "while" in code else 20.0
    verdict = run_case(case, tool(code), tmp_path, time_limit=limit)
    assert (verdict.state, detail in verdict.detail) == (state, True), verdict


def changed(case: ReferenceCase, tmp_path: Path, *replaced: tuple[str, str]) -> tuple[str, str]:
    """The verdict on the reference values after replacements."""
    text = (case.folder / "reference.csv").read_text(encoding="utf-8")
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    output = tmp_path / "changed.csv"
    output.write_text(text, encoding="utf-8")
    return compare(case, output)


def test_results_are_compared(case: ReferenceCase, tmp_path: Path) -> None:
    assert changed(case, tmp_path) == ("passed", "0 times the bound")
    assert changed(case, tmp_path, ("time,x,v", '" time [s]","x [m]",v'))[0] == "passed"
    assert changed(case, tmp_path, ("1.0,", "1.0,9.0,9.0\n1.0,"))[0] == "passed"  # as before an event
    state, detail = changed(case, tmp_path, ("1.0,", "1.0,2.0,3.75\n7.0,"))
    assert (state, "beyond" in detail or "has to end at 1 s" in detail) == ("failed", True)
    assert changed(case, tmp_path, ("0.5,", "0.4999,"))[1] == "its results have no row for 0.5 s"
    assert changed(case, tmp_path, ("0.5,", "0.5,nan,0\n0.50001,"))[0] == "failed"
    assert changed(case, tmp_path, ("0.25,", "0.125,"), ("0.375,", "0.0,"))[1] == "its times decrease"
    assert changed(case, tmp_path, ("0.25,", "soon,"))[1].startswith("its results cannot be read")
    v = [line.split(",")[2] for line in (case.folder / "reference.csv").read_text().splitlines()][-1]
    state, detail = changed(case, tmp_path, (f",{v}", ",4.5"))
    assert (state, detail.split(":")[0]) == ("inaccurate", "3 times the bound")  # 4.5 - 3.75 = 3 h 8/4


def test_values_that_are_exact_or_texts(tmp_path: Path) -> None:
    case = read_case(CASES / "types")
    assert changed(case, tmp_path, ("16777217", "16777216"))[0] == "failed"
    case = read_case(CASES / "string_output")
    assert changed(case, tmp_path)[0] == "passed"
    assert changed(case, tmp_path, ("Müller", "M"))[0] == "failed"
    case = read_case(CASES / "nan_input")
    assert changed(case, tmp_path, (",1.0", ",True"), (",0.0", ",false"))[0] == "passed"
    case = read_case(CASES / "saved_state")
    assert changed(case, tmp_path, ("\n0.5,", "\n0.5,0,0\n0.5,"))[1] == "its results have 6 rows, not 5"


def test_a_command_line_that_cannot_express_a_case_does_not_support_it(cases: Path, tmp_path: Path) -> None:
    command = "fmpy-program {fmu} {output}"
    assert run_case(read_case(cases / "input_ramp"), command, tmp_path).detail == "needs inputs"
    assert run_case(read_case(cases / "me_event_iteration"), command, tmp_path).detail == "needs start"
    assert run_case(read_case(cases / "ssp_parameters"), command, tmp_path, lacks=["ssp"]).detail == "needs ssp"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["build"], "give `reference build` a folder for the set with -o"),
        (["run", "{set}"], "either --tool or --results"),
        (["run", "{set}", "--tool", "fmpy", "--case", "input"], "has no case 'input'"),
        (["run", "{set}", "--tool", "no-such-program {case} {output}"], "cannot be run"),
        (["run", "{set}", "--tool", "python {nothing} {case}"], "cannot be run"),
        (["run", "{empty}", "--tool", "fmpy"], "has no cases"),
    ],
)
def test_refused_commands(
    cases: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    given = [each.replace("{set}", str(cases)).replace("{empty}", str(tmp_path)) for each in arguments]
    assert main(["reference", *given]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_case_that_is_wrong_is_refused(cases: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(cases / "input_ramp", tmp_path / "input_ramp")
    file = tmp_path / "input_ramp" / "case.toml"
    text = file.read_text(encoding="utf-8")
    for old, new in (('kind = "cs"', 'kind = "co"'), ("stop = 1.0", 'stop = "now"'), ("outputs", "output")):
        file.write_text(text.replace(old, new), encoding="utf-8")
        assert main(["reference", "run", str(tmp_path), "--tool", "fmpy"]) == 2
        assert "case.toml is not a case" in capsys.readouterr().err


@nightly
def test_the_whole_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """By the commands of the page, and in the harness."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    page = (ROOT / "docs" / "reference-set.md").read_text(encoding="utf-8")
    commands = "".join(re.findall(r"<!-- commands -->\n```sh\n(.*?)```", page, re.S)).splitlines()
    build, *runs = [shlex.split(command)[1:] for command in commands]
    assert main(build) == 0
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    assert [main(run) for run in runs] == [1, 0]
    assert sum(file.stat().st_size for file in Path("set").rglob("*") if "results" not in file.parts) < 10_000_000
    wrong = [name for name, text in read_junit(Path("set"))["fmpy"].items() if re.match("failed|inaccurate", text)]
    assert wrong == [*FMPY], capsys.readouterr().out
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 60.0 * slowness()
    assert main(["reference", "run", "set", "--tool", "harness"]) == 0
