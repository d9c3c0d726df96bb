"""Viscous friction beside models that have none: identified, in the closed loop, and written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from contacts import dahl_force, noise
from thorough import landing, nightly

from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.cli.main import main
from friction_fmus.identification import LINEAR, FitError, Record, identifiable, identify
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.study.data import build_reference
from friction_fmus.study.evaluation import off_by
from harness import read_ssv

TS = 1e-3
T = TS * np.arange(6000)
TRUE = {"M": 5.0, "OF": 0.5, "Fc": 6.0, "sigma": 2e4, "Fv": 80.0}


def record(sigma: float = TRUE["sigma"]) -> Record:
    """A mass on a Dahl contact with n = 1, in closed form along the path, and viscous friction beside it."""
    q = 0.02 * np.sin(2.0 * np.pi * 0.5 * T) * (0.4 + 0.1 * T)
    v = np.gradient(q, TS)
    force = TRUE["M"] * np.gradient(v, TS) + TRUE["Fv"] * v + TRUE["OF"] + noise(4, len(T), 0.05)
    return Record("Dahl", T, q=q, force=force + dahl_force(q, sigma, TRUE["Fc"]))


@landing
def test_both_parts_are_identified() -> None:
    train, validation = record().window(0.0, 4.0), record().window(4.0, 6.0)
    alone = identify("Dahl", train, validation=validation, fixed={"n": 1.0})
    both = identify("Dahl", train, validation=validation, fixed={"n": 1.0}, viscous=True)
    for name, value in TRUE.items():
        assert both.parameters[name].value == pytest.approx(value, rel=0.04), name
    assert both.parameters["Fv"].unit == "N.s/m"
    assert both.validation is not None
    assert alone.validation is not None
    assert both.validation.rms < 0.2 * alone.validation.rms
    free = both.predict(replace(validation, force=None))
    assert np.sqrt(np.mean(np.square(free - validation.column("force"))[200:])) < 0.3


def test_a_known_coefficient_stays_and_others_have_none() -> None:
    train = record().window(0.0, 2.0)
    assert identify("Dahl", train, fixed={"n": 1.0, "Fv": 80.0}, viscous=True).values()["Fv"] == 80.0
    assert "Fv" not in identify("LuGre", train, viscous=True, starts=1).parameters
    with pytest.raises(FitError, match="not a parameter of Dahl"):
        identify("Dahl", train, fixed={"Fv": 80.0})


@nightly
def test_models_with_elements_have_it_too() -> None:
    result = identify("MaxwellSlip", record().window(0.0, 4.0), viscous=True)
    assert result.parameters["Fv"].value == pytest.approx(TRUE["Fv"], rel=0.05)


def test_the_models_without_viscous_friction() -> None:
    lacking = {name for name in identifiable() if contact_model(name, LINEAR).lacks_viscous}
    assert lacking == {"BlimanSorine", "Coulomb", "Dahl", "MaxwellSlip", "ResetIntegrator"}


@nightly
def test_coulomb_with_a_viscous_part_moves_like_stiction(tmp_path: Path) -> None:
    """With Fs = Fc and its own Fv, Stiction is the same axis; a mismatch of friction scales both parts."""
    t = 1e-3 * np.arange(601.0)
    reference = build_reference(t, 4e-3 * (1.0 - np.cos(2.0 * np.pi * t)), tmp_path, "Reference")
    servo = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, 1e-3, 20.0)
    paths = []
    for friction, values in (("Coulomb", {"Fc": 1.0, "Fv": 9.0}), ("Stiction", {"Fc": 1.0, "Fs": 1.0, "Fv": 9.0})):
        with closed_loop(servo, AxisPlant(friction, values, 1.0), Trajectory(reference, len(t), 0.0, 0.0)) as system:
            paths.append(run_loop(system).q)
            if friction == "Coulomb":
                assert off_by(system, 1.1, 1.0) == pytest.approx({"friction.Fc": 1.1, "axis.d": 9.9, "axis.m": 1.0})
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-6)


@nightly
def test_the_command_writes_it(tmp_path: Path) -> None:
    data = record(sigma=1e6)
    table = np.column_stack([data.t, data.column("q"), data.column("force")])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t [s],x [m],F [N]", comments="", fmt="%.9g")
    out = tmp_path / "out"
    assert main(["identify", str(tmp_path / "log.csv"), "--model", "Dahl", "--viscous", "-o", str(out)]) == 0
    (found,) = json.loads((out / "identification.json").read_text(encoding="utf-8"))["models"]
    parameters = read_ssv(out / "DahlViscous.ssv").parameters
    assert parameters["Fv"].value == pytest.approx(found["parameters"]["Fv"]["value"])
    assert parameters["Fv"].value == pytest.approx(TRUE["Fv"], rel=0.1)
