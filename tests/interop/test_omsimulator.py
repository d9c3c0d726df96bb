"""The scheme of OMSimulator, which cannot be installed from PyPI without its own server, on the system of first-fmu.md.

Its fixed-step master (`SystemWC::stepUntil`, "oms-ma") passes the values on along the sorted connections before every
step, so that an output with feed-through is read again after its input was set; then it steps all FMUs. With
``--inputExtrapolation=true`` it does each step twice: the change of the inputs over the first one becomes their slope
in the second one, from the same states.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from ctypes import byref, c_double, c_int, c_uint, c_void_p
from pathlib import Path

import numpy as np
import pytest
from shell.instance import OK, WARNING, Instance, load
from thorough import nightly

from friction_fmus import fmu
from harness import System

ROOT = Path(__file__).parents[2]
SIGMA0, DAMPING = 1e5, math.sqrt(1e5) + 0.4
"""Stiffness [N/m] and viscous damping [N.s/m] of the contact at rest: start values of LuGre."""


class Side:
    """One FMU with the input and the output that connect it."""

    def __init__(self, instance: Instance, input_: str, output: str) -> None:
        self.functions, self.pointer = instance.library.handle, instance.pointer
        self.input, self.output = ((c_uint * 1)(instance.reference(name)) for name in (input_, output))
        self.value, self.first, self.state = (c_double * 1)(), (c_int * 1)(1), c_void_p()

    def set(self, value: float) -> None:
        self.value[0] = value
        assert self.functions.fmi2SetReal(self.pointer, self.input, 1, self.value) == OK

    def set_slope(self, slope: float) -> None:
        self.value[0] = slope
        assert self.functions.fmi2SetRealInputDerivatives(self.pointer, self.input, 1, self.first, self.value) == OK

    def get(self) -> float:
        assert self.functions.fmi2GetReal(self.pointer, self.output, 1, self.value) == OK
        return float(self.value[0])

    def step(self, t: float, h: float) -> None:
        assert self.functions.fmi2DoStep(self.pointer, t, h, 1) in (OK, WARNING)

    def save(self) -> None:
        assert self.functions.fmi2GetFMUstate(self.pointer, byref(self.state)) == OK

    def restore(self) -> None:
        assert self.functions.fmi2SetFMUstate(self.pointer, self.state) == OK


def pass_on(mass: Side, friction: Side) -> np.ndarray:
    """v to the contact, and F, which is read after that, to the mass."""
    v = mass.get()
    friction.set(v)
    F = friction.get()
    mass.set(F)
    return np.array([v, F])


def take_step(mass: Side, friction: Side, t: float, h: float, extrapolate: bool) -> None:
    sides = (mass, friction)
    before = pass_on(mass, friction)
    if extrapolate:
        for side in sides:
            side.save()
        for side in sides:
            side.step(t, h)
        slopes = (pass_on(mass, friction) - before) / h
        for side in sides:
            side.restore()
        friction.set_slope(slopes[0])
        mass.set_slope(slopes[1])
    for side in sides:
        side.step(t, h)


def run(
    build_fmu: Callable[..., Path], start: dict[str, float], steps: int, h: float, *, extrapolate: bool = False
) -> np.ndarray:
    """Position and velocity of the mass after every step."""
    rows = []
    with Instance(load(build_fmu("Mass"))) as one, Instance(load(build_fmu("LuGre"))) as other:
        one.set(start)
        for instance in (one, other):
            instance.setup(tolerance=1e-4)
            instance.must("EnterInitializationMode")
        mass, friction = Side(one, "F_friction", "v"), Side(other, "v", "F")
        position = Side(one, "F_friction", "x")
        pass_on(mass, friction)
        for instance in (one, other):
            instance.must("ExitInitializationMode")
        for k in range(steps):
            take_step(mass, friction, k * h, h, extrapolate)
            rows.append((position.get(), mass.get()))
        for side in (mass, friction):
            if side.state:
                side.functions.fmi2FreeFMUstate(side.pointer, byref(side.state))
    return np.array(rows)


@pytest.mark.parametrize(("share", "grows"), [(0.99, False), (1.01, True)])
def test_limit_of_stability_at_rest(build_fmu: Callable[..., Path], share: float, grows: bool) -> None:
    """v' = v - h (sigma0 z + c v) / m, z' = z + h v: |1 - h c / m + h^2 sigma0 / m| < 1 up to h = c / sigma0."""
    h = share * DAMPING / SIGMA0
    v = np.abs(run(build_fmu, {"F_drive": 1e-12}, 400, h)[:, 1])
    growth = float(v[300:].max() / v[100:200].max())
    # |eigenvalue|^2 = 1 - h c / m + h^2 sigma0 / m, over 200 steps; six samples make a period, so the largest ones miss
    # its peak by some per cent
    assert growth == pytest.approx((1.0 - h * DAMPING + h**2 * SIGMA0) ** 100, rel=0.1)
    assert (growth > 1.0) is grows


def page(pattern: str) -> float:
    text = " ".join((ROOT / "docs" / "first-fmu.md").read_text(encoding="utf-8").split())
    (said,) = re.findall(pattern, text)
    return float(said)


def test_what_the_page_says_of_the_limit() -> None:
    assert page(r"OMSimulator .*? stable up to \(sigma1 \+ sigma2\)/sigma0 = ([\d.]+) ms") == pytest.approx(
        1e3 * DAMPING / SIGMA0, abs=5e-3
    )


STICK_SLIP = {"k": 2.0, "v_support": 0.1, "F_drive": 0.0}


def test_a_step_of_10_ms_diverges(build_fmu: Callable[..., Path]) -> None:
    """To velocities that the block no longer takes, or far beyond the 0.37 m/s of the slips."""
    try:
        fastest = np.abs(run(build_fmu, STICK_SLIP, 2000, 1e-2)[:, 1]).max()
    except AssertionError:
        fastest = np.inf
    assert fastest > 10.0


@nightly
@pytest.mark.parametrize("extrapolate", [False, True])
def test_what_the_page_says_of_the_error(build_fmu: Callable[..., Path], extrapolate: bool) -> None:
    """Against newton at a tenth of the step, after 20 s."""
    with System.from_toml(ROOT / "examples" / "stick_slip.toml", resolve=fmu) as system:
        newton = float(system.run(stop=20.0, step=1e-4, master="newton", record=["mass.x"])["mass.x"][-1])
    assert newton == pytest.approx(1.272596, abs=1e-5)  # benchmark B5
    error = 1e3 * abs(run(build_fmu, STICK_SLIP, 20_000, 1e-3, extrapolate=extrapolate)[-1, 0] - newton)
    if extrapolate:
        assert error < page(r"below ([\d.]+) mm with `--inputExtrapolation=true`")
    else:
        assert error == pytest.approx(page(r"error is ([\d.]+) mm at 1 ms"), abs=0.05)
