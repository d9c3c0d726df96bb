"""A record with the recommended law against the study, for an axis that is simulated here."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from logged_axis import FC, RD, RDD, M, logged

from friction_fmus.__main__ import main
from friction_fmus.axis.servo import Servo
from friction_fmus.blocks.axis_units import ROTARY
from friction_fmus.errors import FrictionError
from friction_fmus.identification import Record
from friction_fmus.study.verification import Verification, verify

KP, KD = 4000.0, 160.0
SERVO = Servo("PID", {"Kp": KP, "Kd": KD, "Ki": 0.0}, 1e-3, 100.0, window=1)
CLAIMED = 0.2 * FC / KP


def compensated(gain: float, Fc: float = FC) -> Record:
    """A record with feedforward of the motion, and of the friction of the study times a gain."""
    inertia = M - 0.5 * KD * 1e-3
    return logged(
        lambda k, e, v, total: KP * e + KD * (RD[k] - v) + inertia * RDD[k] + gain * FC * float(np.sign(RD[k])),
        1,
        Fc=Fc,
    )


def verified(folder: Path, record: Record) -> Verification:
    values = {"M": M, "Fc": FC, "Fv": 0.0, "OF": 0.0}
    parameters = [{"name": name, "value": value} for name, value in values.items()]
    study = {
        "units": {"position": "m"},
        "recommendation": {"name": "StaticFeedforward"},
        "compensators": [{"name": "StaticFeedforward", "metrics": {"rms": CLAIMED}}],
        "models": [{"name": "Coulomb + viscous", "parameters": parameters}],
    }
    (folder / "study.json").write_text(json.dumps(study), encoding="utf-8")
    return verify(folder, [record], SERVO)


def test_the_axis_of_the_study(tmp_path: Path) -> None:
    found = verified(tmp_path, compensated(1.0))
    assert found.reasons == ()
    assert found.came_true


def test_friction_that_is_30_percent_lower(tmp_path: Path) -> None:
    """What the compensation gives too much is 30 % of the friction, and so is the error."""
    found = verified(tmp_path, compensated(1.0, 0.7 * FC))
    (reason,) = found.reasons
    assert reason.startswith("Coulomb friction is 30 % lower than in the study: 4.2")
    assert not found.came_true
    assert found.measured == pytest.approx(0.3 * FC / KP, rel=0.15)


def test_a_compensation_of_the_wrong_sign(tmp_path: Path) -> None:
    found = verified(tmp_path, compensated(-1.0))
    (reason,) = found.reasons
    assert "wrong sign" in reason
    part = float(reason.split("against ")[1].split(" times")[0])
    assert part == pytest.approx(2.0, abs=0.4)  # twice the friction; a part goes to the speed, which lags with it
    assert "wrong sign" in reason


def test_a_compensation_that_is_switched_off(tmp_path: Path) -> None:
    (reason,) = verified(tmp_path, compensated(0.0)).reasons
    assert "does not act" in reason


def test_a_folder_without_a_study_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FrictionError, match="has no study"):
        verify(tmp_path, [compensated(1.0)], SERVO)


def write(path: Path, record: Record) -> None:
    columns = np.column_stack([record.t, record.column("q"), record.column("reference"), record.column("force")])
    np.savetxt(path, columns, "%.9g", ",", header="time [s],position [m],reference [m],force [N]", comments="")


@pytest.mark.parametrize("what", ["demo", "emps"])
def test_a_study_of_a_record_of_the_package(tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    verified(tmp_path, compensated(1.0))
    write(tmp_path / "after.csv", compensated(1.0))
    assert main(["study", what, "--verify", str(tmp_path / "after.csv"), "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"StaticFeedforward: {1e6 * CLAIMED:.3g} µm rms claimed, ")
    assert "%). The claim came true.\n" in printed


@pytest.mark.parametrize("what", ["demo", "my.csv", "axis.toml"])
def test_a_missing_record_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "my.csv", compensated(0.0))
    (tmp_path / "axis.toml").write_text('[data]\nfile = "my.csv"\n', encoding="utf-8")
    assert main(["study", what, "--verify", "nothing.csv"]) == 2
    assert capsys.readouterr().err == "friction-fmus: There is no data file nothing.csv; correct the path.\n"


def test_a_record_of_a_rotary_axis_is_no_record_of_a_linear_one(tmp_path: Path) -> None:
    verified(tmp_path, compensated(1.0))
    with pytest.raises(FrictionError, match="position in rad, the study in m; correct the units"):
        verify(tmp_path, [replace(compensated(1.0), units=ROTARY)], SERVO)
