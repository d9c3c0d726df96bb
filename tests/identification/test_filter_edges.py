"""Ends of a record in mid-motion: the filter of the position must not enter a fit; truth in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from friction_fmus import identify
from friction_fmus.identification import InverseModelSettings, Record, RecordError
from friction_fmus.identification.fit.idim import filtered_motion, identify_inverse_model

TRUTH = {"M": 20.0, "Fv": 40.0, "Fc": 8.0, "OF": -1.5}


def in_motion(rate: float, seconds: float = 3.0, phase: float = 0.7) -> Record:
    """Two sines, which neither begin nor end at rest, without noise."""
    t = np.arange(round(seconds * rate)) / rate
    q, v, a = np.zeros((3, len(t)))
    for frequency, size, begin in ((0.9, 0.04, phase), (2.3, 0.006, 1.1 + phase)):
        w = 2.0 * np.pi * frequency
        q += size * np.sin(w * t + begin)
        v += size * w * np.cos(w * t + begin)
        a -= size * w**2 * np.sin(w * t + begin)
    force = TRUTH["M"] * a + TRUTH["Fv"] * v + TRUTH["Fc"] * np.sign(v) + TRUTH["OF"]
    return Record("in motion", t, q=q, force=force)


@pytest.mark.parametrize("rate", [250.0, 1000.0, 8000.0])
@pytest.mark.parametrize("phase", [0.7, 2.5])
def test_a_record_and_a_window_in_mid_motion_give_the_truth(rate: float, phase: float) -> None:
    record = in_motion(rate, phase=phase)
    for part in (record, record.window(0.4, 2.5)):
        fit = identify_inverse_model(part)
        assert fit.relative_residual < 1e-4
        for name, value in TRUTH.items():
            assert fit.parameters[name].value == pytest.approx(value, rel=5e-4), name


@pytest.mark.parametrize("rate", [1000.0, 8000.0])
def test_a_block_fitted_to_a_window_has_the_parameters_of_the_truth(rate: float) -> None:
    found = identify("Coulomb", in_motion(rate).window(0.4, 2.5), viscous=True)
    assert found.train.relative_percent < 0.1
    for name, value in TRUTH.items():
        assert found.parameters[name].value == pytest.approx(value, rel=2e-3), name


def test_the_border_is_a_time() -> None:
    """The same times are discarded at every rate, at both ends."""
    for rate in (1000.0, 8000.0):
        found = identify("Coulomb", in_motion(rate), viscous=True)
        assert found.t[0] == pytest.approx(0.049, abs=0.011)
        assert found.t[-1] == pytest.approx(3.0 - 0.049, abs=0.011)
    settings = InverseModelSettings(border=(0.5, 1.0))
    found = identify("Coulomb", in_motion(1000.0), viscous=True, settings=settings)
    assert 0.5 <= found.t[0] < 0.51 and found.t[-1] == pytest.approx(1.999)


@pytest.mark.parametrize("samples", [50, 60, 70, 98, 120])
def test_a_record_shorter_than_the_filter_is_refused_in_a_sentence(samples: int) -> None:
    record = in_motion(1000.0, samples * 1e-3)
    with pytest.raises(RecordError, match=f"has {samples} samples at"):
        identify("Stribeck", record)
    friction = replace(record, force=None, friction=record.force)
    assert np.isfinite(identify("Coulomb", friction).train.rms)


def test_the_filter_follows_a_low_sample_rate() -> None:
    """A fixed cut-off of 100 Hz is beyond the Nyquist frequency of 75 Hz."""
    record = in_motion(150.0)
    v = filtered_motion(record).v
    middle = slice(60, -60)
    assert v[middle] == pytest.approx(np.gradient(record.column("q"), record.Ts)[middle], abs=2e-3)


@pytest.mark.parametrize("period", [1e-3, 2e-3, 4e-3])
def test_a_held_force_acts_until_the_next_sample(period: float) -> None:
    """A mass with viscous friction under a PD controller, exact from sample to sample, within the speed of one sign."""
    n, M, Fv = round(4.0 / period), TRUTH["M"], 200.0
    t = period * np.arange(n)
    r = 0.5 * t + 0.01 * np.sin(2.0 * np.pi * 2.0 * t) + 0.003 * np.sin(2.0 * np.pi * 5.0 * t)
    decay = np.exp(-Fv * period / M)
    q, force, x, v = np.zeros(n), np.zeros(n), 0.0, 0.5
    for k in range(n):
        q[k], force[k] = x, 4e4 * (r[k] - x) + 900.0 * (0.5 - v)
        rest = (force[k] - TRUTH["Fc"]) / Fv
        x, v = x + rest * period + (v - rest) * (1.0 - decay) * M / Fv, rest + (v - rest) * decay
    record = Record("held", t, q=q, force=force).window(0.5, 4.0)
    settings = InverseModelSettings(cutoff=min(100.0, 0.1 / period), decimation=1)
    found = identify("Viscous", replace(record, held=True), settings=settings)
    assert found.parameters["M"].value == pytest.approx(M, rel=2e-3)  # (w Ts)^2 / 12 at 5 Hz
    # taken as the force at the sample, half a period later in the motion, it has Fv Ts/2 a more
    assert identify("Viscous", record, settings=settings).parameters["M"].value > M + 0.3 * Fv * period
