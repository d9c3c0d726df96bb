"""PID's dead-band and its integral at reversals: the rule, and what it does to hunting."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from thorough import landing, nightly

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import Kind, discover_laws
from harness import FmuPart, System

PID = next(law for law in discover_laws(laws_folder()) if law.name == "PID")
Ts = 1e-3


def run(samples: Iterable[dict[str, float]], **values: float) -> list[dict[str, float]]:
    states = {variable.name: values.pop(variable.name, variable.start) for variable in PID.select(Kind.STATE)}
    results = []
    for sample in samples:
        results.append(PID.evaluate({**values, **states, **sample}))
        states = {name: results[-1][name] for name in states}
    return results


def integrals(samples: Iterable[dict[str, float]], **values: float) -> np.ndarray:
    return np.array([result["integral"] for result in run(samples, **values)])


@pytest.mark.parametrize(
    ("db_ratio", "counted"), [(1.5, [5, 0, 0, 0, 0, -5, -2.5]), (1.0, [5, 0, 0, 2.5, 0, -5, -2.5])]
)
def test_dead_band_with_and_without_hysteresis(db_ratio, counted):
    """Held at 2 and below; let go above 3, or above 2 without hysteresis."""
    errors = [5, 2, -1, 2.5, 2, -5, -2.5]
    found = integrals([{"r": e} for e in errors], db=2.0, db_ratio=db_ratio, Ki=0.0, Kp=0.0)
    assert found == pytest.approx(Ts * np.cumsum(counted), abs=1e-15)


@pytest.mark.parametrize("reversal", [1.0, 0.0, -1.0, 0.3])
def test_the_integral_at_reversals(reversal):
    """The sign of 0 is none, and nothing within v_zc counts: the axis turns in the samples 4 and 7."""
    velocities = [0.0, 2.0, 0.0, -0.5, -2.0, -0.1, 0.9, 1.1, 3.0]
    found = run([{"v": v} for v in velocities], integral=8.0, reversal=reversal, v_zc=1.0, Kp=0.0, Kd=0.0, Ki=1.0)
    expected = [8.0] * 4 + [8.0 * reversal] * 3 + [8.0 * reversal**2] * 2
    # in that very sample
    assert [result["u"] for result in found] == pytest.approx(expected)
    assert [result["integral"] for result in found] == pytest.approx(expected)


def test_every_sign_change_counts_without_a_threshold():
    found = integrals([{"v": v} for v in (1e-9, 0.0, -1e-9, 1e-9)], integral=1.0, reversal=-0.5, v_zc=0.0)
    assert found == pytest.approx([1.0, 1.0, -0.5, 0.25])


@pytest.mark.parametrize(("reversal", "Fc", "Ki"), [(1.0, 1.5, 30.0), (0.5, 0.7, 1e4), (1.0, 2.0, 0.0)])
def test_the_sign_of_friction_in_the_integral_turns(reversal, Fc, Ki):
    """A recursion of its own, in random motion with an error; the force of friction changes by 2 Fc."""
    random = np.random.default_rng(7)
    v, e = random.normal(size=(2, 300)) * [[1.0], [1e-2]]
    found = run(
        [{"v": a, "r": b} for a, b in zip(v, e, strict=True)],
        Kp=0.0, Kd=0.0, Ki=Ki, reversal=reversal, Fc_turned=Fc, v_zc=0.5, u_min=-5.0, u_max=5.0,
    )  # fmt: skip
    integral, last, turns = 0.0, 0.0, 0
    for k in range(300):
        if abs(v[k]) > 0.5:
            if last * v[k] < 0.0:
                integral = reversal * integral + (2.0 * Fc * np.sign(v[k]) / Ki if Ki else 0.0)
                turns += 1
            last = v[k]
        wanted = Ki * integral
        assert found[k]["u"] == pytest.approx(np.clip(wanted, -5.0, 5.0), rel=1e-9, abs=1e-12)
        further = abs(wanted) > 5.0 and wanted * e[k] > 0.0
        integral += 0.0 if further else Ts * e[k]
        assert found[k]["integral"] == pytest.approx(integral, rel=1e-9, abs=1e-15)
    assert turns > 50


def test_a_load_stays_in_the_integral_where_friction_turns():
    """Ki I = load + Fc sgn(v) at constant speed; after the reversal it is load - Fc at once."""
    load, Fc, Ki = 3.0, 1.5, 250e3
    found = run(
        [{"v": 0.1}, {"v": 1e-5}, {"v": -0.1}],
        integral=(load + Fc) / Ki,
        Fc_turned=Fc,
        v_zc=1e-3,
        Kp=0.0,
        Kd=0.0,
        Ki=Ki,
    )
    assert [result["u"] for result in found] == pytest.approx([load + Fc, load + Fc, load - Fc])


def test_reset_and_disable_forget_the_side_and_the_band():
    assert integrals([{"v": 1.0}, {"v": -1.0, "reset": 1.0}], integral=1.0, reversal=0.5)[1] == 0.0
    off = run([{"v": 1.0, "r": 1.0}, {"v": 1.0, "enable": 0.0}, {"v": -1.0, "r": 2.5}], db=2.0, db_ratio=1.5, Kp=0.0)
    assert not any(off[1].values())
    assert off[2]["integral"] == pytest.approx(Ts * 2.5)


@pytest.fixture(scope="module")
def hunting(build_fmu: Callable[..., Path]):
    """Error of the position loop of the LuGre paper (1995) between 100 and 200 s after a step of the reference."""
    wires = ["pid.u -> mass.F_drive", "mass.x -> pid.x", "mass.v -> pid.v", "mass.v -> fric.v"]
    parts = [
        FmuPart("pid", build_fmu("PID"), every=10),
        FmuPart("mass", build_fmu("Mass")),
        FmuPart("fric", build_fmu("LuGre")),
    ]
    values = {"pid.r": 1.0, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.Kp": 3.0, "pid.Kd": 6.0, "pid.Ki": 4.0}
    values |= {"fric.sigma0": 1e5, "fric.sigma1": 316.2, "fric.sigma2": 0.4, "fric.Fc": 1.0, "fric.Fs": 1.5}
    values |= {"fric.vs": 1e-3, "mass.F_load": 0.0, "mass.v_support": 0.0}
    with System(parts, [*wires, "fric.F -> mass.F_friction"], values) as system:

        def error(**pid: float) -> np.ndarray:
            start = {f"pid.{name}": value for name, value in pid.items()}
            result = system.with_start(start).run(stop=200.0, step=1e-4, decimate=10, record=["mass.x"])
            return 1.0 - result["mass.x"].to_numpy()[100_000:]

        yield error


def period(error: np.ndarray) -> float:
    """Twice the mean time between changes of sign [s]."""
    return 2.0 * float(np.diff(np.flatnonzero(np.diff(np.sign(error)))).mean()) * 1e-3


@nightly
def test_a_dead_band_ends_hunting_if_it_is_wider_than_a_slip(hunting):
    plain = np.ptp(hunting())
    assert plain > 0.1
    assert np.ptp(hunting(db=plain)) < 1e-6
    assert np.ptp(hunting(db=0.4 * plain)) > 1.02 * plain


@landing
def test_an_integral_reset_shortens_the_period_and_does_not_end_hunting(hunting):
    plain, reset = hunting(), hunting(reversal=0.0)
    assert period(reset) < 0.8 * period(plain)
    assert np.ptp(reset) > 0.9 * np.ptp(plain)


@nightly
def test_reversing_friction_in_the_integral_nearly_ends_hunting_unless_the_spring_back_is_hidden(hunting):
    plain = np.ptp(hunting())
    assert np.ptp(hunting(reversal=-1.0)) < 0.05 * plain
    assert np.ptp(hunting(Fc_turned=1.0)) < 0.01 * plain
    assert np.ptp(hunting(Fc_turned=1.0, v_zc=1e-3)) > 2.0 * plain
    assert np.ptp(hunting(Fc_turned=1.5)) > 2.0 * plain  # more than there is
