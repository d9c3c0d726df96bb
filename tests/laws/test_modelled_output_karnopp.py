"""ModelledOutputKarnopp against a recursion, Routh's condition, and in the loop with wrong models and loads."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from observer_loops import follow, rms_error, run

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws
from harness import SeriesPart

LAW = next(law for law in discover_laws(laws_folder()) if law.name == "ModelledOutputKarnopp")
BuildFmu = Callable[..., Path]
SLOW = {"amplitude[1]": 1e-3, "frequency[1]": 0.5}
FAST = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}


def test_it_is_its_recursion():
    random = np.random.default_rng(1)
    sizes = {"r": 1e-3, "rd": 1e-2, "rdd": 1.0, "x": 1e-3, "v": 1e-2}
    samples = [{name: size * random.normal() for name, size in sizes.items()} for _ in range(300)]
    settings = {"m": 0.5, "KP": 20.0, "CV": 50.0, "Kv1": 0.8, "Ka": 4.0, "Kv2": 2.0, "Fv": 3.0, "DV": 5e-3, "gain": 0.9}
    found = run(LAW, samples, Ts=2e-3, u_max=6.0, **settings)
    model, inside, clipped = 0.0, 0, 0
    for sample, result in zip(samples, found, strict=True):
        Vs = 20.0 * (sample["r"] - sample["x"]) + 0.8 * sample["rd"]
        drive = 50.0 * (Vs - model)
        stuck = abs(model) < 5e-3
        friction = min(max(drive, -1.5), 1.5) if stuck else math.copysign(1.0, model) + 3.0 * model
        u = 50.0 * (Vs - sample["v"]) + 4.0 * sample["rdd"] + 2.0 * sample["rd"] + 0.9 * friction
        assert result["F_hat"] == pytest.approx(friction, rel=1e-9, abs=1e-12)
        assert result["u"] == pytest.approx(min(u, 6.0), rel=1e-9, abs=1e-12)
        inside += stuck
        clipped += stuck and abs(drive) > 1.5
        model = Vs + (model - Vs) * math.exp(-50.0 * 2e-3 / 0.5)
        assert result["v_model"] == pytest.approx(model, rel=1e-9, abs=1e-15)
    assert 20 < inside < 280
    assert clipped > 0


@pytest.mark.parametrize("M", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("m", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("KP", [1.0, 1000.0])
def test_within_the_band_the_loop_is_stable(M, m, KP):
    """Roots of (1 + s m/CV) (M s^2 + CV s + CV KP) + m s KP, and Routh's condition of it."""
    CV = 127.0
    poles = np.roots([M * m / CV, M + m, CV + 2.0 * m * KP, CV * KP])
    expanded = np.polyadd(np.polymul([m / CV, 1.0], [M, CV, CV * KP]), [m * KP, 0.0])
    np.testing.assert_allclose(expanded, [M * m / CV, M + m, CV + 2.0 * m * KP, CV * KP], rtol=1e-12)
    assert (poles.real < 0.0).all()
    assert (M + m) * (CV + 2.0 * m * KP) > M * m * KP


def test_reset_and_enable():
    on, off = {"r": 1e-3, "rd": 0.01}, {"r": 1e-3, "rd": 0.01, "enable": 0.0}
    fresh = run(LAW, [on])[0]
    found = run(LAW, [on] * 5 + [off, on, {**on, "reset": 1.0}])
    assert set(found[5].values()) == {0.0}
    assert found[6] == fresh
    assert found[7]["u"] == fresh["u"]


def test_it_comes_to_rest_also_on_a_mass_without_friction(build_fmu: BuildFmu):
    still = {"amplitude[1]": 0.0}
    for friction in ("LuGre", None):
        result = follow(
            build_fmu,
            "ModelledOutputKarnopp",
            {},
            reference=still,
            friction=friction,
            start={"mass.v0": 0.05},
            stop=3.0,
        )
        assert np.abs(result["mass.v"].to_numpy()[2500:]).max() < 1e-9


def test_it_does_as_well_as_the_same_friction_of_the_reference(build_fmu: BuildFmu):
    """In slow motion, and the mass of the model hardly matters there, as the command feedforward is on."""
    cascade = {"kp": 63.0, "kv": 127.0, "ki": 0.0, "m": 1.0}
    forward = ("StaticFeedforward", {"m": 0.0, "Fs": 1.0})
    of_reference = rms_error(follow(build_fmu, "CascadePPI", cascade, addition=forward, reference=SLOW, stop=4.0), 2.0)
    none = rms_error(follow(build_fmu, "ModelledOutputKarnopp", {"gain": 0.0}, reference=SLOW, stop=4.0), 2.0)
    errors = [
        rms_error(follow(build_fmu, "ModelledOutputKarnopp", {"m": m}, reference=SLOW, stop=4.0), 2.0)
        for m in (1.0, 2.0, 0.5)
    ]
    assert errors[0] == pytest.approx(of_reference, rel=0.2)
    assert errors[0] < 0.2 * none
    assert errors[1:] == pytest.approx([errors[0]] * 2, rel=0.05)


def test_an_unknown_load_takes_the_compensation_away(build_fmu: BuildFmu):
    """5 N from 2 s on: stable, but the swing of the error grows by far; and by Vs the model follows r - x, not x."""
    times = 1e-3 * np.arange(4001)
    load = SeriesPart("load", times, {"F": np.where(times < 1.9999, 0.0, -5.0)}, {"F": "N"}, interpolation="previous")
    result = follow(
        build_fmu,
        "ModelledOutputKarnopp",
        {},
        reference=FAST,
        others=[load],
        wires=["load.F -> mass.F_load"],
        stop=4.0,
    )
    error = (result["reference.r"] - result["mass.x"]).to_numpy()
    assert np.std(error[3000:]) > 10.0 * np.std(error[1000:2000])
    assert np.mean(error[3000:]) == pytest.approx(5.0 / (127.0 * 63.0), rel=0.15)
    assert np.abs(error[3000:]).max() < 1e-3
