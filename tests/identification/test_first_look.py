"""The first look at forces that are late or filtered: right, or with errors that say so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from friction_fmus.identification import Record
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.first_look import first_look

TRUE = {"M": 12.0, "Fc": 15.0, "Fv": 40.0, "OF": 2.0}
TS = 1e-3
T = np.arange(12_000) * TS


def motion(t: Array, sizes: dict[float, float], order: int) -> Array:
    """Return sines of some frequencies [Hz] and sizes [m], or their derivatives."""
    waves = [a * (2 * np.pi * f) ** order * np.sin(2 * np.pi * f * t + order * np.pi / 2) for f, a in sizes.items()]
    return np.sum(waves, axis=0)


def force(t: Array, sizes: dict[float, float]) -> Array:
    v, a = motion(t, sizes, 1), motion(t, sizes, 2)
    F: Array = TRUE["M"] * a + TRUE["Fc"] * np.sign(v) + TRUE["Fv"] * v + TRUE["OF"]
    return F


def looked(F: Array, sizes: dict[float, float]) -> dict[str, tuple[float, float]]:
    record = Record("axis", T, q=motion(T, sizes, 0), force=F)
    return {name: (each.value, each.standard_error) for name, each in first_look([record]).items()}


TWO = {0.7: 0.1, 1.9: 0.03}
POLE = float(np.exp(-2 * np.pi * 20.0 * TS))


@pytest.mark.parametrize(
    "logged",
    [force(T, TWO), force(T - 0.5 * TS, TWO), force(T - 9.5 * TS, TWO), lfilter([1 - POLE], [1, -POLE], force(T, TWO))],
    ids=["exact", "held", "late", "filtered"],
)
def test_a_late_force_is_that_of_the_same_mass(logged: Array) -> None:
    found = looked(logged, TWO)
    for name, true in TRUE.items():
        value, error = found[name]
        assert value == pytest.approx(true, rel=0.02), name
        assert abs(value - true) < 3.0 * error + 1e-3 * true, name


def test_in_one_sine_a_held_force_is_within_the_errors() -> None:
    """There, half a sample late is 2 pi f M Ts/2 times 2 pi f of viscous friction less."""
    found = looked(force(T - 0.5 * TS, {2.0: 0.1}), {2.0: 0.1})
    for name, true in TRUE.items():
        assert abs(found[name][0] - true) < 3.0 * found[name][1] + 1e-3 * true, name


def test_a_rest_of_another_kind_is_no_delay() -> None:
    """Friction that falls with the speed would seem to be a delay of 3 ms, and change M by 3 %."""
    v = motion(T, TWO, 1)
    found = looked(force(T, TWO) + 10.0 * np.sign(v) * np.exp(-np.abs(v) / 0.1), TWO)
    assert found["M"][0] == pytest.approx(TRUE["M"], rel=0.01)
