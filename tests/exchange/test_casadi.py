"""Model exchange in CasADi: the same derivatives and Jacobian, and integration by CVODES against co-simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from exchange.cases import wanted
from exchange.solver import Exchange
from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu
from numpy.typing import NDArray
from thorough import some

Array = NDArray[np.float64]

WITHOUT_EVENTS = ("BlimanSorine", "Dahl", "ElastoPlastic", "LoadDependentDahl", "LuGre", "RateAndState")
ACCURACY = {"reltol": 1e-10, "abstol": 1e-14, "max_num_steps": 100_000, "max_step_size": 1e-3}


@dataclass(frozen=True)
class Loaded:
    """A block in CasADi, and an instance of its own."""

    name: str
    folder: Path
    dae: ca.DaeBuilder

    def function(self, **options: bool) -> ca.Function:
        return self.dae.create("f", ["x", "u"], ["ode", "y"], {"enable_forward": False, **options})

    def start(self, names: list[str]) -> Array:
        return np.array(self.dae.start(names)) if names else np.zeros(0)


@pytest.fixture
def load(build_fmu: Callable[..., Path]) -> Callable[[str], Loaded]:
    def unpack(name: str) -> Loaded:
        fmu = build_fmu(name)
        folder = fmu.with_suffix(".casadi")
        if not folder.is_dir():
            extract(str(fmu), str(folder))
        return Loaded(name, folder, ca.DaeBuilder(name, str(folder)))

    return unpack


class Direct:
    """The functions of the FMU, in the same order of calls as in CasADi."""

    def __init__(self, block: Loaded) -> None:
        description = read_model_description(str(block.folder))
        references = {v.name: v.valueReference for v in description.modelVariables}
        derivatives = [d.variable.name for d in description.derivatives]
        self.knowns = [references[name] for name in (*block.dae.x(), *block.dae.u())]
        self.nominal = np.array(block.dae.nominal([*block.dae.x(), *block.dae.u()]))
        self.unknowns = [references[name] for name in (*derivatives, *block.dae.y())]
        self._fmu: Any = instantiate_fmu(str(block.folder), description, fmi_type="ModelExchange")
        self._fmu.setupExperiment()
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        self._fmu.newDiscreteStates()
        self._fmu.enterContinuousTimeMode()

    def close(self) -> None:
        self._fmu.terminate()
        self._fmu.freeInstance()

    def values(self, knowns: Array) -> Array:
        self._fmu.setReal(self.knowns, knowns.tolist())
        return np.array(self._fmu.getReal(self.unknowns))

    def jacobian(self, knowns: Array) -> Array:
        self._fmu.setReal(self.knowns, knowns.tolist())
        columns = [self._fmu.getDirectionalDerivative(self.unknowns, [known], [1.0]) for known in self.knowns]
        return np.array(columns).reshape(len(self.knowns), len(self.unknowns)).T


@pytest.fixture
def direct() -> Iterator[Callable[[Loaded], Direct]]:
    made: list[Direct] = []

    def make(block: Loaded) -> Direct:
        made.append(Direct(block))
        return made[-1]

    yield make
    for each in made:
        each.close()


def drawn(block: Loaded, seed: int) -> tuple[Array, Array]:
    """States and inputs around the nominal values and start values."""
    rng = np.random.default_rng(seed)
    nominal = np.array(block.dae.nominal(block.dae.x())) if block.dae.nx() else np.zeros(0)
    x = block.start(block.dae.x()) + nominal * rng.normal(size=block.dae.nx())
    scale = np.array([1e-3 if name.startswith("v") else 1.0 for name in block.dae.u()])
    return x, block.start(block.dae.u()) + scale * rng.normal(size=block.dae.nu())


@pytest.mark.parametrize("name", some([*sorted(wanted()), "stick_slip"], [*sorted(wanted())[::2], "stick_slip"]))
def test_derivatives_outputs_and_jacobian_are_those_of_the_fmu(
    name: str, load: Callable[[str], Loaded], direct: Callable[[Loaded], Direct]
) -> None:
    """The Jacobian within 1e-9: CasADi asks for several columns at once, and the differences share their step."""
    block = load(name)
    f, own = block.function(), direct(block)
    along = block.function(enable_forward=True).forward(1)
    states = f.size1_in(0)
    x_and_u = ca.MX.sym("x_and_u", states + f.size1_in(1))
    outputs = ca.vertcat(*f(x_and_u[:states], x_and_u[states:]))
    matrix = ca.Function("J", [x_and_u], [ca.jacobian(outputs, x_and_u)])
    for seed in range(5):
        x, u = drawn(block, seed)
        knowns = np.concatenate([x, u])
        values = f(x, u)
        np.testing.assert_allclose(np.concatenate([v.full().ravel() for v in values]), own.values(knowns), rtol=1e-14)
        expected = own.jacobian(knowns)
        for column, unit in zip(expected.T, np.eye(knowns.size), strict=True):
            found = along(x, u, *values, unit[:states], unit[states:])
            np.testing.assert_allclose(np.concatenate([v.full().ravel() for v in found]), column, rtol=1e-14)
        scaled = np.abs(expected) * own.nominal
        error = np.abs(np.array(matrix(knowns)).reshape(expected.shape) - expected) * own.nominal
        assert np.all(error <= 1e-9 * np.max(scaled, axis=1, initial=0.0, keepdims=True))


def test_jacobian_of_lugre_is_that_of_its_equations(load: Callable[[str], Loaded]) -> None:
    """(2) and (3) of Canudas de Wit et al. 1995 differentiated by hand, with the start values."""
    jacobian = load("LuGre").function().factory("J", ["x", "u"], ["jac:ode:x", "jac:ode:u"])
    sigma0, Fc, Fs, vs = 1e5, 1.0, 1.5, 1e-3
    rng = np.random.default_rng(1)
    for _ in range(50):
        v, z = 10.0 ** rng.uniform(-7.0, 0.0) * rng.choice([-1.0, 1.0]), rng.uniform(-2e-5, 2e-5)
        peak = (Fs - Fc) * math.exp(-((v / vs) ** 2))
        g, slope = Fc + peak, -2.0 * v / vs**2 * peak
        by_z = -sigma0 * abs(v) / g
        by_v = 1.0 - sigma0 * math.copysign(1.0, v) * z / g + sigma0 * abs(v) * z * slope / g**2
        found = jacobian(z, [v, 1.0])
        assert float(found[0]) == pytest.approx(by_z, rel=1e-11)
        assert float(found[1][0]) == pytest.approx(by_v, abs=1e-11 * (1.0 + abs(by_z)))


def integrated(block: Loaded, nodes: Array, v: Array) -> Array:
    """The force at the nodes by CVODES, started at each node; v is linear in between."""
    f, (other,) = block.function(), block.start(block.dae.u())[1:]
    x, line, t = ca.MX.sym("x", block.dae.nx()), ca.MX.sym("line", 2), ca.MX.sym("t")
    rate, _ = f(x, ca.vertcat(line[0] + line[1] * t, other))
    step = float(nodes[1])
    run = ca.integrator("run", "cvodes", {"x": x, "t": t, "p": line, "ode": rate}, 0.0, step, ACCURACY)
    state, force = block.start(block.dae.x()), [float(f(block.start(block.dae.x()), [v[0], other])[1])]
    for begin, end in pairwise(v):
        state = run(x0=state, p=[begin, (end - begin) / step])["xf"]
        force.append(float(f(state, [end, other])[1]))
    return np.array(force)


NODES = np.linspace(0.0, 2.0, 41)  # s
REVERSALS = 2e-3 * np.sin(2.0 * np.pi * NODES) + 5e-4 * np.sin(7.0 * NODES)  # m/s
FORWARD = 1e-3 * (1.2 - np.cos(2.0 * np.pi * NODES))  # m/s


def deviation(block: Loaded, v: Array) -> float:
    exchange = Exchange(block.folder, NODES, {block.dae.u()[0]: v}, {})
    return float(np.max(np.abs(integrated(block, NODES, v) - exchange.co_simulation(["F"])[:, 0])))


@pytest.mark.parametrize("name", WITHOUT_EVENTS)
def test_integration_agrees_with_co_simulation_over_reversals(name: str, load: Callable[[str], Loaded]) -> None:
    assert deviation(load(name), REVERSALS) < 1e-6


def test_integration_agrees_up_to_the_first_event(load: Callable[[str], Loaded]) -> None:
    """CasADi has no events: from a reversal on, the force is wrong, as the page says."""
    block = load("Leuven")
    block.dae.set("v", FORWARD[0])
    assert deviation(block, FORWARD) < 1e-6
    assert deviation(block, REVERSALS) > 0.1


def test_a_block_with_events_keeps_the_decision_of_its_start_values(load: Callable[[str], Loaded]) -> None:
    """At the start, v = 0: F = F_ext; sliding forward: F = Fc."""
    at_rest, forward = load("Coulomb"), load("Coulomb")
    forward.dae.set("v", 1e-3)
    for block, force in ((at_rest, 0.25), (forward, 1.0)):
        f = block.dae.create("f", ["u"], ["y"])
        assert [float(f([v, 0.25, 1.0])) for v in (1e-3, -1e-3)] == [force, force]


def test_forward_derivatives_of_casadi_need_to_be_switched_off(load: Callable[[str], Loaded]) -> None:
    """The page names this defect; without it, `enable_forward` is not needed any more."""
    f = load("LuGre").dae.create("f", ["x", "u"], ["ode", "y"])
    along, rate, force = f.forward(1), *f(1e-6, [1e-3, 1.0])
    before = along(1e-6, [1e-3, 1.0], rate, force, 0.0, [1.0, 0.0])
    zero = along(1e-6, [1e-3, 1.0], rate, force, 0.0, [0.0, 0.0])
    assert float(zero[0]) == float(before[0]) != 0.0


def test_parameters_are_fixed_before_a_function_is_made(load: Callable[[str], Loaded]) -> None:
    block = load("LuGre")
    block.dae.set("sigma0", 2e5)
    assert float(block.function()(1e-6, [0.0, 1.0])[1]) == pytest.approx(0.2, rel=1e-14)
    f = block.dae.create("f", ["x", "u", "p"], ["ode", "y"])
    with pytest.raises(RuntimeError, match="Evaluation failed"):
        f(1e-6, [0.0, 1.0], block.dae.start(block.dae.p()))


def test_steps_over_the_stribeck_peak(build_fmu: Callable[..., Path], load: Callable[[str], Loaded]) -> None:
    """The page: at 50 m/s2 through v = 0, a loose tolerance misses the peak unless steps are short."""
    nodes = np.linspace(0.0, 4e-3, 9)
    lines = {"v": np.interp(nodes, [1e-3, 3e-3], [-0.05, 0.05]), "Fn": np.ones(nodes.size)}
    run = Exchange(load("LuGre").folder, nodes, lines, {})
    exact = run.co_simulation(["F"])[:, 0]

    def error(tolerance: float, step: float | None) -> float:
        return float(np.max(np.abs(run.model_exchange(["F"], tolerance, step)[0][:, 0] - exact)))

    assert 1e-4 < error(1e-6, None) < 3e-4
    assert error(1e-6, 1e-5) < 5e-5
    assert error(1e-9, None) < 1e-6
