"""GMSFeedforward is the friction block GMS, whatever its parameters and its load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shell.instance import ERROR, OK, Instance, load
from thorough import few

TS = 1e-3
speeds = st.lists(st.one_of(st.just(0.0), st.floats(-3e-2, 3e-2)), min_size=40, max_size=40)
stiffnesses = st.lists(st.one_of(st.just(0.0), st.floats(10.0, 1e5)), min_size=10, max_size=10)
shares = st.lists(st.one_of(st.just(0.0), st.floats(0.01, 1.0)), min_size=9, max_size=9)


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> Callable[[str], Path]:
    return lambda name: load(build_fmu(name))


@settings(max_examples=few(60), deadline=None, derandomize=True, database=None)
@given(
    speeds, stiffnesses, shares, st.integers(1, 10), st.floats(0.0, 500.0), st.floats(-0.5, 3.0), st.floats(0.0, 1e4)
)
def test_it_is_the_block_for_any_of_its_parameters(block, v, k, alpha, N, sigma, Fn, C):
    """Constant velocity in every sample, reversals and rests among them; from one sample to the next all of it."""
    shared = {"N": N, "sigma": sigma, "C": C, "sigma2": 0.7, "Fc": 1.2, "Fs": 2.0, "vs": 5e-3, "delta": 1.3, "Fn0": 1.5}
    shared |= {f"k[{i + 1}]": value for i, value in enumerate(k)}
    shared |= {f"alpha[{i + 1}]": value for i, value in enumerate([0.3, *alpha])}
    with Instance(block("GMS")) as contact, Instance(block("GMSFeedforward")) as law:
        contact.initialise(Fn=Fn, **shared)
        law.initialise(Fn=Fn, Ts=TS, m=0.0, u_min=-1e9, u_max=1e9, **shared)
        law.step(0.0, TS)
        r = 0.0
        # the increment that the law sees is rounded: the block moves with that
        for j, speed in enumerate(v):
            after = r + speed * TS
            w = (after - r) / TS
            r = after
            contact.set({"v": w})
            contact.step(j * TS, TS)
            law.set({"r": r, "rd": w})
            law.step((j + 1) * TS, TS)
            names = [f"Fi[{i + 1}]" for i in range(N)]
            flags = [f"slipping[{i + 1}]" for i in range(N)]
            scale = 1.0 + sigma * abs(w) * N
            assert law.get(*names) == pytest.approx(contact.get(*names), abs=1e-9)
            assert law.get1("slips") == sum(contact.get(*flags))
            assert law.get1("F_hat") == pytest.approx(contact.get1("F"), abs=1e-9 * scale)


def test_elements_without_any_share_are_refused(block):
    """Shares of elements that are not used do not count."""
    for last, accepted in ((0.0, False), (0.1, True)):
        with Instance(block("GMSFeedforward")) as law:
            law.setup()
            law.must("EnterInitializationMode")
            law.set({"N": 3.0, "alpha[1]": 0.0, "alpha[2]": 0.0, "alpha[3]": last})
            assert law.call("ExitInitializationMode") == (OK if accepted else ERROR)
            assert accepted or b"must satisfy alpha[1] + ... + alpha[N] > 0" in law.messages[-1][3]


def test_damping_acts_on_what_sticks(block):
    """All N elements stick at the first small step: sigma N v beside the springs."""
    with Instance(block("GMSFeedforward")) as law:
        law.initialise(Ts=TS, N=4.0, sigma=20.0, sigma2=0.0)
        law.step(0.0, TS)
        law.set({"r": 1e-9, "rd": 1e-6})
        law.step(TS, TS)
        stiffness = sum(np.array([28e3, 15e3, 10e3, 8e3]))
        assert law.get1("F_hat") == pytest.approx(stiffness * 1e-9 + 20.0 * 4.0 * 1e-6, rel=1e-12)
