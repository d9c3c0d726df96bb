"""AdaptiveSlidingMode against a recursion, its Lyapunov function, and in the loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from observer_loops import follow, rms_error, run
from thorough import nightly

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

LAW = next(law for law in discover_laws(laws_folder()) if law.name == "AdaptiveSlidingMode")
BuildFmu = Callable[..., Path]


def test_it_is_its_recursion():
    random = np.random.default_rng(1)
    n, limit, Ts = 300, 60.0, 1e-3
    sizes = {"r": 3e-3, "rd": 0.05, "rdd": 1.0, "x": 3e-3, "v": 0.05}
    given = {name: size * random.normal(size=n) for name, size in sizes.items()}
    given["rd"][::9] = 0.0
    samples = [{name: float(values[k]) for name, values in given.items()} for k in range(n)]
    settings = {"phi": 0.03, "Gamma_c": 3000.0, "Gamma_v": 4e4, "Fc_max": 1.4, "Fv_max": 2.0, "gain": 0.9, "m": 2.0}
    found = run(LAW, samples, u_min=-limit, u_max=limit, Ts=Ts, **settings)
    Fc, Fv, met, stopped = 1.0, 0.4, set(), {"layer": 0, "limit": 0}
    for sample, result in zip(samples, found, strict=True):
        rd, ed = sample["rd"], sample["rd"] - sample["v"]
        s, sign = ed + 63.0 * (sample["r"] - sample["x"]), float(np.sign(sample["rd"]))
        F_hat = (Fc + 0.5 * math.exp(-((rd / 1e-3) ** 2))) * sign + Fv * rd
        u = 2.0 * (sample["rdd"] + 63.0 * ed) + 127.0 * s + 0.5 * max(-1.0, min(1.0, s / 0.03)) + 0.9 * F_hat
        assert result["F_hat"] == pytest.approx(F_hat, abs=1e-11)
        assert result["u"] == pytest.approx(max(-limit, min(limit, u)), abs=1e-10)
        assert (result["Fc_hat"], result["Fv_hat"]) == pytest.approx((Fc, Fv), rel=1e-10)
        layer, limited = abs(s) <= 0.03, abs(u) > limit and u * s > 0.0
        stopped["layer"] += layer
        stopped["limit"] += limited
        if not layer and not limited:
            Fc = max(0.0, min(1.4, Fc + Ts * 3000.0 * s * sign))
            Fv = max(0.0, min(2.0, Fv + Ts * 4e4 * s * rd))
            met |= {Fc, Fv} & {0.0, 1.4, 2.0}
    assert met == {0.0, 1.4, 2.0}
    assert min(stopped.values()) > 10


def test_at_rest_no_friction_is_compensated():
    assert LAW.evaluate({"Fc0": 3.0})["F_hat"] == 0.0
    assert LAW.evaluate({"Fc0": 3.0, "rd": 1e-12})["F_hat"] == pytest.approx(3.5, rel=1e-9)


@nightly
def test_the_lyapunov_function_falls_and_the_error_ends_in_the_layer():
    """A mass whose friction follows the reference velocity, with wrong first estimates, at 20 kHz."""
    Ts, m, lam, Fc, Fv, phi = 5e-5, 1.0, 63.0, 2.5, 6.0, 1e-3
    speeds = {"Gamma_c": 2e4, "Gamma_v": 2e6}
    w, A, x, v = 20.0, 5e-3, 0.0, 0.0
    states = {"learned_c": 0.0, "learned_v": 0.0}
    V, late = [], []
    for k in range(8000):
        t = k * Ts
        r, rd, rdd = A * math.sin(w * t), A * w * math.cos(w * t), -A * w**2 * math.sin(w * t)
        s = rd - v + lam * (r - x)
        found = LAW.evaluate(
            {**states, "r": r, "rd": rd, "rdd": rdd, "x": x, "v": v, "Ts": Ts, "excess": 0.0, "phi": phi, **speeds}
        )
        errors = Fc - found["Fc_hat"], Fv - found["Fv_hat"]
        V.append(m * s**2 / 2.0 + errors[0] ** 2 / (2.0 * 2e4) + errors[1] ** 2 / (2.0 * 2e6))
        late.append(abs(s))
        states = {name: found[name] for name in states}
        a = (found["u"] - Fc * np.sign(rd) - Fv * rd) / m
        x, v = x + Ts * v + Ts**2 / 2.0 * a, v + Ts * a
    outside = np.array(late[:-1]) > phi
    growth = np.diff(V)[outside]
    assert outside.sum() > 20
    assert growth[growth > 0.0].sum() < 0.02 * V[0]
    # the friction that rd jumps over between two samples pushes s out for moments at most
    assert np.mean(np.array(late[4000:]) <= 1.05 * phi) == 1.0


def test_reset_and_enable():
    on, off = {"r": 0.1, "rd": 0.01}, {"r": 0.1, "rd": 0.01, "enable": 0.0}
    fresh = run(LAW, [on])[0]
    found = run(LAW, [on] * 10 + [off] * 2 + [on, {**on, "reset": 1.0}])
    assert found[9]["Fc_hat"] != fresh["Fc_hat"]
    assert found[11] | {"Fc_hat": 0.0, "Fv_hat": 0.0} == dict.fromkeys(found[11], 0.0)
    assert (found[11]["Fc_hat"], found[11]["Fv_hat"]) == (1.0, 0.4)
    assert found[12] == fresh
    assert found[13]["u"] == fresh["u"]


ONE = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}


def test_tracking_converges_but_parameters_do_not(build_fmu: BuildFmu):
    """Three times the expected friction: the error falls by far, the estimates end wrong."""
    plant = {"friction.Fc": 3.0, "friction.Fs": 3.5, "friction.sigma2": 2.0}
    fixed = follow(
        build_fmu, "AdaptiveSlidingMode", {"Gamma_c": 0.0, "Gamma_v": 0.0}, reference=ONE, start=plant, stop=6.0
    )
    result = follow(build_fmu, "AdaptiveSlidingMode", {}, reference=ONE, start=plant, stop=6.0)
    assert rms_error(result, 4.0) < 0.3 * rms_error(fixed, 4.0)
    wrong = abs(float(result["servo.Fc_hat"][-1]) - 3.0) / 3.0, abs(float(result["servo.Fv_hat"][-1]) - 2.0) / 2.0
    assert max(wrong) > 0.2


def test_several_speeds_bring_the_estimates_nearer(build_fmu: BuildFmu):
    plant = {"friction.Fc": 3.0, "friction.Fs": 3.0, "friction.vs": 1e-3, "friction.sigma2": 20.0}
    law = {"excess": 0.0, "K": 0.0, "phi": 1e-5, "Gamma_v": 2e5}
    many = ONE | {"amplitude[2]": 1e-2, "frequency[2]": 2.7, "amplitude[3]": 5e-3, "frequency[3]": 0.4}
    excited = follow(build_fmu, "AdaptiveSlidingMode", law, reference=many, start=plant, stop=15.0)
    assert float(excited["servo.Fc_hat"][-1]) == pytest.approx(3.0, rel=0.1)
    assert float(excited["servo.Fv_hat"][-1]) == pytest.approx(20.0, rel=0.1)
