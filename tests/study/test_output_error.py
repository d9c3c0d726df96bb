"""Output-error fits, on simulations that are closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from friction_fmus.identification import Array, ExcitationError, FitError
from friction_fmus.identification.fit.output_error import OutputErrorFit, TargetSignal, Unknown, fit_output_error

T = np.linspace(0.0, 3.0, 601)
TRUTH = {"a": 2.0, "tau": 0.7}
UNKNOWNS = [Unknown("a", 1.4, 0.02, "m"), Unknown("tau", 1.0, 0.01, "s", lower=0.1)]


def decay(parameters: Mapping[str, float]) -> dict[str, Array]:
    x = parameters["a"] * np.exp(-T / parameters["tau"])
    return {"x": x, "v": -x / parameters["tau"]}


def target(noise: float = 0.0, seed: int = 0) -> TargetSignal:
    error = noise * np.random.default_rng(seed).standard_normal(len(T))
    return TargetSignal(decay(TRUTH)["x"] + error, 1.0)


def fit(noise: float = 0.0, seed: int = 0) -> OutputErrorFit:
    return fit_output_error(decay, UNKNOWNS, {"x": target(noise, seed)}, correlation=0)


def test_the_truth_is_found() -> None:
    found = fit_output_error(decay, UNKNOWNS, {"x": target()}, tolerance=1e-8, max_iterations=30)
    assert found.values() == pytest.approx(TRUTH, rel=1e-4)
    assert found.converged
    assert found.rms["x"] < 1e-4


def test_two_targets_are_weighed_by_their_scales() -> None:
    targets = {"x": target(), "v": TargetSignal(decay({"a": 2.0, "tau": 0.8})["v"], 1e3)}
    assert fit_output_error(decay, UNKNOWNS, targets).values() == pytest.approx(TRUTH, rel=1e-2)


def test_standard_errors_are_the_scatter_of_the_estimates() -> None:
    fits = [fit(0.05, seed) for seed in range(60)]
    for name in TRUTH:
        scatter = np.std([found.parameters[name].value for found in fits])
        for error in (
            np.mean([found.parameters[name].standard_error for found in fits]),
            np.mean([found.classic_errors[name] for found in fits]),
        ):
            assert error == pytest.approx(scatter, rel=0.3)


def test_robust_errors_see_that_neighbouring_residuals_are_alike() -> None:
    slow = np.repeat(np.random.default_rng(3).standard_normal(41), 15)[: len(T)]
    targets = {"x": TargetSignal(decay(TRUTH)["x"] + 0.05 * slow, 1.0)}
    found = fit_output_error(decay, UNKNOWNS, targets, correlation=60)
    assert found.parameters["a"].standard_error > 2.0 * found.classic_errors["a"]


def test_bounds_hold() -> None:
    unknowns = [UNKNOWNS[0], replace(UNKNOWNS[1], lower=0.9, upper=1.1)]
    found = fit_output_error(decay, unknowns, {"x": target()})
    assert 0.9 <= found.values()["tau"] <= 1.1


def test_samples_before_the_first_do_not_count() -> None:
    spoiled = target().measured.copy()
    spoiled[:50] += 100.0
    found = fit_output_error(decay, UNKNOWNS, {"x": TargetSignal(spoiled, 1.0, first=50)})
    assert found.values() == pytest.approx(TRUTH, rel=1e-2)


def test_a_parameter_without_effect_is_refused() -> None:
    with pytest.raises(ExcitationError, match="does not depend on mass"):
        fit_output_error(decay, [*UNKNOWNS, Unknown("mass", 1.0, 0.1, "kg")], {"x": target()})


def test_parameters_that_cannot_be_told_apart_are_refused() -> None:
    def product(parameters: Mapping[str, float]) -> dict[str, Array]:
        return {"x": (parameters["a"] + parameters["b"]) * np.exp(-T)}

    unknowns = [Unknown("a", 1.0, 0.1, "m"), Unknown("b", 1.0, 0.1, "m")]
    with pytest.raises(ExcitationError, match="a and b to be separated"):
        fit_output_error(product, unknowns, {"x": target()})


@pytest.mark.parametrize(
    ("unknowns", "targets", "complaint"),
    [
        ([], {"x": target()}, "at least one unknown"),
        (UNKNOWNS, {}, "at least one unknown and one target"),
        ([UNKNOWNS[0], UNKNOWNS[0]], {"x": target()}, "contain a name twice"),
        ([replace(UNKNOWNS[0], step=0.0)], {"x": target()}, "step of a"),
        ([replace(UNKNOWNS[0], lower=5.0)], {"x": target()}, "start value 1.4 of a is outside"),
        (UNKNOWNS, {"x": TargetSignal(target().measured, 0.0)}, "scale of the target 'x'"),
        (UNKNOWNS, {"x": TargetSignal(target().measured, 1.0, first=601)}, "sample 601, but has only 601"),
        (UNKNOWNS, {"y": target()}, "returned x, v, but not 'y'"),
        (UNKNOWNS, {"x": TargetSignal(np.zeros(5), 1.0)}, "shape"),
    ],
)
def test_wrong_set_ups_are_refused(unknowns: list[Unknown], targets: dict[str, TargetSignal], complaint: str) -> None:
    with pytest.raises(FitError, match=complaint):
        fit_output_error(decay, unknowns, targets)


def test_a_simulation_that_blows_up_is_refused() -> None:
    def unstable(parameters: Mapping[str, float]) -> dict[str, Array]:
        return {"x": np.where(T > 1.0, np.nan, 0.0)}

    with pytest.raises(FitError, match="not finite from sample 201"):
        fit_output_error(unstable, UNKNOWNS, {"x": target()})
