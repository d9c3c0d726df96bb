"""A study from beginning to end as commands, on a simulated axis with an integrator of its own.

The servo is a PD controller: a constant force F that nothing compensates leaves the tracking error F/Kp.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import nightly

sys.path.insert(0, str(Path(__file__).parents[1] / "study"))

from independent_axes import SimulatedAxis, dry
from independent_axis import Law, Reference, exported_law, typical_moves

from friction_fmus.__main__ import main
from friction_fmus.identification import identifiable

M, FC, FV, KP, KD, TS = 2.0, 6.0, 10.0, 2e4, 300.0, 1e-3
SERVO = {"pid": 1.0, "kp": KP, "kv": KD, "limit": 100.0, "quantum": 1e-7}


class ShortLog(SimulatedAxis):
    """An axis of which 8 s are logged."""

    @property
    def reference(self) -> Reference:
        return typical_moves(8.0, self.Ts, *self.moves)


AXIS = ShortLog({"m1": M, **dry(FC, Fv=FV)}, SERVO, current_noise=0.02)
FEEDFORWARD = {"fed_velocity": 1.0, "fed_mass": M - 0.5 * KD * 2.0 * TS, "fed_viscous": FV}
CHOICE = '[identify]\nmodels = ["Coulomb"]\n\n[compensation]\ncompensators = ["StaticFeedforward"]\n'


@dataclass(frozen=True)
class Studied:
    folder: Path
    law: Law  # C code of the recommendation

    def result(self, out: str = "out") -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.folder / out / "study.json").read_text(encoding="utf-8"))
        return found


def write_log(path: Path, axis: SimulatedAxis, law: Law | None = None, **servo: float) -> float:
    """Write the log of a run with units in its headings; return its rms tracking error."""
    run, r = axis.run(law=law, **servo), axis.reference.r
    rows = np.column_stack([TS * np.arange(float(len(r))), run.measured, r, run.command])
    head = "time [s],position [m],reference [m],force [N]"
    np.savetxt(path, rows, ["%.6f", "%.9f", "%.9f", "%.5f"], ",", header=head, comments="")
    return float(np.sqrt(np.mean((r - run.measured) ** 2)))


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> Studied:
    folder = tmp_path_factory.mktemp("axis")
    AXIS.write(folder, "axis")
    settings = (folder / "axis.toml").read_text(encoding="utf-8").partition("[identify]")[0] + CHOICE
    (folder / "axis.toml").write_text(settings, encoding="utf-8")
    assert main(["study", str(folder / "axis.toml"), "-o", str(folder / "out"), "--workers", "1"]) == 0
    return Studied(folder, exported_law(folder / "out" / "recommended" / "c", tmp_path_factory.mktemp("law")))


def verify(studied: Studied, capsys: pytest.CaptureFixture[str], what: str = "axis.toml") -> tuple[int, dict[str, Any]]:
    """Return status and JSON of the command; the columns are named by the headings of the new log."""
    after = str(studied.folder / "after.csv")
    capsys.readouterr()
    columns = "time=1, position=2, reference=3, force=4"
    arguments = [str(studied.folder / what), "--verify", after, "-o", str(studied.folder / "out"), "--columns", columns]
    status = main(["study", *arguments, "--json"])
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return status, found


def test_a_claim_that_comes_true(studied: Studied, capsys: pytest.CaptureFixture[str]) -> None:
    measured = write_log(studied.folder / "after.csv", AXIS, studied.law)
    status, found = verify(studied, capsys)
    assert (status, found["came_true"], found["reasons"]) == (0, True, [])
    assert found["measured"] == pytest.approx(measured, rel=1e-3)
    assert found["claimed"] == pytest.approx(measured, rel=0.15)


def test_friction_that_is_30_percent_lower(studied: Studied, capsys: pytest.CaptureFixture[str]) -> None:
    axis = replace(AXIS, axis={"m1": M, **dry(0.7 * FC, Fv=FV)})
    write_log(studied.folder / "after.csv", axis, studied.law)
    status, found = verify(studied, capsys)
    assert (status, found["came_true"]) == (1, False)
    assert found["measured"] == pytest.approx(0.3 * FC / KP, rel=0.15)
    (reason,) = found["reasons"]
    assert reason.startswith("Coulomb friction is 30 % lower than in the study: 4.2")


def test_a_compensation_of_the_wrong_sign(studied: Studied, capsys: pytest.CaptureFixture[str]) -> None:
    write_log(studied.folder / "after.csv", AXIS, None, **FEEDFORWARD, fed_coulomb=-FC)
    status, found = verify(studied, capsys)
    assert (status, found["came_true"]) == (1, False)
    assert found["measured"] == pytest.approx(2.0 * FC / KP, rel=0.15)
    (reason,) = found["reasons"]
    assert "wrong sign" in reason


def test_a_log_without_settings_from_beginning_to_end(
    studied: Studied, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The controller is estimated from the log; the settings that the study writes serve the verification."""
    write_log(tmp_path / "log.csv", AXIS)
    out = ["-o", str(tmp_path / "out")]
    assert main(["study", str(tmp_path / "log.csv"), *out, "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    assert "servo-estimated" in printed
    own = Studied(tmp_path, exported_law(tmp_path / "out" / "recommended" / "c", tmp_path))
    study = own.result()
    (finding,) = (each["what"] for each in study["findings"] if each["name"] == "servo-estimated")
    assert f"CascadePPI with kp = {KP / KD:.4g}, kv = {KD:g}, velocity over 2 samples" in finding  # the same law
    measured = write_log(tmp_path / "after.csv", AXIS, own.law)
    verdict = main(["study", str(tmp_path / "log.csv"), "--verify", str(tmp_path / "after.csv"), *out])
    printed = capsys.readouterr().out
    assert ("The claim came true" in printed) == (verdict == 0)
    assert f"{1e6 * measured:.3g} µm rms measured" in printed
    before = next(row for row in study["compensators"] if row["name"] == "none")["metrics"]["rms"]
    assert measured < 0.1 * before
    write_log(tmp_path / "after.csv", AXIS, None, **FEEDFORWARD, fed_coulomb=-FC)
    status, found = verify(own, capsys, "log.csv")  # with the servo that was estimated
    assert status == 1
    assert "wrong sign" in " ".join(found["reasons"])


@nightly
def test_all_models_and_laws(studied: Studied) -> None:
    rows = (studied.folder / "log.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (studied.folder / "short.csv").write_text("".join(rows[:3001]), encoding="utf-8")
    text = (studied.folder / "axis.toml").read_text(encoding="utf-8").replace("log.csv", "short.csv")
    (studied.folder / "short.toml").write_text(f"{text}delays = []\nmismatch = 0.0\n", encoding="utf-8")
    worst = []
    for out, more in (("fast", []), ("full", ["--full"])):
        folder = str(studied.folder / out)
        assert main(["study", str(studied.folder / "short.toml"), "-o", folder, "--workers", "2", *more]) == 0
        found = studied.result(out)
        recommended = found["recommendation"]["name"]
        worst.append(next(row["worst"] for row in found["compensators"] if row["name"] == recommended))
    assert {row["name"] for row in found["models"]} >= set(identifiable())
    assert len(found["compensators"]) > 20
    assert worst[1] <= 1.05 * worst[0]  # errors within 5 % are equivalent
