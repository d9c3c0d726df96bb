"""A study of a data file without settings, and the file of settings that it or ``--init`` writes."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from thorough import landing, nightly

from friction_fmus.__main__ import main
from friction_fmus.axis.servo import Servo
from friction_fmus.identification import RecordError, read_measurement
from friction_fmus.study import ConfigError, load_config, run_study
from friction_fmus.study.data import load_data
from friction_fmus.study.settings_file import SETTINGS_FILE

M, FC, FV = 3.0, 5.0, 12.0
T = np.arange(4000) * 1e-3
PHASE = 2 * np.pi * (0.5 * T + 0.2 * T**2)
X = 0.05 * np.sin(PHASE)
V = np.gradient(X, T)
F = M * np.gradient(V, T) + FC * np.sign(V) + FV * V


def log(folder: Path, heading: str = "t [s];ActPos [mm];Kraft [N]") -> Path:
    rows = [f"{t:.3f};{1e3 * x:.9g};{f:.9g}" for t, x, f in zip(T, X, F, strict=True)]
    path = folder / "my.csv"
    path.write_text("\n".join([heading, *rows]) + "\n", encoding="utf-8")
    return path


@nightly
def test_a_data_file_is_enough_and_the_settings_repeat_the_study(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["study", "my.csv", "--workers", "1"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "Settings; add the controller to [servo] there to compare compensators: out/study.toml" in printed
    assert "add [servo] with law, gains, Ts and force_limit to study.toml" in printed  # the mass is identified
    assert "force residual, validation data" in " ".join(re.sub(r"model|poorly", "", printed).split())
    written = tmp_path / "out" / SETTINGS_FILE
    assert load_config(written).servo is None
    again = run_study(written, tmp_path / "again", processes=1)
    first = (tmp_path / "out" / "study.json").read_text(encoding="utf-8")
    best = again.models[0]
    found = {parameter.name: parameter.value for parameter in best.parameters}
    assert found["M"] == pytest.approx(M, rel=0.01)
    assert found["Fc"] == pytest.approx(FC, rel=0.02)
    assert f'"value": {best.parameters[0].value!r}' in first.replace("\n", " ")
    assert again.overview["training data"] == "0 to 2.399 s"
    # the same file serves the other command, with the same data
    assert main(["identify", str(written), "-o", "identified", "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    assert "training data 0 to 2.399 s" in printed
    assert "validation data 2.4" in printed
    written_fmus = {path.name for path in (tmp_path / "identified").glob("*.fmu")}
    assert written_fmus == {"Coulomb.fmu", "LuGre.fmu", "Stribeck.fmu"}


@landing
def test_settings_that_were_edited_are_kept(tmp_path: Path) -> None:
    data = log(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / SETTINGS_FILE).write_text("# mine\n", encoding="utf-8")
    run_study(data, tmp_path / "out", processes=1)
    assert (tmp_path / "out" / SETTINGS_FILE).read_text(encoding="utf-8") == "# mine\n"


@landing
def test_a_file_without_units_is_studied_in_its_numbers(tmp_path: Path) -> None:
    log(tmp_path, "t;pos;drive")
    columns = """[data]
file = "my.csv"
[columns]
time = { column = "t", unit = "s" }
position = { column = "pos", unit = "1", gain = "unknown" }
force = { column = "drive", unit = "1", gain = "unknown" }
[identify]
models = ["Coulomb"]
"""
    (tmp_path / "a.toml").write_text(columns, encoding="utf-8")
    found = {
        each.name: each.value for each in run_study(tmp_path / "a.toml", tmp_path, processes=1).models[0].parameters
    }
    assert found["M"] == pytest.approx(1e-3 * M, rel=0.02)  # the positions are numbers of mm
    assert found["Fc"] == pytest.approx(FC, rel=0.05)
    assert found["Fv"] == pytest.approx(1e-3 * FV, rel=0.1)
    assert (tmp_path / "report.html").exists()


def test_a_piece_that_is_too_short_does_not_end_a_study(tmp_path: Path) -> None:
    """80 samples before a gap are enough for a segment, but not for the filter of the force."""
    lines = log(tmp_path).read_text(encoding="utf-8").splitlines()
    del lines[81:181]
    (tmp_path / "my.csv").write_text("\n".join(lines), encoding="utf-8")
    data = load_data(load_config(tmp_path / "my.csv"), tmp_path)
    assert [len(record) for record in data.records] == [80, 3820]
    (train,) = data.train
    assert train.t[0] == pytest.approx(0.18)


def test_a_study_of_ambiguous_headings_names_the_command_that_asks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = log(tmp_path, "t [s];X ActPos [mm];Y ActPos [mm]")
    assert main(["study", str(data), "-o", str(tmp_path / "out")]) == 2
    refusal = capsys.readouterr().err
    assert "friction-fmus study --init my.csv, which asks" in refusal
    assert "\n    friction-fmus study my.csv --columns " in refusal


def test_the_servo_is_added_by_removing_the_marks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    log(tmp_path)
    assert main(["study", "--init", "my.csv"]) == 0
    text = (tmp_path / SETTINGS_FILE).read_text(encoding="utf-8")
    head, _, servo = text.partition("# [servo]")
    keys = [line.removeprefix("# ") for line in servo.splitlines()[1:10]]
    complete = "\n".join([head, "[servo]", *(line for line in keys if "=" in line)]).replace('"?"', "40.0")
    (tmp_path / "complete.toml").write_text(complete, encoding="utf-8")
    gains = {"kp": 40.0, "kv": 40.0, "ki": 0.0}
    quantum = load_config(tmp_path / "complete.toml").servo
    assert quantum is not None
    assert quantum == Servo("CascadePPI", gains, 1e-3, 40.0, window=2, quantum=quantum.quantum)
    assert read_measurement(tmp_path / "complete.toml").mapping.windows["train"] == pytest.approx((0.0, 2.3994))


def test_without_a_terminal_the_missing_entries_are_marked_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log(tmp_path, "t;ActPos [mm];u")
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert main(["study", "--init", str(tmp_path / "my.csv"), "-o", str(tmp_path / "new")]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "missing: the time ('t' has no unit)" in printed
    assert "missing: the force (no heading is recognised as force or friction)" in printed
    assert "missing: the controller" in printed
    text = (tmp_path / "new" / SETTINGS_FILE).read_text(encoding="utf-8")
    assert 'file = "../my.csv"' in text
    assert 'time = { column = "t", unit = "?" }' in text
    assert 'position = { column = "ActPos", unit = "mm" }' in text
    with pytest.raises(RecordError, match=r"\[columns\], time, has a \? for a missing entry; replace it"):
        read_measurement(tmp_path / "new" / SETTINGS_FILE)
    assert main(["study", "--init", str(tmp_path / "my.csv"), "-o", str(tmp_path / "new")]) == 2
    assert "exists; edit it" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def answer(monkeypatch: pytest.MonkeyPatch, answers: list[str]) -> list[str]:
    """Answer the questions in turn, then end the input; return the questions that were asked."""
    asked: list[str] = []

    def reply(question: str) -> str:
        asked.append(question)
        if not answers:
            raise EOFError
        return answers.pop(0)

    monkeypatch.setattr("builtins.input", reply)
    monkeypatch.setattr("sys.stdin", Terminal())
    monkeypatch.setattr("sys.stdout", Terminal())
    return asked


def test_on_a_terminal_the_missing_entries_are_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = log(tmp_path, "t;ActPos [mm];u")
    time = ["", "mm", "", "s"]  # the suggested column; a wrong unit without factor; the right one
    force = ["v", "u", "bananas", "V", "lots", "35.15 N/V"]
    reference = ["none"]
    servo = ["PI", "PID", "1e4", "200", "", "-3", "80"]
    asked = answer(monkeypatch, [*time, *force, *reference, *servo])
    assert main(["study", "--init", str(data), "-o", str(tmp_path)]) == 0
    assert not any("position" in question for question in asked if "reference" not in question)
    config = load_config(tmp_path / SETTINGS_FILE)
    assert config.servo is not None
    assert (config.servo.law, config.servo.gains) == ("PID", {"Kp": 1e4, "Kd": 200.0, "Ki": 0.0})
    assert (config.servo.Ts, config.servo.force_limit) == (1e-3, 80.0)
    (record,) = read_measurement(tmp_path / SETTINGS_FILE).records
    assert record.force == pytest.approx(35.15 * F, rel=1e-6, abs=1e-6)


def test_questions_may_be_left_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = log(tmp_path, "t [s];ActPos [mm];Kraft [N]")
    answer(monkeypatch, ["none", "CascadePPI", "40"])
    assert main(["study", "--init", str(data), "-o", str(tmp_path)]) == 0
    assert load_config(tmp_path / SETTINGS_FILE).servo is None


def test_an_open_gain_is_marked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = log(tmp_path, "t [s];ActPos [mm];Kraft [N]")
    answer(monkeypatch, ["none", "CascadePPI", "40", "", "", "100"])
    assert main(["study", "--init", str(data), "-o", str(tmp_path)]) == 0
    with pytest.raises(ConfigError, match=r"\[servo\], has kv = '\?'; give a number above 0"):
        load_config(tmp_path / SETTINGS_FILE)
