from __future__ import annotations

import json
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import nightly

from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.identification import FitError, Identification, compare_models, identify, read_measurement
from friction_fmus.identification.model_comparison import IdentificationTask, _in_parallel
from harness import open_archive, read_ssv

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "identification"
PAGE = (ROOT / "docs" / "identification.md").read_text(encoding="utf-8")
SCRIPT = runpy.run_path(str(EXAMPLES / "log_file.py"))
TRUE = {**SCRIPT["TRUE"], "M": SCRIPT["M"], "OF": SCRIPT["OF"]}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mapping of the example, with its log file beside it."""
    folder = tmp_path_factory.mktemp("log")
    SCRIPT["main"](folder)
    (folder / "axis.toml").write_bytes((EXAMPLES / "axis.toml").read_bytes())
    return folder / "axis.toml"


@pytest.fixture
def short(log: Path, tmp_path: Path) -> list[str]:
    """Arguments for a part of the log that is quick to fit."""
    return ["identify", str(log), "--train", "0", "3", "--validation", "14", "16.5", "-o", str(tmp_path / "out")]


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """What the commands of the page on identification make: the folder, and what was printed."""
    folder = tmp_path_factory.mktemp("outcome")
    (folder / "examples").symlink_to(ROOT / "examples")
    (commands,) = re.findall(r"<!-- commands -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    printed = ""
    for command in commands.splitlines():
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(
            shlex.split(command),
            cwd=folder,
            env=os.environ | {"PATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}: {done.stderr}"
        printed += done.stdout
    return folder / "axis", printed


@nightly
def test_the_true_parameters_are_found_within_what_the_page_says(outcome: tuple[Path, str]) -> None:
    content = json.loads((outcome[0] / "identification.json").read_text(encoding="utf-8"))
    assert content["ranked_by"] == "validation error"
    best, other = content["models"]
    assert (best["model"], other["model"]) == ("LuGre", "Stribeck")
    assert "Every estimate is within 3 % of them" in PAGE
    for name, true in TRUE.items():
        assert best["parameters"][name]["value"] == pytest.approx(true, rel=0.03), name
    # noise of 0.1 N, of which decimation by 5 and a filter at 0.8 of the new Nyquist frequency leave 0.1 sqrt(0.16) N;
    # beside it the encoder, and reversals between rows that are as far apart as sigma1/sigma0
    for part in ("train", "validation"):
        assert 1.0 < best[part]["rms"] / (0.1 * 0.16**0.5) < 1.5
    assert other["validation"]["relative_percent"] > 10.0
    assert set(other["weak"]) >= {"Fs"}


@nightly
def test_every_model_has_its_files_with_the_parameters_in_them(outcome: tuple[Path, str]) -> None:
    folder, _ = outcome
    made = {"identification.json", "parameters.toml", "comparison.png"}
    made |= {f"{model}.{kind}" for model in ("Stribeck", "LuGre") for kind in ("fmu", "ssv", "png")}
    assert {path.name for path in folder.iterdir()} == made
    (best, _) = json.loads((folder / "identification.json").read_text(encoding="utf-8"))["models"]
    table = tomllib.loads((folder / "parameters.toml").read_text(encoding="utf-8"))
    start = {v.name: v.start for v in open_archive(folder / "LuGre.fmu").variables.values()}
    ssv = read_ssv(folder / "LuGre.ssv").parameters
    for name in SCRIPT["TRUE"]:
        value = best["parameters"][name]["value"]
        assert table["LuGre"][name]["value"] == value
        assert float(start[name]) == pytest.approx(value, rel=1e-12)
        assert ssv[name].value == pytest.approx(value, rel=1e-12)
    for picture in folder.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")


@nightly
def test_the_page_shows_what_the_command_prints(outcome: tuple[Path, str]) -> None:
    folder, printed = outcome
    (shown,) = re.findall(r"<!-- printed -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    as_words = re.compile(r"[-\d][-+.\de]*")  # numbers differ in the last digits from machine to machine
    assert as_words.sub("#", shown).split() == as_words.sub("#", printed).split()
    content = json.loads((folder / "identification.json").read_text(encoding="utf-8"))
    (table,) = re.findall(r"^LuGre\nparameter .*\n((?:\w+ .*\n)+)\n", shown, re.M)
    for line in table.splitlines():
        name, value, *_ = line.split()
        found = content["models"][0]["parameters"][name]
        assert abs(float(value) - found["value"]) < 0.5 * found["standard_error"], name


def test_the_page_shows_the_mapping_of_the_example() -> None:
    (shown,) = re.findall(r"<!-- mapping -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    assert shown == (EXAMPLES / "axis.toml").read_text(encoding="utf-8")


@nightly
@nightly
def test_the_python_of_the_page_prints_what_it_says(outcome: tuple[Path, str]) -> None:
    (program,) = re.findall(r"<!-- python -->\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    folder = outcome[0].parent
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (shown,) = re.findall(r"It prints\n\n```\w+\n(.*?)^```$", PAGE, re.S | re.M)
    assert re.sub(r"[-.\d]+", "#", done.stdout) == re.sub(r"[-.\d]+", "#", shown)


@nightly
def test_without_validation_models_are_ranked_by_bic(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "axis.toml").write_text(
        log.read_text(encoding="utf-8").split("[windows]")[0].replace("axis.csv", str(log.parent / "axis.csv")),
        encoding="utf-8",
    )
    arguments = ["--train", "0", "3", "--model", "Coulomb", "--model", "Viscous", "--workers", "1"]
    assert main(["identify", str(tmp_path / "axis.toml"), *arguments, "-o", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "no validation data, so models are ranked by BIC" in printed
    assert printed.index("Coulomb") < printed.index("Viscous")
    # Coulomb: Fc, Fv, M, OF; and the one line for each finding
    assert "no-presliding The shortest strokes are 40 mm" in printed
    assert json.loads((tmp_path / "out" / "identification.json").read_text())["ranked_by"] == "BIC"


@nightly
def test_a_data_file_may_be_given_with_its_mapping(log: Path, tmp_path: Path) -> None:
    windows = ["--train", "0", "2", "--validation", "14", "15"]
    arguments = [str(log.parent / "axis.csv"), "--mapping", str(log), "--model", "Coulomb", *windows]
    assert main(["identify", *arguments, "-o", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "Coulomb.fmu").is_file()


def failing(model: str, *_: object, **__: object) -> Identification:
    raise FitError(f"{model} does not fit.") if model != "Viscous" else ZeroDivisionError("a bug")


def test_a_model_that_fails_is_named_and_the_others_go_on(
    short: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def some(model: str, *data: Any, **options: Any) -> Identification:
        return identify(model, *data, **options) if model == "Coulomb" else failing(model)

    monkeypatch.setattr("friction_fmus.identification.model_comparison.identify", some)
    models = ["--model", "Dahl", "--model", "Viscous", "--model", "Coulomb", "--workers", "1"]
    assert main([*short, *models]) == 0
    printed = capsys.readouterr().out
    assert "Dahl was not identified: Dahl does not fit." in printed
    assert "Viscous was not identified: ZeroDivisionError: a bug" in printed
    content = json.loads((tmp_path / "out" / "identification.json").read_text(encoding="utf-8"))
    assert list(content["failed"]) == ["Dahl", "Viscous"]
    assert not (tmp_path / "out" / "Dahl.fmu").exists()


def test_a_process_that_dies_is_a_reason_too(log: Path) -> None:
    class Dying:
        def submit(self, *_: object) -> Future[object]:
            future: Future[object] = Future()
            future.set_exception(BrokenProcessPool("gone"))
            return future

    task = IdentificationTask(read_measurement(log).window(0.0, 3.0))
    found: dict[str, Identification | str] = {}
    _in_parallel(Dying(), ["Dahl", "Coulomb", "LuGre"], task, found.__setitem__)
    assert next(iter(found)) == "Coulomb" and isinstance(found["Coulomb"], Identification)  # while workers start
    assert set(found) == {"Dahl", "Coulomb", "LuGre"}
    assert "a worker process died" in str(found["Dahl"])


def test_nothing_is_written_if_no_model_can_be_identified(
    short: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("friction_fmus.identification.model_comparison.identify", failing)
    assert main([*short, "--model", "Dahl", "--model", "LuGre", "--workers", "1"]) == 2
    assert "No model could be identified (Dahl: Dahl does not fit.; LuGre: " in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_nothing_is_written_if_a_file_cannot_be(
    short: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("kept")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(Identification, "plot", full)
    assert main([*short, "--model", "Coulomb", "--workers", "1"]) == 2
    assert "no space left" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["mine.txt"]


def test_all_means_every_model_that_can_be_identified(short: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def note(model: str, *_: object, **__: object) -> Identification:
        asked.append(model)
        raise FitError("not now")

    monkeypatch.setattr("friction_fmus.identification.model_comparison.identify", note)
    assert main([*short, "--model", "all", "--workers", "1"]) == 2
    assert {"Coulomb", "Stribeck", "Dahl", "LuGre", "ElastoPlastic", "MaxwellSlip", "GMS"} <= set(asked)
    assert set(asked) <= set(catalogue())
    assert len(asked) == len(set(asked))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--model", "Lugre"], "LuGre"),
        (["--model", "all", "--model", "Dahl"], "selects every model"),
        (["--model", "Dahl", "--fixed", "Fc"], "--fixed 'Fc' is not NAME=VALUE"),
        (["--model", "Dahl", "--fixed", "Fc=inf"], "is not finite"),
        (["--model", "Dahl", "--fixed", "sigma0=1e5"], "None of the models has the parameter 'sigma0'"),
        (["--model", "Dahl", "--train", "5", "4"], "the earlier one first"),
        (["--model", "Dahl", "--train", "0", "15", "--validation", "14", "16"], "overlapping windows"),
        (
            ["--model", "Dahl", "--train", "50", "60", "--validation", "14", "16"],
            "The window 50 .. 60 s has fewer than",
        ),
        (["--model", "PID"], "PID cannot be identified"),
    ],
)
def test_wrong_arguments_are_refused_with_a_sentence(
    short: list[str], tmp_path: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*short, *arguments, "--workers", "1"]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert not (tmp_path / "out").exists()


def test_a_survey_from_python_is_ranked(log: Path) -> None:
    measurement = read_measurement(log)
    task = IdentificationTask(measurement.window(0.0, 3.0), measurement.window(14.0, 16.5), {"M": 20.0})
    told: list[tuple[int, int]] = []
    found = compare_models(["Viscous", "Coulomb"], task, progress=lambda done, total: told.append((done, total)))
    assert [result.model for result in found.results] == ["Coulomb", "Viscous"]
    assert found.results[0].fixed["M"] == 20.0
    assert told == [(1, 2), (2, 2)]
    assert np.isfinite(found.results[0].bic)


def test_a_file_is_no_folder_for_results(short: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    short[-1] = short[1]
    assert main([*short, "--model", "Coulomb"]) == 2
    assert "is a file; choose a folder for the results" in capsys.readouterr().err
