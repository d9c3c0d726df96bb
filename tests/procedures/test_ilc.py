"""Iterative learning on plants of FMUs, against the condition of convergence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from thorough import nightly

from friction_fmus.errors import FrictionError
from friction_fmus.procedures import PidLoop, train
from friction_fmus.procedures.ilc import inverse_process_sensitivity, learning_step, zero_phase
from harness import CallablePart, FmuPart, Part, Port, System

LOOP = PidLoop(m=1.0, Kp=12e3, Kd=190.0, Ki=250e3)
Ts = 1e-3
MakeSystem = Callable[[Part], System]


@pytest.fixture(scope="module")
def axis(build_fmu: Callable[..., Path]) -> Callable[..., MakeSystem]:
    """``axis(friction, every, **start)``: a mass with friction under PID control on r = A (1 - cos)."""

    def configure(friction: str, start: Mapping[str, float], every: int = 1) -> MakeSystem:
        def make(learned: Part) -> System:
            parts = [
                FmuPart("reference", build_fmu("Sine"), every=every),
                FmuPart("pid", build_fmu("PID"), every=every),
                FmuPart("mass", build_fmu("Mass")),
                FmuPart("friction", build_fmu(friction)),
                learned,
            ]
            wires = ["reference.r -> pid.r", "reference.rd -> pid.rd", "mass.x -> pid.x", "mass.v -> pid.v"]
            wires += ["pid.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
            values = {"pid.rdd": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0, **start}
            return System(parts, [*wires, "learned.F -> pid.f"], values)

        return make

    return configure


def back_and_forth(A: float) -> dict[str, float]:
    """r = A (1 - cos(2 pi t)), which starts at rest."""
    return {"reference.offset": A, "reference.amplitude[1]": -A, "reference.phase[1]": np.pi / 2.0}


def run(make: MakeSystem, loop: PidLoop = LOOP, **settings: float) -> np.ndarray:
    """The root mean square errors of 16 trials of one second."""
    settings = {"samples": 1000, "Ts": Ts, "fq": 100.0} | settings
    return train(make, loop, reference="reference.r", position="mass.x", **settings).rms


@pytest.mark.parametrize("rate", [0.3, 0.5])
def test_a_linear_loop_contracts_by_one_minus_rate(axis, rate):
    rms = run(axis("Viscous", {"friction.Fv": 20.0} | back_and_forth(0.01)), rate=rate)
    assert rms[1] / rms[0] == pytest.approx(1.0 - rate, rel=0.02)
    # sampling and Q leave a rest in the long run
    assert rms[10] / rms[0] == pytest.approx((1.0 - rate) ** 10, rel=0.05)
    assert (np.diff(rms) < 0.0).all()


@nightly
def test_sliding_friction_is_learned(axis):
    rms = run(axis("LuGre", {"friction.Fs": 1.0} | back_and_forth(0.01), every=10), step=1e-4)
    assert rms[-1] < rms[0] / 100.0
    assert (np.diff(rms) < 0.0).all()


def test_presliding_is_learned_with_the_stiffness_of_the_contact(axis):
    """Then L is exact again; without it the contraction is 1 - rate |L S_p| with the stiffness in S_p alone."""
    make = axis("LuGre", {"friction.Fs": 1.0, "friction.sigma0": 1e5} | back_and_forth(2e-6), every=10)
    rms = run(make, PidLoop(LOOP.m, LOOP.Kp + 1e5, LOOP.Kd, LOOP.Ki), step=1e-4)
    assert rms[-1] < rms[0] / 20.0
    assert (np.diff(rms) < 0.0).all()
    assert run(make, step=1e-4, trials=1)[1] > 0.75 * rms[0]


def test_trials_diverge_where_the_condition_is_violated(axis):
    """L five times too large: |1 - 0.5 5| = 1.5."""
    wrong = PidLoop(5.0 * LOOP.m, 5.0 * LOOP.Kp, 5.0 * LOOP.Kd, 5.0 * LOOP.Ki)
    rms = run(axis("Viscous", {"friction.Fv": 20.0} | back_and_forth(0.01)), wrong, trials=4)
    assert rms[1:] / rms[:-1] == pytest.approx([1.5] * 4, rel=0.1)


def test_the_fmu_learns_the_same(axis, build_fmu):
    """IterativeLearning in one long run, told of the ends of its trials, against runs that begin anew."""
    gains = {"m": LOOP.m, "Kp": LOOP.Kp, "Kd": LOOP.Kd, "Ki": LOOP.Ki, "fq": 100.0, "N": 1000}
    friction = {"friction.Fv": 20.0} | back_and_forth(0.01)

    def make(ends: Part) -> System:
        parts = [
            FmuPart("reference", build_fmu("Sine")),
            FmuPart("ilc", build_fmu("IterativeLearning")),
            FmuPart("pid", build_fmu("PID")),
            FmuPart("mass", build_fmu("Mass")),
            FmuPart("friction", build_fmu("Viscous")),
            ends,
        ]
        wires = ["reference.r -> pid.r", "reference.rd -> pid.rd", "mass.x -> pid.x", "mass.v -> pid.v"]
        wires += ["reference.r -> ilc.r", "mass.x -> ilc.x", "ilc.u -> pid.f", "ends.trial_end -> ilc.trial_end"]
        wires += ["pid.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
        values = {"pid.rdd": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0, **friction}
        return System(parts, wires, values | {f"ilc.{name}": value for name, value in gains.items()})

    ends = CallablePart(
        "ends", lambda t, u, x: float(round(t / Ts) % 1000 == 0), outputs=[Port("trial_end", type="Boolean")]
    )
    with make(ends) as system:
        result = system.run(stop=8.0, step=Ts, record=["reference.r", "mass.x"])
    error = (result["reference.r"] - result["mass.x"]).to_numpy()[:-1].reshape(8, 1000)
    rms = np.sqrt(np.mean(error**2, axis=1))
    # the second trial still has the transient of the first one's end
    assert rms[2:] / rms[1:-1] == pytest.approx([0.5] * 6, rel=0.1)


@pytest.mark.parametrize("fq", [5.0, 80.0])
def test_filter_and_learning_step(fq):
    random = np.random.default_rng(1)
    force, error = random.normal(size=(2, 200))
    expected = filtfilt(*butter(2, fq, fs=1.0 / Ts), force, padlen=0)
    assert zero_phase(force, Ts, fq) == pytest.approx(expected, abs=1e-9)
    step = learning_step(force, error, Ts, LOOP, rate=0.3, fq=fq)
    raw = force + 0.3 * inverse_process_sensitivity(error, Ts, LOOP)
    assert step == pytest.approx(filtfilt(*butter(2, fq, fs=1.0 / Ts), raw, padlen=0), rel=1e-9, abs=1e-3)


@pytest.mark.parametrize("fq", [0.0, 500.0])
def test_no_filter(fq):
    force = np.random.default_rng(2).normal(size=50)
    assert np.array_equal(zero_phase(force, Ts, fq), force)


def test_inverse_process_sensitivity_of_a_polynomial():
    """e = t^2: m 2 + Kd 2 t + Kp t^2 + Ki times the sum of the squares before, away from the ends."""
    t = Ts * np.arange(50)
    k = np.arange(50)
    squares = Ts**3 * (k - 1) * k * (2 * k - 1) / 6.0
    expected = 2.0 * LOOP.m + LOOP.Kd * 2.0 * t + LOOP.Kp * t**2 + LOOP.Ki * squares
    found = inverse_process_sensitivity(t**2, Ts, LOOP)
    assert found[1:-1] == pytest.approx(expected[1:-1], rel=1e-9)


@pytest.mark.parametrize("bad", [{"step": 3e-4}, {"rate": 2.0}, {"samples": 1}, {"trials": -1}])
def test_settings_are_checked(bad, axis):
    with pytest.raises(FrictionError, match=r"^train: "):
        run(axis("Viscous", {}), **bad)
