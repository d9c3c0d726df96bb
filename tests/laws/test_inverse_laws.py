"""Inverse dynamics, inverse with preview and prefilters against plants that are solved independently."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from thorough import few, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import VECTORS, Kind, Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
INVERSE, DISCRETE, PREFILTER, PREVIEW = (
    LAWS[name] for name in ("InverseDynamics", "DiscreteInverse", "Prefilter", "PreviewPrefilter")
)
WIDE = {"u_min": -1e30, "u_max": 1e30}
TS = 1e-3


class Running:
    """A law with its states, sample by sample."""

    def __init__(self, law: Law, **parameters: float | tuple[float, ...]) -> None:
        self._law = law
        self._names = {v.name for v in law.given}
        self._values = {name: value for name, value in (WIDE | parameters).items() if name in self._names}
        self._states = {v.name: v.starts if v.kind in VECTORS else v.start for v in law.select(Kind.STATE, Kind.STATES)}

    def __call__(self, **sample: float) -> dict:
        found = self._law.evaluate({**self._values, **self._states, **sample})
        self._states = {name: found[name] for name in self._states}
        return found


def run(law: Law, samples: Iterable[dict[str, float]], **parameters: float | tuple[float, ...]) -> list[dict]:
    running = Running(law, **parameters)
    return [running(**sample) for sample in samples]


# ---- inverse dynamics


def test_one_mass_with_viscous_friction():
    found = INVERSE.evaluate({"rd": 0.5, "rdd": -2.0, "jerk": 7.0, "snap": 9.0, "m": 3.0, "Fv": 4.0, "gain": 0.5})
    assert (found["u"], found["F_hat"]) == (3.0 * -2.0 + 0.5 * 4.0 * 0.5, 4.0 * 0.5)
    assert (found["r_motor"], found["rd_motor"]) == (0.0, 0.5)


masses = st.floats(0.1, 10.0)


@given(masses, masses, st.floats(0.0, 20.0), st.floats(0.0, 20.0), st.floats(1e2, 1e6), st.floats(1.0, 500.0))
def test_two_masses_follow_a_sinusoid(m, m_load, Fv, Fv_load, stiffness, omega):
    """Against the dynamic stiffness matrix of motor and load, driven at the motor, in the frequency domain."""
    s = 1j * omega
    matrix = np.array(
        [[m * s**2 + Fv * s + stiffness, -stiffness], [-stiffness, m_load * s**2 + Fv_load * s + stiffness]]
    )
    motor, load = np.linalg.solve(matrix, [1.0, 0.0])
    force, amplitude, phase = 1.0 / load, 1e-3, cmath.exp(0.7j)
    derivatives = [(amplitude * s**n * phase).real for n in range(5)]
    found = INVERSE.evaluate(
        dict(zip(("r", "rd", "rdd", "jerk", "snap"), derivatives, strict=True))
        | {"m": m, "m_load": m_load, "Fv": Fv, "Fv_load": Fv_load, "compliance": 1.0 / stiffness, **WIDE}
    )
    scale = amplitude * (abs(matrix[0, 0]) * abs(matrix[1, 1]) / stiffness + stiffness)
    assert found["u"] == pytest.approx((amplitude * phase * force).real, abs=1e-12 * scale)
    moved = amplitude * phase * motor * force
    size = amplitude * abs(matrix[1, 1]) / stiffness
    assert found["r_motor"] == pytest.approx(moved.real, abs=1e-12 * size)
    assert found["rd_motor"] == pytest.approx((moved * s).real, abs=1e-12 * size * omega)


def test_inverse_dynamics_disabled_passes_the_reference():
    found = INVERSE.evaluate({"r": 1.0, "rd": 2.0, "rdd": 3.0, "m_load": 1.0, "compliance": 0.1, "enable": 0.0})
    assert found == {"u": 0.0, "F_hat": 0.0, "r_motor": 1.0, "rd_motor": 2.0, "u_sat": 0.0}


# ---- inverse of a sampled plant


def follow(
    forces: Iterable[float], K: float, zero: float, inner: tuple[float, ...], a: tuple[float, ...]
) -> np.ndarray:
    """Positions of A(q) x[k+1] = K B(q) (u[k] - zero u[k-1]), from rest."""
    top = K * np.poly([*inner, zero])
    u, x = list(forces), []
    for k in range(len(u) + 1):
        past = sum(a[i] * x[k - 1 - i] for i in range(len(a)) if k - 1 - i >= 0)
        x.append(sum(top[i] * u[k - 1 - i] for i in range(len(top)) if k - 1 - i >= 0) - past)
    return np.array(x)


def smooth(n: int, seed: int) -> np.ndarray:
    """A random reference that starts and ends at rest."""
    random = np.random.default_rng(seed)
    t = np.arange(n) / n
    return np.sin(math.pi * t) ** 4 * sum(random.normal() * np.sin(2 * math.pi * f * t) for f in range(1, 8))


@settings(max_examples=few(40), deadline=20_000, derandomize=True, database=None)
@given(
    st.one_of(st.floats(1.2, 8.0), st.floats(-8.0, -1.2)),
    st.integers(1, 32),
    st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)),
    st.tuples(*[st.floats(-0.9, 0.9)] * 4),
)
def test_the_error_of_the_truncated_series_is_the_reference_ahead(zero, N, zeros, poles):
    """r_now[k] - x[k] = r_now[k+N] / zero^N, exactly."""
    plant = {"K": 0.3, "zero": zero, "inner": zeros, "a": tuple(np.poly(poles)[1:])}
    r = np.concatenate([np.zeros(5), smooth(80, 1), np.zeros(60)])
    found = run(DISCRETE, [{"r": value} for value in r], preview=float(N), **plant)
    now = np.array([sample["r_now"] for sample in found])
    assert np.array_equal(now, np.concatenate([np.zeros(N + 1), r])[: r.size])
    x = follow([sample["u"] for sample in found], **plant)[: r.size]
    ahead = np.concatenate([now, r[r.size - N - 1 :]])[N : N + r.size]
    # rounding of u is carried through the plant, whose gain is bounded
    assert now - x == pytest.approx(ahead / zero**N, abs=1e-9 * max(1.0, abs(zero)))


def test_the_start_values_are_a_mass_behind_half_a_sample_of_delay():
    """Its position at the samples, from the motion under a force that changes half way, is followed to 1e-9."""
    r = np.concatenate([np.zeros(3), 0.01 * smooth(300, 2), np.zeros(40)])
    found = run(DISCRETE, [{"r": value} for value in r])
    x, v, before, positions = 0.0, 0.0, 0.0, []
    for sample in found:
        positions.append(x)
        for force in (before, sample["u"]):
            x, v = x + v * TS / 2 + force * (TS / 2) ** 2 / 2, v + force * TS / 2
        before = sample["u"]
    now = np.array([sample["r_now"] for sample in found])
    assert np.abs(now - positions).max() == pytest.approx(np.abs(now).max() / 5.8284**12, rel=0.3)
    assert np.abs(now - positions).max() < 2e-9 * np.abs(now).max()


@pytest.mark.parametrize("zero", [-5.0, -1.3, 1.3, 4.0])
def test_zero_phase_has_no_phase_and_the_gain_of_its_formula(zero):
    """The response to a pulse is symmetric; its transform is |1 - zero z^-1|^2 / (1 - zero)^2."""
    plant = {"K": 2.0, "zero": zero, "inner": (-0.5, 0.2), "a": (-0.5, 0.06, 0.0, 0.0)}
    r = np.zeros(64)
    r[10] = 1.0
    found = run(DISCRETE, [{"r": value} for value in r], preview=3.0, zero_phase=1.0, **plant)
    x = follow([sample["u"] for sample in found], **plant)[:64]
    centre = int(np.argmax([sample["r_now"] for sample in found]))
    assert centre == 10 + 3 + 1
    assert x == pytest.approx(x[(2 * centre - np.arange(64)) % 64], abs=1e-13)
    z = np.exp(2j * math.pi * np.arange(64) / 64)
    gain = np.fft.fft(np.roll(x, -centre))
    assert gain == pytest.approx(np.abs(1.0 - zero / z) ** 2 / (1.0 - zero) ** 2, abs=1e-12)


def test_without_a_zero_outside_it_is_the_inverse():
    plant = {"K": 0.3, "zero": 0.0, "inner": (-0.3, 0.6), "a": (-1.2, 0.3, 0.0, 0.0)}
    r = np.concatenate([np.zeros(3), smooth(60, 3)])
    found = run(DISCRETE, [{"r": value} for value in r], preview=1.0, **plant)
    x = follow([sample["u"] for sample in found], **plant)[: r.size]
    assert x == pytest.approx([sample["r_now"] for sample in found], abs=1e-12)


@pytest.mark.parametrize("zero_phase", [0.0, 1.0])
def test_it_starts_at_rest_wherever_the_reference_is(zero_phase):
    """A plant that needs a force at rest gets it at once; the start values need none."""
    held = run(
        DISCRETE, [{"r": 0.5}] * 10, zero_phase=zero_phase, K=0.3, zero=4.0, a=(-0.5, 0.0, 0.0, 0.0), preview=30.0
    )
    static = 0.3 * (1.0 + 0.1715728752538099) * (1.0 - 4.0) / (1.0 - 0.5)
    assert [sample["u"] for sample in held] == pytest.approx([0.5 / static] * 10, rel=1e-12)
    assert [sample["u"] for sample in run(DISCRETE, [{"r": 0.5}] * 10, zero_phase=zero_phase)] == [0.0] * 10


def test_reset_and_disable_begin_anew():
    r = [{"r": value} for value in smooth(60, 4)]
    again = run(DISCRETE, [*r[:30], r[30] | {"reset": 1.0}, *r[31:]])
    assert again[30:] == run(DISCRETE, r[30:])
    off = run(DISCRETE, [*r[:30], *[sample | {"enable": 0.0} for sample in r[30:40]], *r[40:]])
    for sample in off[30:40]:
        assert set(np.concatenate([np.ravel(value) for value in sample.values()])) == {0.0}
    assert off[40:] == run(DISCRETE, r[40:])


# ---- prefilters

GAINS = {"Kp": 12e3, "Kd": 190.0, "Ki": 250e3}


def stick_slip(force: float, v: float) -> float:
    """Friction of a plant that is anything but linear."""
    return math.tanh(v / 1e-3) * (1.0 + 0.5 * math.exp(-((v / 1e-2) ** 2))) + 0.4 * v


def loop(controller: Callable[[int, float, float], float], n: int, friction: bool) -> np.ndarray:
    """The forces on a mass of 2 kg, in steps of Ts."""
    x = v = 0.0
    forces = []
    for k in range(n):
        forces.append(controller(k, x, v))
        a = (forces[-1] - (stick_slip(forces[-1], v) if friction else 0.0)) / 2.0
        x, v = x + TS * v + TS**2 / 2 * a, v + TS * a
    return np.array(forces)


def sines(n: int) -> np.ndarray:
    """r, rd, rdd at the samples -4 ... n + 4."""
    t = TS * np.arange(-4, n + 5)
    w = 2 * math.pi * np.array([[1.3], [4.0], [7.1]])
    size = np.array([[1e-2], [2e-3], [5e-4]])
    return np.array(
        [(size * np.sin(w * t)).sum(0), (size * w * np.cos(w * t)).sum(0), (-size * w**2 * np.sin(w * t)).sum(0)]
    )


@pytest.mark.parametrize("friction", some([False, True], [True]))
@pytest.mark.parametrize("law", some([PREFILTER, PREVIEW], [PREVIEW]), ids=lambda law: law.name)
def test_the_prefilter_gives_the_feedforwards_force(law, friction):
    """On a linear plant and on one with friction, in every sample, to 1e-9."""
    n = 1500
    r, rd, rdd = sines(n)
    extra = 0.3 * np.sign(rd)

    pid = Running(LAWS["PID"], **GAINS)
    by_force = loop(
        lambda k, x, v: pid(r=r[k + 4], rd=rd[k + 4], x=x, v=v, f=2.0 * rdd[k + 4] + extra[k + 4])["u"], n, friction
    )
    own, plain = Running(law, m=2.0, **GAINS), Running(LAWS["PID"], **GAINS)
    if law is PREVIEW:
        for k in range(4):  # what is known ahead
            own(r=r[k], enable=0.0)
        for k in range(4):
            own(r=r[4 + k], enable=0.0)

    def shifted(k, x, v):
        inputs = {"r": r[k + 8]} if law is PREVIEW else {"r": r[k + 4], "rd": rd[k + 4], "rdd": rdd[k + 4]}
        found = own(**inputs, f=extra[k + 4])
        return plain(r=found["r_out"], rd=found["rd_out"], x=x, v=v)["u"]

    difference = np.abs(loop(shifted, n, friction) - by_force).max() / np.abs(by_force).max()
    # the differences of eighth order see sines of up to 7 Hz with an error of (w Ts)^8 / 630
    assert difference < 1e-9


@pytest.mark.parametrize("degree", range(10))
def test_differences_are_exact_for_polynomials(degree):
    """Acceleration up to the ninth degree, velocity up to the eighth."""
    p = np.polynomial.Polynomial(np.random.default_rng(degree).normal(size=degree + 1))
    t = 0.25 * np.arange(-4, 5)
    found = run(PREVIEW, [{"r": p(value)} for value in t], Ts=0.25)[-1]
    assert found["r_now"] == pytest.approx(p(0.0), rel=1e-14)
    assert found["rdd_now"] == pytest.approx(p.deriv(2)(0.0), abs=1e-10)
    assert found["rd_now"] == pytest.approx(p.deriv()(0.0), abs=1e-11 if degree < 9 else 1e-2)


def test_the_recursion_is_one_over_the_controller():
    """A constant force without an integral: the shift tends to force / Kp."""
    found = run(PREFILTER, [{"f": 3.0}] * 3000, Kp=12e3, Kd=190.0, Ki=0.0)[-1]
    assert found["r_out"] == pytest.approx(3.0 / 12e3, rel=1e-9)
    # and with one: it is let go by the integral, which gives the force alone
    found = run(PREFILTER, [{"f": 3.0}] * 3000, **GAINS)[-1]
    assert found["r_out"] == pytest.approx(0.0, abs=1e-12)
    assert found["integral"] == pytest.approx(3.0 / 250e3, rel=1e-9)


def outputs(law: Law, samples: list[dict]) -> list[list[float]]:
    return [[sample[v.name] for v in law.select(Kind.OUTPUT)] for sample in samples]


@pytest.mark.parametrize("law", [PREFILTER, PREVIEW], ids=lambda law: law.name)
def test_prefilter_disabled_passes_the_reference(law):
    samples = [{"r": 0.1, "f": 5.0}] * 20
    if law is PREFILTER:
        samples = [sample | {"rd": 0.2, "rdd": 3.0} for sample in samples]
    off = run(law, [*samples, *[sample | {"enable": 0.0} for sample in samples], *samples])
    rd = 0.2 if law is PREFILTER else 0.0
    assert all((s["r_out"], s["rd_out"], s["u_hat"]) == (0.1, rd, 0.0) for s in off[20:40])
    assert off[20]["shift"] == 0.0
    assert outputs(law, off[40:]) == outputs(law, off[:20])
    again = run(law, [*samples, samples[0] | {"reset": 1.0}, *samples[1:]])
    assert again[20:] == again[:20]
