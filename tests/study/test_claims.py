"""Which studies say that their tracking errors cannot be claimed for the machine."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.axis.servo import AxisPlant, FlexibleLoad, Servo, Trajectory
from friction_fmus.identification import LINEAR, Record
from friction_fmus.study.evaluation import AxisBench
from friction_fmus.study.model_ranking import IdentifiedModel, without_unknown_static_friction
from friction_fmus.study.study_result import Fit, IdentifiedParameter, ModelResult
from friction_fmus.study.trust import (
    bias_findings,
    claim_findings,
    force_findings,
    model_error,
    static_friction_findings,
)

SERVO = Servo("PID", {"Kp": 8000.0, "Kd": 160.0, "Ki": 0.0}, 1e-3, 50.0)
BENCH = AxisBench(SERVO, AxisPlant("Coulomb", {"Fc": 6.0}, 2.0), Trajectory(Path(), 10, 0.0, 0.0), np.zeros(10))
NATURAL = sqrt(8000.0 / 2.0) / (2.0 * pi)


def test_a_wide_band_and_no_finding_is_a_claim() -> None:
    assert claim_findings(BENCH, 1.6 * NATURAL, [], LINEAR) == ()


def test_a_narrow_band_is_none_and_names_what_to_record() -> None:
    (finding,) = claim_findings(BENCH, 1.4 * NATURAL, [], LINEAR)
    assert "cannot be claimed" in finding.what
    assert "next_experiment.csv" in finding.change
    assert not finding.stops


def test_what_the_simulated_axis_lacks_is_named() -> None:
    (finding,) = claim_findings(BENCH, 10.0 * NATURAL, ["backlash"], LINEAR)
    assert "backlash" in finding.what
    assert "next_experiment" not in finding.change


@pytest.mark.parametrize(("model", "claimed"), [(4e-7, True), (7.5e-7, False)])
def test_errors_below_that_of_the_model_are_not_claimed(model: float, claimed: bool) -> None:
    """Independent errors add as squares: 1 um with 0.75 um of the model is 1.25 um."""
    found = claim_findings(replace(BENCH, model_error=model), 10.0 * NATURAL, [], LINEAR, 1e-6)
    assert bool(found) != claimed
    assert claimed or ("1.25 um" in found[0].what or "1.25 µm" in found[0].what)


@pytest.mark.parametrize(("late", "claimed"), [(1.14e-6, True), (1.5e-6, False)])
def test_an_error_that_depends_on_when_the_acceleration_changes_is_not_claimed(late: float, claimed: bool) -> None:
    found = claim_findings(BENCH, 10.0 * NATURAL, [], LINEAR, 1e-6, late)
    assert bool(found) != claimed
    assert claimed or "becomes 1.5 µm instead of 1 µm" in found[0].what


@pytest.mark.parametrize(("quantum", "claimed"), [(3e-7, True), (4e-7, False)])
def test_an_error_of_the_size_of_the_steps_of_the_encoder_is_not_claimed(quantum: float, claimed: bool) -> None:
    bench = replace(BENCH, servo=replace(SERVO, quantum=quantum))
    found = claim_findings(bench, 10.0 * NATURAL, [], LINEAR, 1e-6)
    assert bool(found) != claimed
    assert claimed or "1 µm are of the size of the steps of the encoder, 400 nm" in found[0].what


def test_the_rounding_of_a_position_counts_once() -> None:
    """In fast motion, rounding is white noise of q/sqrt(12): 0.25 - 1/12 of the square are left of 0.5 q."""
    q, t = 1e-6, 1e-3 * np.arange(8000)
    record = Record("axis", t, q=np.round(0.05 * np.sin(2.0 * pi * t) / q) * q, quantum=q)
    row = ModelResult("Coulomb", "", closed_loop=(Fit(0.5 * q, 1.0, "position", "m"),))
    assert model_error(IdentifiedModel(row), record) == pytest.approx(sqrt(0.25 - 1.0 / 12.0) * q, rel=0.15)


@pytest.mark.parametrize(("error", "biased"), [(1e-6, False), (4e-6, True)])
def test_an_error_above_the_noise_of_the_position_is_bias(error: float, biased: bool) -> None:
    """Noise of 1 um: independent of the motion, so that 4 um are sqrt(15) um of the model."""
    t, rng = 1e-3 * np.arange(8000), np.random.default_rng(1)
    record = Record("axis", t, q=0.05 * np.sin(2.0 * pi * t) + 1e-6 * rng.standard_normal(8000))
    row = ModelResult("Coulomb", "", closed_loop=(Fit(error, 1.0, "position", "m"),))
    found = bias_findings(IdentifiedModel(row), record)
    slow = replace(record, reference=record.column("q") + 0.03)  # a tracking error of which 4 um are less than 0.02 %
    assert bias_findings(IdentifiedModel(row), slow) == ()
    assert [finding.name for finding in found] == ["model-biased"] * biased
    assert not biased or "3.87 µm" in found[0].what
    flexible = IdentifiedModel(row, load=FlexibleLoad(0.5, 100.0, 0.01, 0.5))
    words = [finding.what for each in (IdentifiedModel(row), flexible) for finding in bias_findings(each, record)]
    assert not biased or ("and a rigid mass lack" in words[0] and "and a mass in two parts lack" in words[1])


@pytest.mark.parametrize(("limit", "clipped"), [(15.0, False), (20.0, True)])
def test_a_force_at_the_declared_limit_is_saturated_and_not_clipped(limit: float, clipped: bool) -> None:
    """The inertia force of 40 N is recorded as at most 15 N: the drive saturates, or the measurement does."""
    t = 1e-3 * np.arange(8000)
    v = 0.5 * np.sin(2.0 * pi * t)
    a = pi * np.cos(2.0 * pi * t)
    force = np.clip(12.0 * a + 3.0 * np.sign(v), -15.0, 15.0)
    record = Record("axis", t, q=-0.5 / (2.0 * pi) * np.cos(2.0 * pi * t), force=force)
    found = force_findings([record], Servo("PID", SERVO.gains, 1e-3, limit))
    assert ("force-clipped" in {finding.name for finding in found}) == clipped


def model(Fs: float, weak: str) -> IdentifiedModel:
    parameters = tuple(
        IdentifiedParameter(name, value, 0.1, "N", "", weak=weak) for name, value in (("Fc", 6.0), ("Fs", Fs))
    )
    return IdentifiedModel(
        ModelResult("LuGre", "", parameters=parameters), "LuGre", {"Fc": 6.0, "Fs": Fs, "sigma0": 1e5}
    )


def test_a_static_friction_that_the_record_does_not_determine_is_not_simulated() -> None:
    simulated = without_unknown_static_friction(model(978.0, "its standard error is 6645 % of its value"))
    assert simulated.values == {"Fc": 6.0, "Fs": 6.0, "sigma0": 1e5}
    (finding,) = static_friction_findings(simulated, LINEAR)
    assert "978 N" in finding.what


@pytest.mark.parametrize(("Fs", "weak"), [(9.5, ""), (978.0, ""), (8.0, "its standard error is 50 % of its value")])
def test_a_known_or_plausible_static_friction_is_simulated(Fs: float, weak: str) -> None:
    found = without_unknown_static_friction(model(Fs, weak))
    assert found.values["Fs"] == Fs
    assert static_friction_findings(found, LINEAR) == ()
