"""DiscreteInverse with two zeros outside the unit circle: its errors, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from thorough import few

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import Kind, discover_laws

(LAW,) = (law for law in discover_laws(laws_folder()) if law.name == "DiscreteInverse")
INNER, POLES = (-0.3, 0.5), (0.9, -0.4, 0.2, 0.1)


def invert(r: np.ndarray, pair: tuple[float, float], **values: float) -> tuple[np.ndarray, np.ndarray]:
    """What the plant should follow, and what it does."""
    states = {v.name: v.start for v in LAW.select(Kind.STATE, Kind.STATES)}
    parameters = {"K": 0.3, "zero": 0.0, "pair": pair, "inner": INNER, "a": tuple(np.poly(POLES)[1:])}
    u, now = [], []
    for value in r:
        found = LAW.evaluate({**parameters, "u_min": -1e30, "u_max": 1e30, **values, **states, "r": float(value)})
        states = {name: found[name] for name in states}
        u.append(found["u"])
        now.append(found["r_now"])
    top = 0.3 * np.poly([*INNER, complex(*pair), complex(pair[0], -pair[1])]).real
    x = lfilter(top, np.poly(POLES), u)
    return np.array(now), np.concatenate([[0.0], x[:-1]])


@settings(max_examples=few(12), deadline=20_000, derandomize=True, database=None)
@given(st.floats(1.2, 6.0), st.floats(0.0, math.pi), st.integers(2, 32))
def test_the_error_is_that_of_the_truncated_series(size, angle, N):
    """With zeros a and a* the series has g[i+1] = Im(a^i) / (Im(a) n^i), i / a^(i+1) where they meet."""
    pair = (size * math.cos(angle), size * math.sin(angle))
    r = np.concatenate([np.zeros(2), np.sin(np.arange(40) / 40 * math.pi) ** 4, np.zeros(40)])
    now, x = invert(r, pair, preview=float(N))
    n = size**2
    # sin(i angle) / sin(angle) is the polynomial of Chebyshev of the second kind
    U = np.polynomial.chebyshev.Chebyshev
    second = [U.basis(i).deriv()(math.cos(angle)) / i for i in (N - 1, N)]
    g_N, g_after = second[0] / size**N, second[1] / size ** (N + 1)
    late = np.concatenate([now, np.zeros(N)])
    expected = n * g_after * late[N - 1 : N - 1 + r.size] - g_N * late[N : N + r.size]
    # the references that are not known yet at the end
    inside = slice(0, r.size - N)
    assert (now - x)[inside] == pytest.approx(expected[inside], abs=1e-9 * n)


@pytest.mark.parametrize("pair", [(1.5, 2.0), (-3.0, 0.5), (0.4, 0.3), (0.0, 1.0)])
def test_zero_phase_of_a_pair_has_no_phase_and_the_gain_of_its_formula(pair):
    r = np.zeros(128)
    r[10] = 1.0
    now, x = invert(r, pair, preview=3.0, zero_phase=1.0)
    centre = int(np.argmax(now))
    assert centre == 10 + 3 + 1
    z = np.exp(2j * math.pi * np.arange(128) / 128)
    a = complex(*pair)
    gain = np.abs((1.0 - a / z) * (1.0 - a.conjugate() / z)) ** 2 / abs(1.0 - a) ** 4
    assert np.fft.fft(np.roll(x, -centre)) == pytest.approx(gain, abs=1e-9)


def test_a_double_zero_is_inverted():
    """The error is below N n g_N."""
    r = np.sin(np.arange(70) / 70 * math.pi) ** 4
    now, x = invert(r, (-4.0, 0.0), preview=30.0)
    assert np.abs(now - x).max() < 1e-14 * 30 * 4
