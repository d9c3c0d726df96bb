"""The command line, run as a user runs it."""

from __future__ import annotations

import io
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fmpy import read_model_description
from rich.console import Console
from shell.selection import EACH_BRANCH
from thorough import landing, nightly, some

from friction_fmus import build, fmu
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.cli import commands
from friction_fmus.cli.console import RunBar, progress_bar
from friction_fmus.cli.main import main, parser
from friction_fmus.codegen.law_export import export_law
from harness import Parameter, ParameterSet, System, UnitError, load_result, masters, open_archive, write_ssv
from harness.compiling.platforms import NATIVE

RAMP = """
[experiment]
stop = 4.0
step = 1.0

[parts.ramp]
record = "ramp.csv"
"""
LINE = "time [s],y [mm]\n0,0\n4,4\n"
ROOT = Path(__file__).parents[2]
STICK_SLIP = ROOT / "examples" / "stick_slip.toml"


def fails(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Status 2, nothing on stdout; the message on stderr."""
    assert main([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("friction-fmus: ")
    assert captured.err.count("\n") == 1 or "\n\n[data]\n" in captured.err
    return captured.err


def test_what_a_library_says_in_several_lines_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """libxml2 ends a line behind the character that it refuses."""
    path = tmp_path / "system.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", b"<?xml version='1.0'?>\n<a>\0</a>")
    assert "is not XML" in fails(capsys, "run", path, "-o", tmp_path / "o.csv")


def test_module_and_script_are_the_same_program() -> None:
    for command in ([sys.executable, "-m", "friction_fmus"], [str(Path(sys.executable).parent / "friction-fmus")]):
        run = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert run.stdout.startswith("friction-fmus ")


def test_list_json_names_kind_summary_and_source_of_every_block(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)
    assert {"LuGre", "Stribeck", "Mass", "PID", "CascadePPI", "StaticFeedforward"} <= {e["name"] for e in entries}
    for entry in entries:
        assert set(entry) == {"name", "kind", "family", "summary", "source"}
        assert entry["kind"] in {"friction", "plant", "compensator", "signal"}
        assert bool(entry["family"]) == (entry["kind"] == "compensator")
        assert entry["summary"]
        assert entry["source"]


def test_list_shows_every_block(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    assert "LuGre" in capsys.readouterr().out


def listed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, str]:
    """The family of each block that `list` prints."""
    assert main(["list", *arguments, "--json"]) == 0
    return {entry["name"]: entry["family"] for entry in json.loads(capsys.readouterr().out)}


def test_list_can_be_limited_to_a_kind_a_family_and_a_word(capsys: pytest.CaptureFixture[str]) -> None:
    """Whether a compensator is written in Python or in C is no category."""
    found = listed(capsys, "compensator")
    for name, family in (
        *(("PID", "integral"), ("LuGreFeedforward", "feedforward"), ("LeuvenFeedforward", "feedforward")),
        *(("LuGreObserver", "observer"), ("DisturbanceObserver", "estimator"), ("RepetitiveController", "learning")),
        ("ImplicitSuperTwisting", "sliding mode"),
    ):
        assert found[name] == family
    assert listed(capsys, "sliding mode").keys() == {name for name in found if found[name] == "sliding mode"}
    assert {"LuGre", "LuGreObserver"} <= listed(capsys, "--search", "lugre").keys()
    assert all("lugre" in name.lower() for name in listed(capsys, "friction", "--search", "LuGre"))
    assert main(["list", "--search", "no such word"]) == 1


def shown(name: str, width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines that `show` prints on a terminal of that width."""
    monkeypatch.setattr("friction_fmus.cli.console.console", Console(width=width))
    assert main(["show", name]) == 0
    return [line.rstrip() for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize("width", [80, 120])
def test_show_says_when_to_use_a_model_and_what_it_cannot_do(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = shown("LuGre", width, monkeypatch, capsys)
    assert max(map(len, lines)) <= width
    for lead in (
        "Use it     as a first model",
        "Limits     if v jumps, F jumps by sigma1",
        "Features   presliding: ",
        "Source     Canudas",
    ):
        assert any(line.startswith(lead) for line in lines), lead
    # prose fills the width: no line ends where the next one's first word would still fit
    start = next(i for i, line in enumerate(lines) if line.startswith("Use it"))
    for line, following in itertools.pairwise(lines[start : lines.index("", start)]):
        assert len(line) + 1 + len(following.split()[0]) > width
    # equations keep their layout
    first = lines.index("    g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)")
    assert lines[first + 1] == "    dz/dt = v - sigma0 |v| z / g(v)"


def test_show_groups_the_variables(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown("GMS", 120, monkeypatch, capsys)
    table = lines[next(i for i, line in enumerate(lines) if line.startswith("Variables")) :]
    titles = ("Inputs", "Outputs", "Internal variables", "Parameters", "Fixed parameters")
    assert [line for line in table if line in titles] == list(titles)
    rows = [re.split(r"\s{2,}", line) for line in table]
    assert ["v", "0", "m/s", "relative sliding velocity"] in rows
    assert ["k[1...10]", "28000 ... 2100", "N/m", "at least 0", "stiffness of the element"] in rows
    assert ["N", "10", "Integer", "1 to 10", "number of elements"] in rows


@pytest.mark.parametrize(
    "name", some([*(b.name for b in catalogue().values() if b.kind != "friction"), "SevenParameter"], EACH_BRANCH[::11])
)
def test_show_fits_the_terminal(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown(name, 80, monkeypatch, capsys)
    assert [line for line in lines if len(line) > 80] == []


@nightly
def test_start_values_of_numpy_are_written_as_numbers(tmp_path: Path) -> None:
    file = build("PID", tmp_path, {"Kp": np.float64(5e3), "db": np.int64(0), "Ts": np.float32(0.5)})
    start = {name: variable.start for name, variable in open_archive(file).variables.items()}
    assert [float(start[name]) for name in ("Kp", "db", "Ts")] == [5e3, 0.0, 0.5]


@landing
def test_build_burns_start_values_into_xml_and_source(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["build", "LuGre", "-o", str(tmp_path), "--set", "Fc=2.25", "--set", "asymmetric=true"]
    assert main([*arguments, "--name", "MyContact"]) == 0
    path = tmp_path / "MyContact.fmu"
    assert capsys.readouterr().out.split() == [str(path)]
    assert main(["check", str(path)]) == 0
    with zipfile.ZipFile(path) as archive:
        xml = archive.read("modelDescription.xml").decode()
        assert 'modelIdentifier="MyContact"' in xml
        assert 'start="2.25"' in xml
        assert "2.25," in archive.read("sources/MyContact.c").decode()


@nightly
def test_build_says_which_platform_it_compiles_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FRICTION_FMUS_CACHE", str(tmp_path / "cache"))
    shown: list[tuple[str, int]] = []
    for _ in range(2):  # the second time it is in the cache
        build(
            "Viscous", tmp_path, platforms=["native"], compiling=lambda platform, done: shown.append((platform, done))
        )
    assert shown == [(NATIVE.folder, 0)]


def test_run_writes_csv_parquet_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    csv, parquet, picture = tmp_path / "a.csv", tmp_path / "a.parquet", tmp_path / "a.png"
    common = ["run", str(STICK_SLIP), "--stop", "0.1", "-o"]
    assert main([*common, str(csv), "--plot", str(picture)]) == 0
    assert main([*common, str(parquet), "--master", "gauss-seidel", "--step", "1e-3"]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    frame = pd.read_csv(csv)
    assert list(frame.columns) == ["time [s]", "mass.x [m]", "mass.v [m/s]", "friction.F [N]"]
    assert len(frame) == 101
    assert (pd.read_parquet(parquet).to_numpy() == frame.to_numpy()).all()
    assert capsys.readouterr().err == ""  # no bar where the output is no terminal


def test_run_without_a_file_prints_the_values_of_each_variable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ramp.toml").write_text(RAMP, encoding="utf-8")
    (tmp_path / "ramp.csv").write_text(LINE, encoding="utf-8")
    assert main(["run", "ramp.toml"]) == 0
    first, _, row = capsys.readouterr().out.splitlines()
    assert first == "1 variable, 5 time points (0 to 4 s)"
    # the rms value of 0, 1, 2, 3, 4 is the root of 30/5
    assert row.split() == ["ramp.y", "mm", "4", "0", "4", "2.44949"]
    assert main(["run", "ramp.toml", "--json", "--plot", "a.png"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == [
        {"variable": "ramp.y", "unit": "mm", "final": 4.0, "min": 0.0, "max": 4.0, "rms": pytest.approx(6.0**0.5)}
    ]
    assert captured.err.splitlines()[1:] == ["wrote a.png"]


def test_a_replaced_file_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ramp.toml").write_text(RAMP, encoding="utf-8")
    (tmp_path / "ramp.csv").write_text(LINE, encoding="utf-8")
    for done in ("wrote", "replaced"):
        assert main(["run", "ramp.toml", "-o", "a.csv", "--plot", "a.png"]) == 0
        written = f"{done} a.csv: 1 variable, 5 time points (0 to 4 s)", f"{done} a.png"
        assert tuple(capsys.readouterr().out.splitlines()) == written


def test_folders_and_fmus_have_a_default_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(System, "to_fmu", lambda _, path, **__: Path(path).touch())
    assert main(["compose", str(STICK_SLIP)]) == 0
    assert capsys.readouterr().out == "stick_slip.fmu\n"
    assert main(["codegen", "CoulombFeedforward"]) == 0  # two laws do not collide in one program
    first = capsys.readouterr().out.splitlines()[0]
    assert first == str(Path("CoulombFeedforward", "coulomb_feedforward.h"))
    assert {path.name for path in tmp_path.iterdir()} == {"stick_slip.fmu", "CoulombFeedforward"}


def test_the_text_of_an_error_can_be_saved_as_it_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message for a log file whose headings say too little ends with a file to complete."""
    (tmp_path / "log.csv").write_text("Zeit,Weg\n0,0\n0.1,1\n0.2,2\n", encoding="utf-8")
    text = fails(capsys, "study", tmp_path / "log.csv")
    assert tomllib.loads(text[text.index("[data]") :])["data"] == {"file": "log.csv"}


@pytest.mark.parametrize(
    ("command", "hint"),
    [
        (("lst",), "there is no command 'lst' (did you mean list?)"),
        (("run", "x.toml", "--stpo", "3"), "there is no option --stpo (did you mean --stop?)"),
        (("list", "observr"), "there is no kind 'observr' (did you mean observer?)"),
        (("list", "--serach", "bristle"), "there is no option --serach (did you mean --search?)"),
        (("--vresion",), "there is no option --vresion (did you mean --version?)"),
    ],
)
def test_a_misspelt_word_is_corrected(command: tuple[str, ...], hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(command)
    assert end.value.code == 2
    assert hint in capsys.readouterr().err


def test_help_is_a_command_too(capsys: pytest.CaptureFixture[str]) -> None:
    for words, shown in ((["help", "run"], "--record"), (["help"], "Exit status: 0 success"), ([], "Exit status: 0")):
        with pytest.raises(SystemExit) as end:
            main(words)
        assert not end.value.code
        assert shown in capsys.readouterr().out


def test_a_shell_completes_commands_and_blocks(tmp_path: Path) -> None:
    pytest.importorskip("argcomplete")
    for line, expected in (("friction-fmus compo", "compose"), ("friction-fmus show LuGreF", "LuGreFeedforward")):
        asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\013"}
        program = "from friction_fmus.cli.main import main; main()"
        environment = os.environ | asked | {"_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "out")}
        subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=60)
        assert [word.strip() for word in (tmp_path / "out").read_text().split("\013")] == [expected]


@landing
def test_start_values_have_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.002 kN are 2 N, 0.01 N.s/mm are 10 N.s/m; a length is no force."""
    assert main(["build", "LuGre", "-o", str(tmp_path), "--set", "Fc=0.002 kN", "--set", "Fs=2.5N"]) == 0
    starts = {name: variable.start for name, variable in open_archive(tmp_path / "LuGre.fmu").variables.items()}
    assert (float(starts["Fc"]), float(starts["Fs"])) == (2.0, 2.5)
    capsys.readouterr()
    assert "[mm] but has the unit [N]" in fails(capsys, "build", "LuGre", "-o", tmp_path, "--set", "Fc=2 mm")
    files = export_law("CoulombFeedforward", tmp_path / "c", start={"Fc": "0.002 kN"})
    assert "2.0" in next(path for path in files if path.suffix == ".c").read_text("utf-8")
    with System.from_toml(STICK_SLIP, resolve=fmu) as system:
        changed = system.with_start({"friction.Fc": "0.002 kN", "mass.k": "1 N/mm"})
        assert (changed.start["friction.Fc"], changed.start["mass.k"]) == (2.0, 1000.0)
        with pytest.raises(UnitError, match=r"friction\.Fc is given in"):
            system.with_start({"friction.Fc": "2 mm"})


def test_stages_are_printed_where_there_is_no_terminal() -> None:
    with progress_bar() as bar:
        bar.console.file = io.StringIO()
        shown = RunBar(bar, "study", {0.0: "reading", 0.4: "fitting"})
        for done in (0, 10, 40, 41):
            shown.update(done, 100)
    assert bar.console.file.getvalue() == "reading\nfitting\n"


def test_show_prints_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "LuGre", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert (shown["name"], shown["kind"]) == ("LuGre", "friction")
    assert {"name": "v", "unit": "m/s"}.items() <= shown["variables"]["Inputs"][0].items()


def test_codegen_of_a_friction_model_names_its_compensators(capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean LuGreFeedforward or LuGreObserver?" in fails(capsys, "codegen", "LuGre")


@pytest.mark.parametrize("suffix", [".nc", ".mat"])
def test_run_writes_what_it_also_writes_as_parquet(suffix: str, tmp_path: Path) -> None:
    for path in (tmp_path / "a.parquet", tmp_path / f"a{suffix}"):
        assert main(["run", str(STICK_SLIP), "--stop", "0.05", "-o", str(path)]) == 0
    assert load_result(tmp_path / f"a{suffix}").identical(load_result(tmp_path / "a.parquet"))


def test_run_goes_on_from_a_checkpoint_with_parameters_and_an_archive(tmp_path: Path) -> None:
    """A run in two parts of an .ssp archive, with a parameter set and a value: the same as in one part of the .toml."""
    write_ssv(ParameterSet("soft", {"friction.sigma0": Parameter(20.0, "N/mm")}), tmp_path / "soft.ssv")
    with System.from_toml(STICK_SLIP, resolve=fmu) as system:
        system.to_ssp(tmp_path / "system.ssp")
    options = ["--parameters", str(tmp_path / "soft.ssv"), "--set", "mass.k=3", "--record", "mass.*"]
    whole, first, second = (str(tmp_path / f"{name}.parquet") for name in ("whole", "first", "second"))
    state, archive = str(tmp_path / "state"), str(tmp_path / "system.ssp")
    assert main(["run", str(STICK_SLIP), "--stop", "0.2", "-o", whole, *options]) == 0
    assert main(["run", archive, "--stop", "0.1", "-o", first, "--checkpoint", state, *options]) == 0
    assert main(["run", archive, "--stop", "0.2", "-o", second, "--resume", state, "--pace", "10", *options]) == 0
    frames = [pd.read_parquet(path) for path in (whole, first, second)]
    assert {name.partition(".")[0] for name in frames[0]} == {"time", "mass"}
    assert (pd.concat([frames[1], frames[2].iloc[1:]]).to_numpy() == frames[0].to_numpy()).all()
    with System.from_toml(STICK_SLIP, resolve=fmu) as system:
        soft = system.with_start({"friction.sigma0": 2e4, "mass.k": 3.0}).run(stop=0.2)
    assert (soft["mass.x"].to_numpy() == frames[0]["mass.x"].to_numpy()).all()


def test_ctrl_c_keeps_what_was_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def press(_bar: RunBar, done: int, _total: int) -> None:
        if done:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(RunBar, "update", press)
    path = tmp_path / "a.parquet"
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where a shell runs this behind its back
    try:
        assert main(["run", str(STICK_SLIP), "-o", str(path), "--stop", "60"]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert "friction-fmus: interrupted; the incomplete result is in " in capsys.readouterr().err
    result = load_result(path)
    assert result.attrs["incomplete"] == "interrupted"
    assert 1 < len(result["time"]) < 4000


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_help_of_run_and_sweep_names_every_master(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    *others, last = masters()
    assert f"--master NAME master algorithm: {', '.join(others)} or {last}" in shown
    assert "Raises" not in shown


def test_help_of_run_names_every_format(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    assert "result file: .csv, .parquet, .nc or .mat" in " ".join(capsys.readouterr().out.split())


def test_unknown_model_suggests_the_nearest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean LuGre?" in fails(capsys, "build", "lugree", "-o", tmp_path / "new")
    assert "did you mean" not in fails(capsys, "build", "Nope", "-o", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_unknown_variable_suggests_the_nearest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean sigma" in fails(capsys, "build", "LuGre", "-o", tmp_path / "new", "--set", "sigma=1")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("value", ["Fc=-1", "Fc=nan", "Fc=inf", "Fc", "Fc=two"])
def test_bad_start_value_is_refused(value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fails(capsys, "build", "LuGre", "-o", tmp_path / "new", "--set", value)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("block", "values", "Fn"),
    some(
        [
            (block, values, Fn)
            for block in ("LuGre", "StaticFeedforward")
            for values, Fn in ((("Fn0=50",), 50.0), (("Fn0=0.05 kN",), 50.0), (("Fn0=50", "Fn=20"), 20.0))
        ],
        [("LuGre", ("Fn0=0.05 kN",), 50.0), ("StaticFeedforward", ("Fn0=50", "Fn=20"), 20.0)],
    ),
)
def test_the_normal_force_begins_with_that_of_the_parameters(
    tmp_path: Path, block: str, values: tuple[str, ...], Fn: float
) -> None:
    """Left unconnected, an FMU has the friction of its parameters."""
    arguments = [argument for value in values for argument in ("--set", value)]
    assert main(["build", block, "-o", str(tmp_path), *arguments]) == 0
    variables = read_model_description(str(tmp_path / f"{block}.fmu")).modelVariables
    assert [float(v.start) for v in variables if v.name == "Fn"] == [Fn]


@pytest.mark.parametrize(
    ("block", "values", "relation"),
    [
        ("Actuator", ("F_min=10", "F_max=5"), "F_min <= F_max"),
        ("PID", ("u_min=5", "u_max=1"), "u_min <= u_max"),
        ("BlimanSorine", ("f2=3",), "f2 <= f1"),
    ],
)
def test_build_refuses_start_values_that_a_run_would_refuse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], block: str, values: tuple[str, ...], relation: str
) -> None:
    arguments = (argument for value in values for argument in ("--set", value))
    said = fails(capsys, "build", block, "-o", tmp_path / "new", *arguments)
    assert f"The start values of {block} violate {relation}" in said
    assert not (tmp_path / "new").exists()


def test_name_that_is_no_identifier_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "3 bad" in fails(capsys, "build", "LuGre", "-o", tmp_path, "--name", "3 bad")


def test_build_needs_names_or_all(capsys: pytest.CaptureFixture[str]) -> None:
    fails(capsys, "build")
    fails(capsys, "build", "LuGre", "--all")
    fails(capsys, "build", "LuGre", "Mass", "--set", "Fc=1")


@pytest.mark.parametrize(
    "options", [("--step", "0"), ("--step", "-1"), ("--stop", "nan"), ("--master", "newtonn")], ids=" ".join
)
def test_bad_run_options_leave_no_file(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fails(capsys, "run", STICK_SLIP, "-o", tmp_path / "a.csv", *options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        ("build", "LuGre"),
        pytest.param(("build", "LuGre", "--fmi", "3"), marks=nightly),
        pytest.param(("codegen", "LuGreFeedforward"), marks=nightly),
        pytest.param(("sweep", STICK_SLIP, "--vary", "friction.Fc=1:2:2"), marks=nightly),
    ],
)
def test_a_folder_that_cannot_be_made_is_named(
    command: tuple[object, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("kept")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        error = fails(capsys, *command, "-o", folder)
        assert f"cannot make the folder {folder}: " in error
        assert "Errno" not in error
    assert (tmp_path / "file").read_text() == "kept"


def test_missing_system_file_and_unknown_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "nowhere.toml" in fails(capsys, "run", tmp_path / "nowhere.toml", "-o", tmp_path / "a.csv")
    formats = ".csv, .parquet, .nc or .mat"
    assert formats in fails(capsys, "run", STICK_SLIP, "-o", tmp_path / "a.xls")
    assert ".png" in fails(capsys, "run", STICK_SLIP, "-o", tmp_path / "a.csv", "--plot", tmp_path / "a.doc")


def test_check_names_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    no_zip, sneaky = tmp_path / "text.fmu", tmp_path / "sneaky.fmu"
    no_zip.write_text("this is no archive")
    with zipfile.ZipFile(sneaky, "w") as archive:
        archive.writestr("../evil", "x")
    for path, text in ((no_zip, "not a zip"), (sneaky, "../evil")):
        assert main(["check", str(path)]) == 1
        assert text in capsys.readouterr().out
    assert not (tmp_path.parent / "evil").exists()
    assert "No such file" in fails(capsys, "check", tmp_path / "none.fmu")


def test_debug_shows_the_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "friction_fmus", "--debug", "build", "lugree", "-o", str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert "Traceback" in run.stderr


def test_a_compiler_that_does_not_run_is_named(tmp_path: Path) -> None:
    environment = os.environ | {"CC": "no-such-compiler", "FRICTION_FMUS_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-m", "friction_fmus", "build", "LuGre", "-o", str(tmp_path / "out")]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert run.returncode == 2
    assert "no-such-compiler" in run.stderr
    assert not (tmp_path / "out").exists()


def test_help_of_every_command_says_what_it_does() -> None:
    text = parser().format_help()
    for name in ("list", "show", "build", "check", "run", "study"):
        assert f"    {name} " in text


def test_a_new_command_is_one_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "greet.py").write_text(
        '"""Say hello.\n\nTo anyone.\n"""\n\n'
        "def add_arguments(parser):\n    parser.add_argument('name')\n\n"
        "def run(options):\n    print(f'hello {options.name}')\n    return 3\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(commands, "__path__", [*commands.__path__, str(tmp_path)])
    assert re.search(r"^ +greet +say hello$", parser().format_help(), re.M)
    assert main(["greet", "world"]) == 3
    assert capsys.readouterr().out == "hello world\n"


def test_a_result_reported_as_wrong_has_the_status_1_unless_that_is_allowed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Mass on LuGre over the first 10 ms: held values are stable to 3.9 ms, and wrong while it breaks loose."""
    run = ["run", str(STICK_SLIP), "--stop", "0.01", "-o", str(tmp_path / "out.csv")]
    assert main(run) == 1
    assert "the result is wrong" in caplog.text
    assert load_result(tmp_path / "out.csv").sizes["time"] == 11
    assert main([*run, "--allow-inaccurate"]) == 0
    caplog.clear()
    assert main([*run, "--master", "newton"]) == 0
    assert caplog.text == ""


def test_a_sweep_with_a_result_reported_as_wrong_has_the_status_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = ["sweep", str(STICK_SLIP), "--stop", "0.01", "--executor", "serial", "--vary", "master=gauss-seidel,newton"]
    assert main([*sweep, "-o", str(tmp_path / "a")]) == 1
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"{tmp_path / 'a'}: 2 runs, 1 with warnings, 1 of them reported as wrong"
    assert main([*sweep, "-o", str(tmp_path / "b"), "--allow-inaccurate"]) == 0
    assert main(["sweep", *sweep[1:-1], "master=newton", "-o", str(tmp_path / "c")]) == 0


@nightly
@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux")
def test_a_file_name_that_is_no_utf_8(tmp_path: Path) -> None:
    path = os.fsencode(tmp_path) + b"/o\xff.csv"
    command = [sys.executable, "-m", "friction_fmus", "run", str(STICK_SLIP), "--stop", "0.1", "-o"]
    run = subprocess.run([*command, path], cwd=ROOT, capture_output=True, check=False)
    assert (run.returncode, run.stderr) == (0, b"")
    assert b"o\\udcff.csv: 3 variables" in run.stdout
