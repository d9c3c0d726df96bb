"""The masters on parts without FMUs, against closed forms."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from harness_parts import DAMPING, SIGMA0, bristle, linear, mass
from scipy.linalg import expm

from harness import CallablePart, Experiment, System, UnknownNameError, masters
from harness.system.graph import make_plan
from harness.system.plan import GET, SET, STEP

WIRES = ["bristle.F -> mass.F", "mass.v -> bristle.v"]


def test_masters_are_found_in_their_folder() -> None:
    assert {"jacobi", "gauss-seidel"} <= set(masters())


@pytest.mark.parametrize("name", masters())
def test_traits_are_those_of_the_schedule(name: str) -> None:
    master = masters()[name]
    with System([mass(), bristle()], WIRES) as system:
        experiment = Experiment(stop=1.0, step=0.1, master=name)
        schedule = master.schedule(make_plan(system, experiment, []), experiment)
    assert schedule.implicit == master.implicit
    together = [operation for operation, _ in schedule.operations] == [SET, SET, STEP, STEP, GET, GET]
    assert together == master.together
    assert (master.order > 1.0, master.composed) == (name == "newton", master.implicit)


def test_no_file_asks_for_the_name_of_a_master() -> None:
    root = Path(__file__).parents[2]
    name = "|".join(masters())
    for path in (file for folder in ("harness", "friction_fmus") for file in (root / folder).rglob("*.py")):
        asked = re.findall(rf"""(?:==|!=|\bin)\s*\(?(?:["'](?:{name})["'])""", path.read_text(encoding="utf-8"))
        assert not asked, path


def test_unknown_master() -> None:
    with pytest.raises(UnknownNameError, match="no master 'jakobi': did you mean 'jacobi'"):
        System([mass(), bristle()], WIRES).run(stop=1.0, step=0.1, master="jakobi")


@pytest.mark.parametrize(
    "parts", [[mass(v0=1e-3), bristle()], [bristle(), mass(v0=1e-3)]], ids=["mass first", "mass last"]
)
@pytest.mark.parametrize(("master", "limit"), [("jacobi", 1.58e-3), ("gauss-seidel", 3.91e-3)])
def test_stability_limit_of_the_bristle_loop(master: str, limit: float, parts: list[CallablePart]) -> None:
    """Limits of models/friction: roots of the coupled discrete map on the unit circle; reproduced to 2 %."""
    amplitude = {}
    for step in (0.98 * limit, 1.02 * limit):
        result = System(parts, WIRES).run(stop=3000 * step, step=step, master=master, record=["mass.v"])
        v = np.abs(result["mass.v"].to_numpy())
        amplitude[step] = v[-500:].max() / v[500:1000].max()
    assert amplitude[0.98 * limit] < 1e-2
    assert amplitude[1.02 * limit] > 1e2


def test_coupled_maps_are_the_textbook_ones() -> None:
    """v(k) from the characteristic polynomials: Jacobi has one more delay than Gauss-Seidel."""
    h, n, v0 = 1e-3, 40, 1e-3
    parts = [mass(v0=v0), bristle()]

    v, z, F = v0, 0.0, DAMPING * v0
    jacobi = [v]
    for _ in range(n):
        v, z, F = v - h * F, z + h * v, SIGMA0 * (z + h * v) + DAMPING * v
        jacobi.append(v)
    result = System(parts, WIRES).run(stop=n * h, step=h, master="jacobi")
    np.testing.assert_allclose(result["mass.v"], jacobi, rtol=1e-9, atol=1e-15)

    v, z, F = v0, 0.0, DAMPING * v0
    sequential = [v]
    for _ in range(n):
        v = v - h * F
        z = z + h * v
        F = SIGMA0 * z + DAMPING * v
        sequential.append(v)
    result = System(parts, WIRES).run(stop=n * h, step=h, master="gauss-seidel")
    np.testing.assert_allclose(result["mass.v"], sequential, rtol=1e-9, atol=1e-15)


def two_masses() -> tuple[System, np.ndarray]:
    """m1 on a spring to the ground, m2 on a spring to m1; and x1 of the whole at t = 1 s."""
    k1, k2, m1, m2 = 30.0, 12.0, 1.0, 0.7
    first = linear(
        "first",
        A=np.array([[0.0, 1.0], [-k1 / m1, 0.0]]),
        B=np.array([[0.0], [1.0 / m1]]),
        C=np.array([[1.0, 0.0]]),
        D=np.zeros((1, 1)),
        inputs=["F"],
        outputs=["x"],
        state=[0.1, 0.0],
    )
    second = linear(
        "second",
        A=np.array([[0.0, 1.0], [-k2 / m2, 0.0]]),
        B=np.array([[0.0], [k2 / m2]]),
        C=np.array([[k2, 0.0]]),
        D=np.array([[-k2]]),
        inputs=["x"],
        outputs=["F"],
        state=[-0.05, 0.0],
    )
    whole = np.array(
        [[0, 1, 0, 0], [-(k1 + k2) / m1, 0, k2 / m1, 0], [0, 0, 0, 1], [k2 / m2, 0, -k2 / m2, 0]], dtype=float
    )
    exact = expm(whole) @ np.array([0.1, 0.0, -0.05, 0.0])
    return System([first, second], ["first.x -> second.x", "second.F -> first.F"]), exact


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_two_mass_oscillator_converges_with_first_order(master: str) -> None:
    system, exact = two_masses()
    errors = []
    for n in (1000, 2000, 4000):
        result = system.run(stop=1.0, step=1.0 / n, master=master, record=["first.x"], decimate=n)
        errors.append(abs(float(result["first.x"][-1]) - exact[0]))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.03)
    assert errors[-1] < 1e-3


def sampled_loop() -> System:
    """A sampled proportional controller on an integrator: x' = u, u = -K x(t_k)."""
    controller = CallablePart("ctl", lambda t, u, x: -2.0 * u[0], ["y"], ["u"], sampled=True)
    integrator = CallablePart(
        "plant",
        lambda t, u, x: x[0],
        ["u"],
        ["y"],
        advance=lambda t, h, u, x: x + h * u[0],
        state=[1.0],
        dependencies={"y": ()},
    )
    return System([integrator, controller], ["ctl.u -> plant.u", "plant.y -> ctl.y"])


def test_gauss_seidel_samples_the_controller_without_delay() -> None:
    h, n = 0.1, 20
    result = sampled_loop().run(stop=n * h, step=h)
    k = np.arange(n + 1)
    np.testing.assert_allclose(result["plant.y"], (1 - 2.0 * h) ** k, rtol=1e-12)
    # what is recorded at the end of a step is what the controller held during it
    np.testing.assert_allclose(result["ctl.u"][1:], -2.0 * (1 - 2.0 * h) ** k[:-1], rtol=1e-12)


def test_jacobi_delays_the_controller_by_one_step() -> None:
    h, n = 0.1, 20
    result = sampled_loop().run(stop=n * h, step=h, master="jacobi")
    y, u = [1.0], [-2.0]
    for _ in range(n):
        y.append(y[-1] + h * u[-1])
        u.append(-2.0 * y[-2])
    np.testing.assert_allclose(result["plant.y"], y, rtol=1e-12)
    np.testing.assert_allclose(result["ctl.u"], u, rtol=1e-12)


def test_explicit_order_puts_the_controller_behind_the_plant() -> None:
    h, n = 0.1, 20
    late = sampled_loop().run(stop=n * h, step=h, order=["plant", "ctl"])
    # the plant steps on the last command, then the controller reads the new output: x(k+1) = x(k) + h u(k),
    # u(k+1) = -K x(k+1), the same map as without delay but for the label of u
    np.testing.assert_allclose(late["plant.y"], (1 - 2.0 * h) ** np.arange(n + 1), rtol=1e-12)
    np.testing.assert_allclose(late["ctl.u"], -2.0 * late["plant.y"], rtol=1e-12)
