"""ElastoPlasticEstimator against its differential equation, and what it is for: no drift, no sample time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from observer_loops import follow, rms_error, run
from scipy.integrate import solve_ivp
from thorough import some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

LAW = next(law for law in discover_laws(laws_folder()) if law.name == "ElastoPlasticEstimator")
BuildFmu = Callable[..., Path]
Z = 1e-5  # Fc / sigma0


def along(path: Iterable[float], **values: float) -> np.ndarray:
    return np.array([result["z"] for result in run(LAW, [{"x": x} for x in path], **values)])


def slope(z: float, direction: float, elastic: float) -> float:
    """dz/dx of the documentation."""
    if z * direction <= elastic * Z:
        return 1.0
    return 1.0 - (abs(z) - elastic * Z) / (Z - elastic * Z) * abs(z) / Z


@pytest.mark.parametrize("elastic", [0.0, 0.7, 0.95])
def test_it_solves_the_differential_equation(elastic):
    corners = np.array([0.0, 1.5e-5, -0.3e-5, 0.8e-5, -4e-5, -3.6e-5, -6e-5])
    z, expected = 0.0, []
    for start, end in itertools.pairwise(corners):
        direction = float(np.sign(end - start))
        solution = solve_ivp(
            lambda p, y, d=direction: [d * slope(y[0] * Z, d, elastic)],
            (0.0, abs(end - start) / Z),
            [z / Z],
            max_step=0.01,
            rtol=1e-10,
            atol=1e-12,
        )
        z = float(solution.y[0, -1]) * Z
        expected.append(z)
    assert along(corners, elastic=elastic)[1:] == pytest.approx(expected, rel=1e-5, abs=1e-6 * Z)


@pytest.mark.parametrize("elastic", [0.0, 0.3, 0.7, 0.999])
def test_the_spacing_of_the_samples_does_not_matter(elastic):
    """One sample between reversals, or any number of them."""
    random = np.random.default_rng(2)
    corners = np.cumsum(2e-5 * random.normal(size=40))
    coarse = along(corners, elastic=elastic)
    path = [corners[0]]
    for start, end in itertools.pairwise(corners):
        between = np.sort(random.uniform(0.0, 1.0, 20))
        path += [*(start + (end - start) * between), end]
    assert along(path, elastic=elastic)[::21] == pytest.approx(coarse, abs=1e-10 * Z)


def test_it_ends_at_coulomb_friction_in_both_directions():
    found = run(LAW, [{"x": x} for x in (0.0, 1.0, 1.0, -1.0)], Fv=0.0)
    assert [result["F_hat"] for result in found] == pytest.approx([0.0, 1.0, 1.0, -1.0], rel=1e-12)


def test_small_motion_is_exactly_elastic_and_does_not_drift():
    """Thousand swings within the elastic range, after a push that left a deflection."""
    swings = 4e-6 + 2e-6 * np.sin(np.arange(5000))
    found = along([0.0, *swings])[1:]
    np.testing.assert_allclose(found, swings, atol=1e-16)


def test_no_state_is_beyond_break_away():
    path = np.cumsum(np.random.default_rng(3).normal(size=2000) * 10.0 ** np.random.default_rng(4).uniform(-7, 2, 2000))
    assert np.abs(along(path)).max() <= Z * (1.0 + 1e-12)
    assert all(math.isfinite(value) for value in LAW.evaluate({"x": 1e300, "x_last": -1e300, "running": 1.0}).values())


def test_a_start_anywhere_begins_with_zero():
    assert LAW.evaluate({"x": 0.7}) == {"u": 0.0, "F_hat": 0.0, "u_sat": 0.0, "running": 1.0, "x_last": 0.7, "z": 0.0}
    found = run(LAW, [{"x": 0.0}, {"x": 1e-3}, {"x": 5e-3, "enable": 0.0}, {"x": 7e-3}, {"x": 8e-3, "reset": 1.0}])
    assert found[1]["F_hat"] > 0.99
    assert set(found[2].values()) == {0.0}
    assert found[3]["F_hat"] == found[4]["F_hat"] == 0.0


SERVO = {"Kp": 12e4, "Kd": 600.0, "Ki": 0.0, "m": 1.0}
#: a contact without Stribeck effect and bristle damping
CONTACT = {"friction.Fs": 1.0, "friction.sigma1": 0.0}


@pytest.mark.parametrize("model", ["ElastoPlastic", "Dahl"])
@pytest.mark.parametrize("Ts", some([1e-3, 0.5e-3], [1e-3]))
def test_it_takes_friction_out_of_small_and_large_motion(build_fmu: BuildFmu, model: str, Ts: float):
    plant = CONTACT if model == "ElastoPlastic" else {"friction.Fc": 1.0, "friction.sigma": 1e5}
    law = {"elastic": 0.7, "Fv": 0.4} if model == "ElastoPlastic" else {"elastic": 0.0, "Fv": 0.0}
    for amplitude, ratio in ((3e-5, 0.5), (5e-3, 0.1)):
        sine = {"amplitude[1]": amplitude, "frequency[1]": 1.0}
        alone = rms_error(follow(build_fmu, "PID", SERVO, friction=model, start=plant, reference=sine, Ts=Ts), 1.0)
        helped = follow(
            build_fmu,
            "PID",
            SERVO,
            friction=model,
            start=plant,
            reference=sine,
            Ts=Ts,
            addition=("ElastoPlasticEstimator", law),
        )
        assert rms_error(helped, 1.0) < ratio * alone
