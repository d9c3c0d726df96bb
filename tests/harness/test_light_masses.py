"""Loops that are too fast for the step: right all the same, or reported as wrong. References by scipy."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from accuracy.known import driven
from scipy.integrate import solve_ivp
from thorough import nightly, some

from harness import ExperimentError, FmuPart, Result, SeriesPart, System

BuildFmu = Callable[..., Path]

A, B, DC, V0, MU0, K, PULL = 0.005, 0.01, 1e-5, 1e-6, 0.6, 5e3, 1e-5


def pulled_rock(build_fmu: BuildFmu, mass: float) -> System:
    """A light mass that slides at 1 um/s, its spring pulled at 10 um/s from then on."""
    start = {"mass.m": mass, "mass.k": K, "mass.v_support": PULL, "mass.F_drive": 0.0}
    start |= {"mass.x_support0": MU0 / K, "mass.v0": V0}
    friction = {"a": A, "b": B, "Dc": DC, "V0": V0, "mu0": MU0, "theta": DC / V0}
    return System(
        [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("RateAndState"))],
        ["mass.v -> friction.v", "friction.F -> mass.F_friction"],
        start | {f"friction.{name}": value for name, value in friction.items()},
    )


def force_without_mass(times: np.ndarray) -> np.ndarray:
    """F where the mass does not matter: x' = V0 exp((F - mu0 - b ln(V0 theta/Dc))/a), theta' = 1 - x' theta/Dc."""

    def force(t: float, x: float) -> float:
        return MU0 + K * (PULL * t - x)

    def rates(t: float, y: np.ndarray) -> list[float]:
        v = V0 * np.exp((force(t, y[0]) - MU0 - B * y[1]) / A)
        return [v, V0 / DC * np.exp(-y[1]) - v / DC]  # of x and of ln(V0 theta/Dc)

    found = solve_ivp(rates, (0.0, times[-1]), [0.0, 0.0], "LSODA", times, rtol=1e-10, atol=1e-14)
    return np.array([force(t, x) for t, x in zip(times, found.y[0], strict=True)])


@nightly
@pytest.mark.parametrize("master", some(["newton", "adaptive"], ["newton"]))
@pytest.mark.parametrize("mass", some([1e-6, 1e-3], [1e-6]))
def test_a_light_mass_on_rate_and_state_friction(build_fmu: BuildFmu, mass: float, master: str) -> None:
    """It swings 22 times in a step (1e-6 kg), or 0.7 times, which no step resolves."""
    with pulled_rock(build_fmu, mass) as system:
        result = system.run(stop=2.0, step=2e-3, master=master)
    expected = force_without_mass(result["time"].to_numpy())
    assert expected[-1] == pytest.approx(0.596222, abs=2e-6)
    np.testing.assert_allclose(result["friction.F"], expected, atol=6e-3)  # 1 %
    assert float(np.abs(result["mass.v"]).max()) < 1.3e-5
    assert result.attrs["unresolved_error"] < 0.05


def test_a_swing_that_no_inner_step_resolves_is_reported(build_fmu: BuildFmu, caplog: pytest.LogCaptureFixture) -> None:
    """A mass of 0.1 mg on 1e6 N/m swings 5000 times in a step of 10 ms."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre"))]
    start = {"mass.m": 1e-7, "mass.k": 1e6, "mass.v_support": 1e-5, "mass.F_drive": 0.0, "mass.v0": 1.0}
    with (
        System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], start) as system,
        caplog.at_level(logging.WARNING, "harness"),
    ):
        system.run(stop=0.1, step=1e-2, master="newton")
    assert "the result is wrong; use a shorter step" in caplog.text
    assert "mass.v -> friction.v" in caplog.text or "friction.F -> mass.F_friction" in caplog.text


LOAD, KINK, STIFFNESS, DAMPING = 0.5, 0.5, 4e3, 20.0


def held_axis(build_fmu: BuildFmu) -> System:
    """A mass held by a spring and damper on LuGre friction; its load rises until 0.5 s and stays."""
    load = SeriesPart("load", [0.0, KINK, 2.0], {"F": [0.0, LOAD, LOAD]}, {"F": "N"})
    return System(
        [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre")), load],
        ["mass.v -> friction.v", "friction.F -> mass.F_friction", "load.F -> mass.F_drive"],
        {"mass.k": STIFFNESS, "mass.d": DAMPING, "mass.v_support": 0.0},
    )


def position_of_the_held_axis() -> float:
    """x(1 s) of the same equations, with the start values of LuGre."""
    sigma0, sigma1, sigma2, Fc, Fs, vs = 1e5, np.sqrt(1e5), 0.4, 1.0, 1.5, 1e-3

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v, z = y
        slip = v - sigma0 * abs(v) / (Fc + (Fs - Fc) * np.exp(-((v / vs) ** 2))) * z
        friction = sigma0 * z + sigma1 * slip + sigma2 * v
        return [v, LOAD * min(t / KINK, 1.0) - STIFFNESS * x - DAMPING * v - friction, slip]

    y = np.zeros(3)
    for begin, end in ((0.0, KINK), (KINK, 1.0)):
        y = solve_ivp(rates, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-18).y[:, -1]
    return float(y[0])


def end_of(result: Result) -> float:
    return float(result["mass.x"][-1])


def test_order_in_presliding_after_a_kink_of_the_load(build_fmu: BuildFmu) -> None:
    """Second order, as far as the contact's own period (14 ms) is resolved and the loop is solved well."""
    exact = position_of_the_held_axis()
    with held_axis(build_fmu) as system:
        runs = [system.run(stop=1.0, step=h, master="newton", loop_tolerance=1e-11) for h in (2e-3, 1e-3, 5e-4)]
    errors = np.array([abs(end_of(run) - exact) for run in runs])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.15)


def test_tolerance_of_loops_sets_what_remains(build_fmu: BuildFmu) -> None:
    """At steps as short as 1/16 ms the residuals are the larger error."""
    exact = position_of_the_held_axis()
    with held_axis(build_fmu) as system:
        errors = [
            abs(end_of(system.run(stop=1.0, step=6.25e-5, master="newton", loop_tolerance=tolerance)) - exact)
            for tolerance in (1e-5, 1e-11)
        ]
    assert errors[1] < 0.1 * errors[0]


@pytest.mark.parametrize("tolerance", [0.0, -1e-9, 1.0, float("nan"), float("inf")])
def test_a_tolerance_of_loops_that_makes_no_sense(build_fmu: BuildFmu, tolerance: float) -> None:
    with held_axis(build_fmu) as system, pytest.raises(ExperimentError, match=r"give a number from 1e-14 to 0\.01"):
        system.run(stop=1.0, step=1e-3, master="newton", loop_tolerance=tolerance)


def test_tolerance_of_steps_sets_which_are_divided() -> None:
    """The force of two sines kinks nowhere, but break-aways are faster than the step."""
    with driven("LuGre", 9.0) as system:
        fine = system.run(stop=1.0, step=1e-5, master="newton", decimate=100, loop_tolerance=1e-11)
        runs = [system.run(stop=1.0, step=1e-3, master="newton", step_tolerance=each) for each in (0.05, 1e-3, 1e-4)]
        with pytest.raises(ExperimentError, match=r"the tolerance of steps is 0\.0: give a number from 1e-6 to 0\.5"):
            system.run(stop=1.0, step=1e-3, master="newton", step_tolerance=0.0)
    divided = [int(run.attrs["substeps"]) for run in runs]
    forces = [run["friction.F"].to_numpy() for run in (fine, *runs)]
    errors = [float(np.abs(force - forces[0]).max()) for force in forces[1:]]
    assert divided[0] < divided[1] < divided[2]
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.1 * errors[0]
