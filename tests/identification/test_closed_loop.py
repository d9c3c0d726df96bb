"""The measured servo around any friction block."""

from __future__ import annotations

import numpy as np
import pytest

from friction_fmus import identify
from friction_fmus.data import MeasuredAxis, load_emps
from friction_fmus.identification import FitError
from friction_fmus.identification.closed_loop import axis_simulator
from friction_fmus.identification.fit.contact_model import contact_model

#: Found by `benchmarks/identification.py`.
LUGRE = {
    "M": 95.02,
    "OF": -3.174,
    "Fc": 21.52,
    "Fs": 14.96,
    "vs": 0.01615,
    "sigma0": 1.204e6,
    "sigma1": 3504.0,
    "sigma2": 193.3,
}


def test_the_emps_axis_with_lugre_moves_as_measured() -> None:
    axis = load_emps()
    with axis_simulator(contact_model("LuGre", axis.record.units), axis, LUGRE) as run:
        simulated = run({})
    q, force = axis.record.column("q"), axis.record.column("force")
    assert 1e6 * np.sqrt(np.mean((simulated["q"] - q) ** 2)) < 1.38
    assert np.sqrt(np.mean((simulated["force"] - force) ** 2) / np.mean(force**2)) < 0.0380


def test_a_fit_in_closed_loop_moves_its_parameters_towards_the_measurement() -> None:
    axis = load_emps()
    short = MeasuredAxis(axis.record.window(0.0, 4.0), axis.servo)
    start = {"Fc": 15.0}
    known = {"Fv": 193.0, "Fs": 15.0, "vs": 0.017, "M": 95.1, "OF": -3.17}
    result = identify("Stribeck", short, fixed=known, start=start, validation=axis.record.window(0.0, 2.0))
    assert (result.method, result.signal, result.unit, result.errors) == ("closed-loop", "q", "m", "robust")
    assert result.values()["Fc"] == pytest.approx(21.5, rel=0.05)
    assert result.train.rms < 2e-6
    assert result.validation is not None and result.validation.rms < 2e-6
    assert np.all(np.isfinite(result.predicted)) and len(result.predicted) == len(short.record)


def test_another_method_is_refused_for_an_axis_with_its_servo() -> None:
    with pytest.raises(FitError, match="closed-loop"):
        identify("Stribeck", load_emps(), method="inverse")
