"""The band in which a record supports a rigid mass, on axes simulated in `flexible_axis`, and on the measured axis."""

from __future__ import annotations

import numpy as np
import pytest
from flexible_axis import Axis, deviation_of_two_masses, moves, reference, simulate, slide

from friction_fmus.data import load_emps
from friction_fmus.identification import Record
from friction_fmus.identification.plant_band import plant_band

T = 1e-3 * np.arange(20000.0)


@pytest.mark.parametrize("path", [moves, reference])
def test_rigid_axis_with_fine_encoder_supports_more_than_its_loop(path):
    axis = Axis()
    band = plant_band([simulate(axis, path(T))], axis.motor)
    assert band is not None
    # crossover of the velocity loop: kv / M = 125 rad/s = 20 Hz
    assert band.supported > 2.0 * axis.kv / axis.motor / (2.0 * np.pi)
    inside = (band.frequency < 50.0) & (band.coherence > 0.99)
    assert np.count_nonzero(inside) > 7
    if path is moves:
        np.testing.assert_allclose(band.apparent[inside], axis.motor, rtol=0.05)
    # the force acts a sample later and is held for one; where the axis sticks, friction is known less well
    assert 0.0 < band.delay < 3e-3


@pytest.mark.parametrize("friction", [2.0, 10.0])
def test_resonance_limits_the_band(friction):
    axis = Axis(motor=4.0, load=8.0, kp=8.0, kv=300.0, forward=friction, backward=friction, viscous=10.0)
    band = plant_band([simulate(axis, moves(T))], axis.motor + axis.load)
    assert band is not None
    assert deviation_of_two_masses(axis, 2.57) == pytest.approx(0.3, abs=0.03)
    antiresonance = axis.resonance / (1.0 + axis.load / axis.motor) ** 0.5
    assert 1.0 < band.supported < antiresonance < axis.resonance


@pytest.mark.parametrize("resonance", [25.0, 60.0])
def test_sticking_does_not_hide_a_resonance(resonance):
    loop = {"kp": 15.0, "kv": 250.0} if resonance < 30.0 else {"kp": 25.0, "kv": 500.0}
    own = {"forward": 6.0, "backward": 6.0, "load_friction": 10.0, "viscous": 10.0}
    axis = Axis(motor=3.0, load=10.0, resonance=resonance, quantum=1e-6, noise=0.1, **loop, **own)
    band = plant_band([simulate(axis, moves(T, duration=0.7, period=1.2))], 13.0)
    assert band is not None
    assert 1.0 < band.supported < resonance / (1.0 + axis.load / axis.motor) ** 0.5  # the antiresonance


def test_coarse_encoder_limits_the_band():
    bands = [plant_band([simulate(Axis(quantum=quantum), moves(T))], 12.0) for quantum in (1e-7, 1e-5, 1e-4)]
    fine, coarse, coarsest = (band.supported for band in bands if band is not None)
    assert fine > 1.5 * coarse > 2.0 * coarsest


def test_wrong_mass_is_not_supported():
    band = plant_band([simulate(Axis(), moves(T))], 20.0)
    assert band is not None
    assert band.supported == 0.0


def test_friction_of_a_model_is_used_if_it_leaves_less():
    axis = Axis(presliding=3e5, viscous=300.0)
    record = simulate(axis, moves(T, stroke=1e-2))
    q = record.column("q")
    bristle = [0.0]
    for step in np.diff(q):
        bristle.append(slide(bristle[-1] + axis.presliding * step, axis.forward))
    model = np.array(bristle) + axis.viscous * np.gradient(q, record.Ts)
    without, within = (plant_band([record], 12.0, friction) for friction in (None, [model]))
    assert without is not None
    assert within is not None
    assert within.supported > 30.0 > without.supported
    wrong = plant_band([record], 12.0, [100.0 * model])
    assert wrong is not None
    assert wrong.supported == without.supported


def test_measured_axis():
    band = plant_band([load_emps()], 95.1)
    assert band is not None
    assert 30.0 < band.supported < 80.0
    low = band.frequency < 30.0
    np.testing.assert_allclose(band.apparent[low], 95.1, rtol=0.1)


def test_segments_count_together():
    axis = Axis()
    record = simulate(axis, moves(T))
    whole = plant_band([record], 12.0)
    halves = plant_band([record.window(0.0, 9.7), record.window(9.9, 20.0)], 12.0)
    assert whole is not None
    assert halves is not None
    assert halves.supported == pytest.approx(whole.supported, rel=0.3)


def test_no_band_without_force_mass_or_enough_samples():
    record = simulate(Axis(), moves(T[:3000]))
    assert plant_band([record], 0.0) is None
    assert plant_band([Record("a", record.t, q=record.q)], 12.0) is None
    assert plant_band([record.window(0.0, 0.1)], 12.0) is None
