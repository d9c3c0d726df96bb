"""Estimators as compensators: a mass with LuGre friction under PD control, all of it FMUs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly

from harness import FmuPart, System, Wire

PRESLIDING, BETWEEN, SLIDING = 2e-6, 1e-4, 1e-2
AMPLITUDES = [PRESLIDING, BETWEEN, SLIDING]


@pytest.fixture(scope="module")
def tracking(build_fmu: Callable[..., Path]) -> Callable[..., float]:
    """``tracking(A, estimator, **parameters)``: RMS tracking error [m] of r = A (1 - cos(2 pi t))."""
    known: dict[object, float] = {}

    def rms(A: float, estimator: str = "", **parameters: float) -> float:
        key = (A, estimator, *parameters.items())
        if key not in known:
            known[key] = measure(A, estimator, parameters)
        return known[key]

    def measure(A: float, estimator: str, parameters: dict[str, float]) -> float:
        parts = [
            FmuPart("reference", build_fmu("Sine"), every=20),
            FmuPart("pd", build_fmu("PID"), every=20),
            FmuPart("mass", build_fmu("Mass")),
            FmuPart("friction", build_fmu("LuGre")),
        ]
        wires: list[str | Wire] = ["mass.x -> pd.x", "mass.v -> pd.v", "pd.u -> mass.F_drive", "mass.v -> friction.v"]
        wires += [f"reference.{name} -> pd.{name}" for name in ("r", "rd", "rdd")]
        values = {"mass.F_load": 0.0, "mass.v_support": 0.0, "pd.Ki": 0.0, "pd.m": 1.0, "friction.Fs": 1.5}
        values |= {"reference.offset": A, "reference.amplitude[1]": -A, "reference.phase[1]": np.pi / 2.0}
        if estimator:
            parts.append(FmuPart("estimator", build_fmu(estimator), every=20))
            # what was applied before this sample
            wires += ["estimator.u -> pd.f", "mass.v -> estimator.v", Wire("pd.u", "estimator.u_prev", delay=1)]
            wires += ["mass.x -> estimator.x"] if estimator == "KalmanFriction" else []
            values |= {f"estimator.{name}": value for name, value in parameters.items()}
        with System(parts, [*wires, "friction.F -> mass.F_friction"], values) as system:
            result = system.run(stop=3.0, step=5e-5, decimate=20, record=["reference.r", "mass.x"])
        error = (result["reference.r"] - result["mass.x"]).to_numpy()[1000:]
        return float(np.sqrt(np.mean(error**2)))

    return rms


@nightly
@pytest.mark.parametrize("A", AMPLITUDES)
def test_kalman_compensates_from_presliding_to_sliding(tracking, A):
    assert tracking(A, "KalmanFriction", F_step=0.3, x_noise=1e-8) < 0.05 * tracking(A)


@pytest.mark.parametrize("A", AMPLITUDES)
@pytest.mark.parametrize("estimator", ["PredictiveFilter", "DisturbanceObserver", "LocalFunctionEstimator"])
def test_every_estimator_compensates(tracking, A, estimator):
    assert tracking(A, estimator) < 0.25 * tracking(A)


@pytest.mark.parametrize("estimator", ["PredictiveFilter", "DisturbanceObserver", "LocalFunctionEstimator"])
def test_what_half_a_compensation_leaves(tracking, estimator):
    """Sliding, half the friction and half the error; in presliding half the stiffness K beside that of the loop."""
    assert tracking(SLIDING, estimator, gain=0.5) == pytest.approx(0.5 * tracking(SLIDING), rel=0.05)
    K, Kp = 1e5, 12e3
    ratio = (0.5 * K / (Kp + 0.5 * K)) / (K / (Kp + K))
    assert tracking(PRESLIDING, estimator, gain=0.5) == pytest.approx(ratio * tracking(PRESLIDING), rel=0.03)


@pytest.mark.parametrize("A", AMPLITUDES)
def test_the_filter_and_the_observer_are_one(tracking, A):
    a = 1.0 / (1.0 + (1e-3 * 1e3 / 0.5) ** 2)
    fq = -np.log(1.0 - a) / (2.0 * np.pi * 1e-3)
    assert tracking(A, "PredictiveFilter") == pytest.approx(tracking(A, "DisturbanceObserver", fq=fq), rel=1e-9)


@pytest.mark.parametrize("estimator", ["KalmanFriction", "DisturbanceObserver"])
def test_a_limited_compensation_does_not_wind_up(tracking, estimator):
    """Friction of 1 to 1.5 N, of which 0.7 N may be compensated: what is left is what PD control has to do."""
    limited = tracking(SLIDING, estimator, u_max=0.7, u_min=-0.7)
    assert limited == pytest.approx(0.3 * tracking(SLIDING), rel=0.1)
