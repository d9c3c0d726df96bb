"""Systems on the border of a condition, moved by a few units in the last place: one answer, and the right one."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from thorough import some

from friction_fmus import conditions
from friction_fmus.conditions import Condition, SampledLaw, chain, loop_poles, one_mass
from friction_fmus.conditions.condition import is_stable

ULPS = (-3, -2, -1, 0, 1, 2, 3)


def moved(value: float, ulps: int) -> float:
    """Return the number that lies the given number of units in the last place above this one."""
    return value + ulps * math.ulp(value)


def loop(Kp: float, Kd: float, Ts: float) -> Condition:
    """A free mass of 1 kg under a sampled PD controller."""
    law = SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-Kp, -Kd, 0.0]))
    return loop_poles(one_mass(1.0), lambda _: [law], Ts)


def sampled_border(Kp: float, Ts: float) -> list[tuple[float, float]]:
    """Gains on the border: z^2 - (2 - Kp T^2/2 - Kd T) z + 1 + Kp T^2/2 - Kd T, by Jury."""
    return [(Kp, Kp * Ts / 2.0), (Kp, 2.0 / Ts), (0.0, 1.0 / Ts), (0.0, 0.0)]


@pytest.mark.parametrize("Ts", some([1e-3, 3.7e-4, 1.0 / 7e3], [3.7e-4]))
@pytest.mark.parametrize("Kp", some([0.1, 3.0, 12e3, 7.7e5], [0.1, 12e3]))
def test_a_sampled_loop_on_the_border_is_not_stable_whatever_the_last_bits_are(Kp: float, Ts: float) -> None:
    for border_Kp, border_Kd in sampled_border(Kp, Ts):
        gains = [(moved(border_Kp, i), moved(border_Kd, j)) for i, j in product(ULPS, ULPS)]
        laws = [
            SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-one, -other, 0.0]))
            for one, other in gains
        ]
        assert {is_stable(chain(one_mass(1.0), [law], Ts)) for law in laws} == {False}
        assert not loop(border_Kp, border_Kd, Ts).ok


@pytest.mark.parametrize("Ts", [1e-3, 3.7e-4])
@pytest.mark.parametrize("Kp", [3.0, 12e3])
def test_a_sampled_loop_next_to_the_border_is_told_from_one_beyond_it(Kp: float, Ts: float) -> None:
    (_, low), (_, high), *_ = sampled_border(Kp, Ts)
    for Kd, inside in ((low, 1.0 + 1e-3), (high, 1.0 - 1e-6)):
        assert loop(Kp, inside * Kd, Ts).ok
        assert not loop(Kp, (2.0 - inside) * Kd, Ts).ok


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_chain_of_integrators_is_not_stable(n: int) -> None:
    """The n eigenvalues at 1 of a Jordan block, which rounding moves by its n-th root, in random coordinates."""
    random = np.random.default_rng(6)
    block = np.eye(n) + np.eye(n, k=1)
    for _ in range(100):
        basis = random.normal(size=(n, n))
        assert not is_stable(basis @ block @ np.linalg.inv(basis))
        assert is_stable(basis @ (0.9 * np.eye(n) + 0.01 * np.eye(n, k=1)) @ np.linalg.inv(basis))


def test_numbers_that_overflow_are_not_stable() -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        assert not loop(1e308, 1e308, 1e3).ok


def test_slow_loops_and_units_do_not_make_a_stable_loop_unstable() -> None:
    """A time constant of 1000 s at 10 kHz; the states in um and GN."""
    decay = math.exp(-1e-4 / 1e3)
    assert is_stable(np.array([[decay]]))
    units = np.diag([1e6, 1e-9, 1.0])
    matrix = np.array([[0.9, 1e-3, 0.0], [-2.0, 0.7, 1e-3], [-1e-3, 0.0, 1.0]])
    assert (
        is_stable(matrix)
        == is_stable(units @ matrix @ np.linalg.inv(units))
        == (np.abs(np.linalg.eigvals(matrix)).max() < 1.0)
    )


On = Callable[[float], Condition]
BORDERS: dict[str, tuple[On, bool]] = {
    # with the factor by which one side is away from the border, and whether the border itself is allowed
    "routh": (lambda q: conditions.routh(1.0, 0.1, 3.0, 0.2, q * 3.0 * (0.1 + 0.2)), False),
    "routh damping": (lambda q: conditions.routh(1.0, 0.1 + 0.2, 3.0, -0.3 * q), False),
    "stick-slip": (lambda q: conditions.stick_slip_free(0.1, q * 0.2, 1.0, 1.3, 0.3 / 0.3, 1.0), False),
    "hunting": (lambda q: conditions.hunting(1.0, q * (0.1 + 0.2), 0.3), True),
    "encoder": (lambda q: conditions.encoder_count(0.1, q * 1.0, 0.2, 0.3, 0.1), False),
    "fed-back stiffness": (lambda q: conditions.fed_back_stiffness(q * (0.1 + 0.2), 0.3), False),
    "over-compensation": (lambda q: conditions.overcompensation(q * (0.7 + 0.2 + 0.1)), True),
    "break-away": (lambda q: conditions.break_away(q * (0.1 + 0.2), 0.3), False),
    "dither stroke": (lambda q: conditions.dither_stroke(q * 0.3, 0.5 / math.pi, 1.0, 0.1 + 0.2, 1.0), False),
    "learning": (
        lambda q: conditions.contraction(np.ones(1), np.full(1, 0.1j), np.full(1, -10.0j), gamma=q * 2.0),
        False,
    ),
}


@pytest.mark.parametrize("name", BORDERS)
def test_a_condition_on_its_border_has_one_answer(name: str) -> None:
    condition, allowed = BORDERS[name]
    assert {condition(moved(1.0, i)).ok for i in ULPS} == {allowed}
    # a millionth to one side it holds, to the other one it does not
    assert {condition(1.0 - 1e-6).ok, condition(1.0 + 1e-6).ok} == {False, True}


def test_a_curve_that_falls_by_a_rounding_error_does_not_fall() -> None:
    Fs = 0.1 + 0.2  # 0.30000000000000004
    assert conditions.steepest_fall(0.3, Fs, 1e-3, 0.5) == 0.0
    assert conditions.stick_slip_free(1e-3, 0.0, 0.3, Fs, 1e-3, 0.5).ok


def test_the_speed_and_frequency_that_are_named_do_not_hang_on_the_last_bits() -> None:
    """|1 - 2| = 1 at all frequencies: the first one is named."""
    f = np.linspace(1.0, 100.0, 50)
    noise = 1.0 + 4e-16 * np.random.default_rng(8).integers(-3, 4, 50)
    found = conditions.contraction(
        f, np.asarray(noise, dtype=np.complex128), np.ones(50, dtype=np.complex128), gamma=2.0
    )
    assert not found.ok
    assert "at 1 Hz" in found.wrong
    assert "well below 1 Hz" in found.change
