"""MultiLoopKarnopp against Tustin's rule of scipy, ModelledOutputKarnopp, and the poles of the continuous loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from observer_loops import follow, rms_error
from scipy.signal import bilinear, freqz, lfilter
from shell.instance import Instance, load
from thorough import nightly, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.conditions import chain, one_mass
from friction_fmus.lawkit.law import Kind, Law, discover_laws
from friction_fmus.study.margins import linearised

BuildFmu = Callable[..., Path]
KNOWN = {law.name: law for law in discover_laws(laws_folder())}
LAW = KNOWN["MultiLoopKarnopp"]
TS = 1e-3
LOOPS = {
    "gain and mass": (([127.0], [1.0]), ([1.0], [1.0, 0.0])),
    "PI and damped mass": (([127.0, 8e3], [1.0, 0.0]), ([1.0], [0.8, 2.0])),
    "PI with lead-lag, lagging mass": (([1.0, 90.0, 3e3], [2e-3, 1.0, 0.0]), ([1.0], [2e-3, 1.0, 0.0])),
    "third order, two masses": (
        ([60.0, 3e4, 4e6, 1e8], [1.0, 500.0, 9e4, 0.0]),
        ([0.3, 5.0, 4e4], [0.21, 5.0, 4e4, 0.0]),
    ),
}
"""Numerator and denominator of CV and of G."""


def padded(first: list[float], second: list[float], order: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Numerator and denominator from the same power of s on, with zeros at the end."""
    degree = len(second) - 1
    found = [[0.0] * (degree + 1 - len(each)) + each + [0.0] * (order - degree) for each in (first, second)]
    return tuple(found[0]), tuple(found[1])


def of_loop(name: str, **others: float) -> tuple[Law, dict[str, Any]]:
    """The law with room for a loop, and its parameters."""
    CV, G = LOOPS[name]
    order = max(len(CV[1]), len(G[1])) - 1
    law = LAW.with_room({"order": float(order)})
    room = len(next(v for v in law.variables if v.name == "CV_num").starts) - 1
    (CV_num, CV_den), (G_num, G_den) = padded(*CV, room), padded(*G, room)
    return law, {"CV_num": CV_num, "CV_den": CV_den, "G_num": G_num, "G_den": G_den, "Ts": TS, **others}


def run(law: Law, samples: list[dict[str, float]], values: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    states: dict[str, Any] = {v.name: v.start for v in law.select(Kind.STATE, Kind.STATES)}
    for sample in samples:
        found = law.evaluate({**values, **states, **sample})
        states = {name: found[name] for name in states}
        yield found


def product(first: tuple[list[float], list[float]], second: tuple[list[float], list[float]]) -> tuple[Any, Any]:
    return np.polymul(first[0], second[0]), np.polymul(first[1], second[1])


@pytest.mark.parametrize("name", some([*LOOPS], [*LOOPS][::4]))
def test_its_loops_have_the_frequency_responses_of_tustins_rule(name: str):
    """Responses to an impulse, by scipy from the product of the polynomials; and their transforms against freqz."""
    law, values = of_loop(name, Kv1=1.0, KP=0.0, Ka=0.0, Kv2=0.0, gain=0.0, u_max=1e9, u_min=-1e9)
    CV, G = LOOPS[name]
    num, den = product(CV, G)
    closed = bilinear(num, np.polyadd(den, num), 1.0 / TS)
    n = 3000
    impulse = np.eye(1, n)[0]
    found = list(run(law, [{"rd": value} for value in impulse], values))
    modelled, control = (np.array([row[key] for row in found]) for key in ("v_model", "u"))
    expected = lfilter(*closed, impulse)
    assert np.abs(modelled - expected).max() <= 1e-9 * np.abs(expected).max()
    assert np.abs(expected[-100:]).max() <= 1e-9 * np.abs(expected).max()  # settled: the transform is complete
    response = np.fft.rfft(modelled)
    omega = 2.0 * np.pi * np.arange(response.size) / n
    exact = freqz(*closed, worN=omega)[1]
    assert np.abs(response - exact).max() <= 1e-9 * np.abs(exact).max()
    open_loop = lfilter(*bilinear(*CV, 1.0 / TS), impulse)
    assert np.abs(control - open_loop).max() <= 1e-9 * np.abs(open_loop).max()


def test_with_a_gain_and_a_mass_its_force_is_that_of_modelled_output_karnopp():
    """Bit for bit, without F_hat, whose velocity is one sample older there."""
    random = np.random.default_rng(2)
    sizes = {"r": 1e-3, "rd": 1e-2, "rdd": 1.0, "x": 1e-3, "v": 1e-2}
    samples = [{name: size * random.normal() for name, size in sizes.items()} for _ in range(300)]
    mine, theirs = (list(run(law, samples, {"gain": 0.0})) for law in (LAW, KNOWN["ModelledOutputKarnopp"]))
    assert [row["u"] for row in mine] == [row["u"] for row in theirs]


@nightly
@pytest.mark.parametrize("sample", [1e-3, 1e-4])
def test_with_a_gain_and_a_mass_its_friction_tends_to_that_of_modelled_output_karnopp(sample: float):
    """The modelled velocities differ by less than 0.6 samples of the fastest change."""
    t = sample * np.arange(round(0.2 / sample))
    samples = [{"rd": value} for value in 0.02 * np.sin(2.0 * np.pi * 5.0 * t)]
    settings = {"m": 0.5}, {"G_den": (0.5, 0.0, 0.0)}
    theirs = [row["v_model"] for row in run(KNOWN["ModelledOutputKarnopp"], samples, settings[0] | {"Ts": sample})]
    mine = [row["v_model"] for row in run(LAW, samples, settings[1] | {"Ts": sample})]
    assert np.abs(np.subtract(mine, theirs)).max() < 0.6 * sample * 0.02 * 2.0 * np.pi * 5.0


@pytest.mark.parametrize("name", ["gain and mass", "PI and damped mass"])
def test_with_the_acceleration_the_model_follows_the_reference(name: str):
    """Exactly, for a mass and a velocity that is the trapezoidal integral of the acceleration."""
    law, values = of_loop(name, Ka_model=0.8)
    values |= {"G_num": (0.0, 1.0, 0.0), "G_den": (0.8, 0.0, 0.0)}
    rdd = np.random.default_rng(3).normal(size=400)
    rd = np.concatenate([[0.0], np.cumsum(rdd[1:] + rdd[:-1])]) * TS / 2.0 + TS / 2.0 * rdd[0]
    found = [row["v_model"] for row in run(law, [{"rd": a, "rdd": b} for a, b in zip(rd, rdd, strict=True)], values)]
    assert np.abs(np.array(found) - rd).max() < 1e-12


@pytest.mark.parametrize(("KP", "ki"), [(63.0, 0.0), (63.0, 8e3), (400.0, 8e3)])
def test_within_the_band_the_loop_has_the_poles_of_its_polynomial(KP: float, ki: float):
    """M s^2 + CV (s + KP) + KP CV/(1 + CV G) = 0 for CV = kv + ki/s and G = 1/(m s), against the sampled loop."""
    kv, m, M, sample = 127.0, 0.7, 1.3, 2e-5
    CV, one = [kv, ki], [1.0, 0.0]
    # times s (m s^2 + kv s + ki)
    loop = np.polyadd(np.polymul([M, 0.0, 0.0, 0.0], [m, kv, ki]), np.polymul(np.polymul(CV, [1.0, KP]), [m, kv, ki]))
    expected = np.roots(np.polyadd(loop, KP * np.polymul(np.polymul(CV, one), [m, 0.0])))
    values = {"KP": KP, "CV_num_1": kv, "CV_num_2": ki, "G_den_1": m, "DV": 1.0, "Fs": 1e9, "u_max": 1e9, "u_min": -1e9}
    law = linearised("MultiLoopKarnopp", values, sample)
    z = np.linalg.eigvals(chain(one_mass(M), [law], sample))
    found = np.log(z[np.abs(z) > 0.5].astype(complex)) / sample
    for pole in expected[np.abs(expected) > 1e-6]:
        assert np.abs(found - pole).min() < 5e-3 * abs(pole)
    assert (found.real.max() < 0.0) == (expected[np.abs(expected) > 1e-6].real.max() < 0.0)


def test_reset_and_enable():
    _, values = of_loop("PI and damped mass")
    on, off = {"r": 1e-3, "rd": 0.01}, {"r": 1e-3, "rd": 0.01, "enable": 0.0}
    (fresh,) = run(LAW, [on], values)
    found = list(run(LAW, [on] * 5 + [off, on, {**on, "reset": 1.0}], values))
    assert {value for key, value in found[5].items() if not isinstance(value, tuple)} == {0.0}
    assert found[6] == fresh
    assert found[7] == fresh


def test_a_built_fmu_has_the_order_that_it_was_built_for(build_fmu: BuildFmu):
    law, values = of_loop("third order, two masses")
    elements = {
        f"{key}[{i + 1}]": number
        for key, numbers in values.items()
        if isinstance(numbers, tuple)
        for i, number in enumerate(numbers)
    }
    library = load(build_fmu("MultiLoopKarnopp", order=3.0, **elements))
    random = np.random.default_rng(4)
    samples = [{"r": 1e-4 * random.normal(), "rd": 1e-2 * random.normal()} for _ in range(100)]
    with Instance(library) as fmu:
        fmu.initialise()
        for k, (sample, expected) in enumerate(zip(samples, run(law, samples, values), strict=True)):
            fmu.set(sample)
            fmu.step(k * TS, TS)
            for name in ("u", "v_model", "F_hat"):
                assert fmu.get(name)[0] == pytest.approx(expected[name], rel=1e-12, abs=1e-15)


def test_the_acceleration_into_the_model_removes_its_lag(build_fmu: BuildFmu):
    """Where the lag m/CV hurts, at 63 mm/s: with it the error is nearly that with friction of the reference."""
    fast = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}
    cascade = {"kp": 63.0, "kv": 127.0, "ki": 0.0, "m": 0.0}
    forward = ("KarnoppFeedforward", {"m": 1.0, "Fv": 0.4, "DV": 1e-4})
    reference = rms_error(follow(build_fmu, "CascadePPI", cascade, addition=forward, reference=fast), 1.0)
    without, with_it = (
        rms_error(follow(build_fmu, "MultiLoopKarnopp", {"DV": 1e-4, "Ka_model": m}, reference=fast), 1.0)
        for m in (0.0, 1.0)
    )
    assert with_it == pytest.approx(reference, rel=0.2)
    assert without > 1.3 * reference
