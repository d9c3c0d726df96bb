"""Static friction below the Coulomb friction, explained by the points near rest; ties between models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contacts import noise, stribeck_force
from thorough import nightly

from friction_fmus.identification import LINEAR, Record, compare_models, identify
from friction_fmus.identification.identifying import explanation
from friction_fmus.identification.model_comparison import IdentificationTask
from friction_fmus.study.model_ranking import IdentifiedModel, ranked
from friction_fmus.study.study_result import IdentifiedParameter, ModelResult

V = np.linspace(-0.1, 0.1, 4001)
CURVE = {"Fc": 10.0, "Fs": 6.0, "vs": 0.02, "Fv": 30.0}


def test_friction_that_grows_from_rest_on_explains_it() -> None:
    text = explanation(CURVE, V, stribeck_force(V, 10.0, 6.0, 0.02, 30.0), LINEAR)
    # the mean of 10 - 4 exp(-(v/vs)^2) over 0.1 to 1 and over 2 to 4 times vs
    x, y = np.linspace(0.1, 1.0, 10_001), np.linspace(2.0, 4.0, 10_001)
    low, high = (10.0 - 4.0 * np.mean(np.exp(-(part**2))) for part in (x, y))
    assert f"{low:.3g} N" in text
    assert f"{high:.3g} N" in text
    assert "shows no Stribeck effect, or presliding after reversals hides it" in text


def test_only_a_model_with_presliding_knows_that_presliding_does_not_hide_it() -> None:
    """On an axis with LuGre friction and Fs above Fc, the friction after a reversal is below Fc as well."""
    force = stribeck_force(V, 10.0, 6.0, 0.02, 30.0)
    assert "shows no Stribeck effect; " in explanation(CURVE | {"sigma0": 1e6}, V, force, LINEAR)


def test_points_that_contradict_it_or_are_missing_are_reported() -> None:
    assert "is not smaller" in explanation(CURVE, V, stribeck_force(V, 10.0, 10.0, 0.02, 30.0) + 0.1, LINEAR)
    fast = np.abs(V) > 0.019
    few = explanation(CURVE, V[fast], stribeck_force(V[fast], 10.0, 6.0, 0.02, 30.0), LINEAR)
    assert "points between 0.002 and 0.02 m/s" not in few or "measure slow" in few


@pytest.mark.parametrize("parameters", [{"Fc": 1.0, "Fs": 1.2, "vs": 1e-3}, {"Fc": 1.0, "Fs": 0.5}, {"Fc": 1.0}])
def test_others_need_no_explanation(parameters: dict[str, float]) -> None:
    assert explanation(parameters, V, V, LINEAR) == ""


def axis(Fs: float) -> Record:
    # no sample lies on a reversal, where the sign of v = 1e-17 would be noise of 2 Fc, which Stribeck predicts better
    t = 1e-3 * np.arange(12_000) + 3e-4
    v = 0.1 * np.sin(2.0 * np.pi * 0.5 * t) * np.sin(2.0 * np.pi * 0.07 * t)
    q = np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * 1e-3))
    force = 8.0 * np.gradient(v, 1e-3) + stribeck_force(v, 10.0, Fs, 0.02, 30.0) + noise(1, len(t), 0.05)
    return Record("axis", t, q=q, force=force)


@nightly
def test_the_warning_of_an_identification() -> None:
    (warning,) = identify("Stribeck", axis(6.0)).warnings
    assert warning.startswith("Fs is below Fc: this axis shows no Stribeck effect, or presliding ")
    assert identify("Stribeck", axis(14.0)).warnings == ()


def test_of_models_with_equal_errors_the_one_with_fewer_parameters_comes_first() -> None:
    """Without a Stribeck effect, Stribeck predicts what Coulomb with a viscous part predicts."""
    record = axis(10.0)
    task = IdentificationTask((record.window(0.0, 6.0),), (record.window(6.0, 12.0),), options={"viscous": True})
    found = compare_models(["Stribeck", "Coulomb"], task, workers=1)
    assert [result.model for result in found.results] == ["Coulomb", "Stribeck"]


def test_of_models_of_a_study_with_equal_errors_the_simpler_one_comes_first() -> None:
    parameters = tuple(IdentifiedParameter(name, 1.0, 0.1, "N", "") for name in "abcd")
    rich = IdentifiedModel(ModelResult("rich", "", parameters=parameters, bic=1.0), error=1.0)
    plain = IdentifiedModel(ModelResult("plain", "", parameters=parameters[:2], bic=2.0), error=1.04)
    assert [model.row.name for model in ranked([rich, plain])] == ["plain", "rich"]
    worse = replace(plain, error=1.06)
    assert [model.row.name for model in ranked([rich, worse])] == ["rich", "plain"]
    assert [model.row.name for model in ranked([rich, worse], resolution=0.3)] == ["rich", "plain"]
    assert [model.row.name for model in ranked([rich, worse], resolution=0.4)] == ["plain", "rich"]
