"""Fits to records in which the axis sticks while the drive force changes: the motion does not explain the force there.

The axis is simulated here, with Coulomb and viscous friction and exact sticking, so that its parameters are known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from thorough import landing

from friction_fmus.blocks.axis_units import units_of_channels
from friction_fmus.identification import Identification, Record, identify
from friction_fmus.identification.fit.idim import identify_inverse_model
from friction_fmus.identification.fit.rests import position_noise, standstill, unresolved_rest
from friction_fmus.identification.force_findings import stuck
from friction_fmus.identification.model_comparison import within_reach

M, FC, FV, OF = 2.0, 8.0, 5.0, 0.5
FINER = 20  # steps of the simulation in a sample


def sticking(quantum: float, Ts: float = 1e-3, stop: float = 6.0) -> Record:
    """A record of a mass that a PD controller moves along slow sines, with long rests at the reversals."""
    n = round(stop / Ts)
    t = Ts * np.arange(n)
    r = 0.05 * np.sin(2.0 * np.pi * 0.5 * t) + 0.01 * np.sin(2.0 * np.pi * 1.3 * t)
    q, force = np.zeros(n), np.zeros(n)
    x = v = 0.0
    h = Ts / FINER
    for k in range(n):
        q[k] = quantum * np.round(x / quantum)
        drive = force[k] = 2000.0 * (r[k] - q[k]) - 60.0 * v
        for _ in range(FINER):
            # the friction that stops the mass in this step, limited to Coulomb friction: exact sticking
            free = v + h * (drive - OF - FV * v) / M
            v = float(np.sign(free)) * max(abs(free) - h * FC / M, 0.0)
            x += h * v
    return Record("sticking", t, q=q, force=force, quantum=quantum, held=True)


@pytest.mark.parametrize(("quantum", "tolerance"), [(1e-5, 0.01), (1e-4, 0.12)])
def test_friction_of_an_axis_that_sticks(quantum: float, tolerance: float) -> None:
    """With the rests, the errors were 15 % of Fv and 86 % with the coarse encoder."""
    found = identify("Coulomb", sticking(quantum), viscous=True).parameters
    for name, true in {"M": M, "Fc": FC, "Fv": FV, "OF": OF}.items():
        estimate = found[name]
        assert estimate.value == pytest.approx(true, rel=tolerance), name
        assert abs(estimate.value - true) < 2.0 * estimate.standard_error, name
    assert found["Fc"].relative_error < 0.03


@pytest.mark.parametrize("model", ["Coulomb", "Stribeck", "LuGre"])
def test_a_low_sample_rate_determines_mass_and_friction(model: str) -> None:
    """At 100 Hz, a filter at a tenth of the rate is as long as the motion between two reversals."""
    found = identify(model, sticking(1e-7, Ts=0.01, stop=8.0), viscous=True).parameters
    assert found["M"].value == pytest.approx(M, rel=0.03)
    assert found["Fc"].value == pytest.approx(FC, rel=0.02)


def test_channels_without_a_unit_do_not_bound_the_stiffness() -> None:
    """In them, the units of force and stiffness are both 1."""
    record = replace(sticking(1e-6, stop=3.0), units=units_of_channels("1", "1"))
    bounded: list[object] = []

    def found(model: str, records: object, **options: object) -> Identification:
        bounded.append(options.get("bounds"))
        return identify(model, record, starts=1)

    assert within_reach(found, "LuGre", [record]).parameters["sigma0"].value > 100.0 * np.max(np.abs(record.force))
    assert bounded == [None]


@pytest.mark.parametrize("offset", np.linspace(0.0, 0.9, 7))
def test_a_smooth_reversal_is_no_standstill(offset: float) -> None:
    t = 1e-3 * np.arange(4000)
    q = 1e-5 * np.round(0.01 * np.cos(np.pi * t) / 1e-5 + offset)
    record = Record("sine", t, q=q, force=np.sign(np.gradient(q)), quantum=1e-5)
    assert not standstill(record)[10:-10].any()


@pytest.mark.parametrize(("rate", "noise"), [(100.0, 0.0), (100.0, 1e-6), (1000.0, 1e-6)])
def test_the_noise_of_a_position_is_no_motion(rate: float, noise: float) -> None:
    """At 100 Hz the fourth differences of 10 mm at 5 Hz look like noise of 14 um."""
    t = np.arange(20.0 * rate) / rate
    q = 0.01 * np.sin(2.0 * np.pi * 5.0 * t) + noise * np.random.default_rng(5).standard_normal(len(t))
    assert position_noise(q, 8) == pytest.approx(noise, rel=0.1, abs=2e-8)


def test_a_stribeck_velocity_above_all_speeds_is_bounded_by_them() -> None:
    """Any Fc fits then: an axis with 18 N had Fc = 1512 N and vs = 38 m/s, at speeds up to 1.5 m/s."""
    record = sticking(1e-6, stop=3.0)
    assert record.q is not None
    bounds: list[object] = []

    def found(model: str, records: object, **options: object) -> Identification:
        bounds.append(options.get("bounds"))
        result = identify(model, record, starts=1)
        vs = replace(result.parameters["vs"], value=10.0)
        return result if len(bounds) > 1 else replace(result, parameters={**result.parameters, "vs": vs})

    within_reach(found, "Stribeck", [record])
    fastest = float(np.quantile(np.abs(np.gradient(record.q, record.Ts)), 0.99))
    assert bounds == [None, {"vs": (0.0, pytest.approx(fastest))}]


def test_rests_are_named() -> None:
    finding = stuck([sticking(1e-4)])
    assert finding is not None and finding.name == "presliding-not-resolved" and "sticks" in finding.what


def test_a_rest_with_a_constant_force_is_kept() -> None:
    """After a stop the drive gives a constant force: a model with presliding explains it."""
    t = 1e-3 * np.arange(2000)
    q = 0.01 * np.minimum(t, 1.0)
    record = Record("stop", t, q=q, force=np.where(t < 1.0, 3.0, 2.5), quantum=1e-6)
    assert not unresolved_rest(record)[1100:].any()
    assert stuck([record]) is None


def test_slow_sliding_is_no_rest() -> None:
    """The position changes by one step of the encoder in ten samples, and the force is noisy."""
    t = 1e-3 * np.arange(4000)
    q = 1e-5 * np.round(1e-3 * t / 1e-5)
    record = Record("slow", t, q=q, force=5.0 + np.random.default_rng(1).normal(0.0, 1.5, len(t)), quantum=1e-5)
    assert np.mean(unresolved_rest(record)) < 0.02


def resting(noise: float) -> Record:
    """Strokes at several speeds with rests of 0.4 s in between, in which the drive gives 1.9 of 2 N of friction."""
    Ts, rest, stroke = 1e-3, 400, 600
    sizes = np.concatenate([[0.0, size, 0.0, -size] for size in (3.0, -3.0, 1.0, -1.0, 6.0, -6.0)])
    a = np.repeat(sizes, [rest, 100, stroke, 100] * 6)
    v = np.append(0.0, np.cumsum(a)[:-1]) * Ts
    v[np.abs(v) < 1e-9] = 0.0
    q = np.append(0.0, np.cumsum(v + 0.5 * Ts * a)[:-1]) * Ts + noise * np.random.default_rng(3).standard_normal(len(v))
    force = 4.0 * a + 2.0 * np.sign(v) + 3.0 * v
    force[v == 0.0] = 1.9
    return Record("strokes", Ts * np.arange(len(v)), q=q, force=force, held=True)


@pytest.mark.parametrize("noise", [0.0, 1e-8])
def test_rests_do_not_count_for_a_model_without_presliding(noise: float) -> None:
    """With them, the offset was 0.6 N instead of 0: a model driven by v = 0 has no friction there."""
    record = resting(noise)
    assert standstill(record).mean() == pytest.approx(0.33, abs=0.05)  # 400 of 1200 samples
    for found in (identify("Coulomb", record, viscous=True).parameters, identify_inverse_model(record).parameters):
        for name, true in {"M": 4.0, "Fc": 2.0, "Fv": 3.0}.items():
            assert found[name].value == pytest.approx(true, rel=0.02), name
        assert abs(found["OF"].value) < 0.03


def test_a_slow_motion_is_no_standstill() -> None:
    """At 0.1 mm/s the position stays within a step of 10 um for 100 samples, and then within the next one."""
    t = 1e-3 * np.arange(4000)
    q = 1e-5 * np.round(1e-4 * t / 1e-5)
    record = Record("slow", t, q=q, force=np.full(4000, 2.0), quantum=1e-5)
    assert not standstill(record)[200:-200].any()


@landing
def test_models_with_and_without_presliding_are_fitted_one_after_the_other() -> None:
    """The rows of the force over position are cached: only a model without presliding leaves out the rests."""
    record = resting(0.0)
    for model in ("Coulomb", "Dahl"):
        assert identify(model, record, viscous=True, position_map=True).parameters["M"].value == pytest.approx(
            4.0, rel=0.02
        )
