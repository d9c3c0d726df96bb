"""Feedforward by Leuven's model and the modified one: the friction blocks along a sampled reference.

The sample time and all velocities are dyadic numbers, so that r[k] - r[k-1] = v Ts without rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shell.instance import Instance, Library, load
from thorough import few

TS = 2.0**-10
UNIT = 2.0**-22  # [m/s] of the velocities
NAMES = ("LeuvenFeedforward", "ModifiedLeuvenFeedforward")

reproducibly = settings(max_examples=few(40), deadline=20_000, derandomize=True, database=None)
speeds = st.one_of(st.integers(-(2**10), 2**10), st.integers(-(2**16), 2**16), st.sampled_from([0, 1, -1]))
velocities = st.lists(st.builds(lambda n: n * UNIT, speeds), min_size=1, max_size=30)
stribeck = {
    "Fc": st.floats(0.5, 1.4),
    "Fs": st.floats(0.5, 1.4),
    "vs": st.floats(1e-4, 0.1),
    "n": st.sampled_from([0.7, 1.0, 1.6, 2.0, 5.0]),
    "sigma1": st.floats(0.0, 400.0),
    "sigma2": st.floats(0.0, 4.0),
}


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> Callable[[str], Library]:
    libraries = {name: load(build_fmu(name)) for name in NAMES}  # it takes seconds, too long for an example
    return lambda name: libraries.get(name) or load(build_fmu(name))


def run(library: Library, samples: list[dict[str, float]], *names: str, **parameters: float) -> np.ndarray:
    """Variables after every sample."""
    found = []
    with Instance(library) as law:
        law.initialise(Ts=TS, u_min=-1e30, u_max=1e30, **parameters)
        for k, sample in enumerate(samples):
            law.set(sample)
            law.step(k * TS, TS)
            found.append(law.get(*names))
    return np.array(found)


def along(v: list[float]) -> list[dict[str, float]]:
    """Samples of a reference that had the velocity v[k] from sample k to k + 1; in sample k + 1, rd is v[k]."""
    r = np.concatenate([[0.0], np.cumsum(v) * TS])
    return [{"r": a, "rd": b} for a, b in zip(r.tolist(), [v[0], *v], strict=True)]


def friction(library: Library, v: list[float], *names: str, **values: float) -> np.ndarray:
    """Variables of the friction block after steps of TS with held velocities."""
    found = []
    with Instance(library) as model:
        model.initialise(**values)
        for k, speed in enumerate(v):
            model.set({"v": speed})
            model.step(k * TS, TS)
            found.append(model.get(*names))
    return np.array(found)


@pytest.mark.parametrize("name", NAMES)
@reproducibly
@given(velocities, st.fixed_dictionaries(stribeck), st.sampled_from([1.0, 0.7]))
def test_it_is_the_block(name, block, v, parameters, Fn):
    samples = [sample | {"Fn": Fn} for sample in along(v)]
    found = run(block(name), samples, "F_hat", "z_hat", mass=0.0, **parameters)[1:]
    expected = friction(block(name.removesuffix("Feedforward")), v, "F", "z", Fn=Fn, **parameters)
    assert found[:, 0] == pytest.approx(expected[:, 0], rel=1e-12, abs=1e-12)
    assert found[:, 1] == pytest.approx(expected[:, 1], rel=1e-12, abs=1e-17)


def test_a_closed_inner_loop_is_wiped_out(block):
    """Once it is passed, depth of the stacks and force are as if it had not been; n = 60 closes loops in r, too."""
    step = 2.0**-10
    begin, inner, end = [step] * 3 + [-step] * 2, [step, -step], [-step / 4]
    with_loop, without = (
        run(block("LeuvenFeedforward"), along(way), "depth", "Fb", "Fh", n=60.0)
        for way in (begin + inner + end, begin + end)
    )
    assert with_loop[:, 0].max() == without[:, 0].max() + 1.0
    assert with_loop[-1].tolist() == pytest.approx(without[-1].tolist(), rel=1e-9)


def test_stiff_elements_without_relaxation_are_maxwell_slip(block):
    """Far below the level, with a large n, the force is that of the elements: an independent recursion."""
    k, W = np.array([4e4, 2e4]), np.array([0.1, 0.2])
    v = [n * 2.0**-14 for n in [3, 40, -20, 7, -90, 30, 30, -8, -8, 60]]
    elements = {f"k[{i}]": 0.0 for i in range(1, 11)} | {f"W[{i}]": 0.0 for i in range(1, 11)}
    elements |= {"k[1]": k[0], "k[2]": k[1], "W[1]": W[0], "W[2]": W[1]}
    parameters = {"n": 60.0, "Fc": 10.0, "Fs": 10.0, "sigma1": 0.0, "sigma2": 0.0} | elements
    found = run(block("ModifiedLeuvenFeedforward"), along(v), "Fh", **parameters)
    force, expected = np.zeros(2), [0.0]
    for speed in v:
        force = np.clip(force + k * speed * TS, -W, W)
        expected.append(force.sum())
    assert found[:, 0] == pytest.approx(expected, abs=1e-12 * 10.0)  # the block's tolerance, of the level


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("v", [2.0**-9, -(2.0**-8), 0.125])
def test_steady_sliding_is_the_stribeck_curve(name, block, v):
    found = run(block(name), along([v] * 4000), "F_hat")[-1, 0]
    level = 1.0 + 0.5 * math.exp(-((v / 1e-3) ** 2))
    assert found == pytest.approx(math.copysign(level, v) + 0.4 * v, rel=1e-6)


OUTPUTS = ("u", "F_hat", "z_hat", "u_sat")


def random_reference(n: int, seed: int) -> list[dict[str, float]]:
    random = np.random.default_rng(seed)
    rd = random.choice([-1.0, 0.0, 1.0], n) * 10.0 ** random.uniform(-5, -1, n)
    columns = (np.cumsum(rd) * TS).tolist(), rd.tolist(), random.normal(size=n).tolist()
    return [{"r": r, "rd": v, "rdd": a} for r, v, a in zip(*columns, strict=True)]


@pytest.mark.parametrize("name", NAMES)
def test_reset_is_a_first_sample(name, block):
    samples = random_reference(40, 1)
    samples[20] |= {"reset": 1.0}
    samples[21] |= {"reset": 0.0}
    found = run(block(name), samples, *OUTPUTS)
    assert np.array_equal(found[20:], run(block(name), samples[20:], *OUTPUTS))


@pytest.mark.parametrize("name", NAMES)
def test_disabled_it_is_silent_and_comes_back_fresh(name, block):
    samples = random_reference(60, 2)
    samples[20] |= {"enable": 0.0}
    samples[40] |= {"enable": 1.0}
    found = run(block(name), samples, *OUTPUTS)
    assert not found[20:40].any()
    assert found[19].any()
    assert np.array_equal(found[40:], run(block(name), samples[40:], *OUTPUTS))


@pytest.mark.parametrize("name", NAMES)
def test_gain_and_limits_do_not_touch_the_friction_state(name, block):
    samples = random_reference(50, 3)
    with Instance(block(name)) as law:
        law.initialise(Ts=TS, gain=0.5, mass=2.0, u_min=-0.1, u_max=0.2)
        full = run(block(name), samples, "F_hat", "z_hat")
        for k, sample in enumerate(samples):
            law.set(sample)
            law.step(k * TS, TS)
            u, F_hat, z_hat, u_sat = law.get(*OUTPUTS)
            wanted = 2.0 * sample["rdd"] + 0.5 * full[k, 0]
            assert (F_hat, z_hat) == (full[k, 0], full[k, 1])
            assert (u, u_sat) == (min(max(wanted, -0.1), 0.2), float(wanted > 0.2) - float(wanted < -0.1))
