"""FMUs of other tools, most of which declare no dependencies: coupled, they give what is known of their equations."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from thorough import landing, some

from harness import AlgebraicLoopError, Experiment, ExperimentError, FmuPart, System, sweep
from harness.errors import FmuError

MakeFmu = Callable[..., Path]
EXPLICIT = ["jacobi", "gauss-seidel"]
ALL = [*EXPLICIT, "newton", "adaptive"]
PAIR = ["prey.x -> predator.x", "predator.y -> prey.y"]


@pytest.fixture(params=["c", "pythonfmu"])
def pair(request: pytest.FixtureRequest, foreign: MakeFmu, pythonfmu: MakeFmu) -> Iterator[System]:
    """The Lotka-Volterra system of MasterSim's tests: two FMUs, each with one of the equations."""
    make = pythonfmu if request.param == "pythonfmu" else lambda name: foreign(name.upper())
    parts = [FmuPart(name, make(name)) for name in ("prey", "predator")]
    with System(parts, PAIR, name="lotka-volterra") as system:
        yield system


def lotka_volterra(t: np.ndarray) -> np.ndarray:
    """x and y from the equations, to 1e-12."""
    solution = solve_ivp(
        lambda _, z: [z[0] * (1.1 - 0.4 * z[1]), z[1] * (0.1 * z[0] - 0.4)],
        (0.0, t[-1]),
        (2.0, 1.0),
        method="DOP853",
        t_eval=t,
        rtol=1e-12,
        atol=1e-12,
    )
    return np.array(solution.y)


def held(master: str, steps: int, h: float, birth: float = 1.1) -> np.ndarray:
    """x and y by the scheme itself: each equation exact for the other value held."""
    x, y = 2.0, 1.0
    rows = [(x, y)]
    for _ in range(steps):
        new = x * math.exp(h * (birth - 0.4 * y))
        y *= math.exp(h * (0.1 * (new if master == "gauss-seidel" else x) - 0.4))
        x = new
        rows.append((x, y))
    return np.array(rows)


@pytest.mark.parametrize("master", some([*EXPLICIT], [*EXPLICIT][:1]))
def test_lotka_volterra_on_held_values(pair: System, master: str) -> None:
    h, n = 0.01, 1000
    result = pair.run(stop=n * h, step=h, master=master)
    got = np.stack([result["prey.x"], result["predator.y"]], axis=1)
    np.testing.assert_allclose(got, held(master, n, h), rtol=1e-12)
    # of first order in the step
    exact = lotka_volterra(result["time"].to_numpy()).T
    assert 1e-3 < np.abs(got - exact).max() / exact.max() < 0.05


@pytest.mark.parametrize(
    ("master", "more"), some([("jacobi", {"extrapolation": 1}), ("newton", {}), ("adaptive", {})], [("newton", {})])
)
def test_lotka_volterra_on_moving_values(foreign: MakeFmu, master: str, more: dict[str, int]) -> None:
    """Of second order in the step, or as exact as the tolerance of adaptive."""
    parts = [FmuPart(name, foreign(name.upper(), states=True)) for name in ("prey", "predator")]
    errors = []
    with System(parts, PAIR) as system:
        for n in (200, 400):
            result = system.run(stop=10.0, step=10.0 / n, master=master, **more)
            got = np.stack([result["prey.x"], result["predator.y"]])
            errors.append(np.abs(got - lotka_volterra(result["time"].to_numpy())).max())
    if master == "adaptive":
        assert errors[0] < 2e-2  # 1e-5 of the values in each inner step, which add up
    else:
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] < 0.05


LOOP = ["sensor.y -> controller.m", "controller.u -> plant.u", "plant.x -> sensor.u"]


def control_loop(foreign: MakeFmu, states: bool) -> System:
    """A PI controller with a step of its reference, a lag of first order and a sensor that gives 0.8 of it."""
    parts = [FmuPart(name, foreign(kind, states=states)) for name, kind in CONTROL.items()]
    return System(parts, LOOP, {"sensor.k": 0.8, "controller.reference": 1.0})


CONTROL = {"controller": "CONTROLLER", "plant": "PLANT", "sensor": "GAIN"}


def control_loop_exact(t: np.ndarray) -> np.ndarray:
    """x' = (Kp (1 - k x) + Ki I - x) / T, I' = 1 - k x, from zero."""
    Kp, Ki, T, k = 2.0, 1.0, 0.5, 0.8
    A = np.array([[-(Kp * k + 1.0) / T, Ki / T, Kp / T], [-k, 0.0, 1.0], [0.0, 0.0, 0.0]])
    return np.array([(expm(A * time) @ [0.0, 0.0, 1.0])[0] for time in t])


@pytest.mark.parametrize("master", ALL)
def test_control_loop_of_three_fmus(foreign: MakeFmu, master: str) -> None:
    """Controller and sensor pass values on directly, the plant does not: no algebraic loop, whatever is declared."""
    errors = []
    with control_loop(foreign, states=master not in EXPLICIT) as system:
        for h in (0.02, 0.01):
            result = system.run(stop=8.0, step=h, master=master)
            errors.append(np.abs(result["plant.x"] - control_loop_exact(result["time"].to_numpy())).max())
        assert float(result["plant.x"][-1]) == pytest.approx(control_loop_exact(np.array([8.0]))[0], abs=1e-3)
    assert errors[1] < (0.03 if master in EXPLICIT else 1e-3)
    if master in EXPLICIT:
        assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("master", ALL)
def test_boolean_loop_switches_on_time(foreign: MakeFmu, master: str) -> None:
    """A room between 19 and 21 degrees: the heater is on for tau ln((limit - low) / (limit - high))."""
    states = master not in EXPLICIT
    parts = [
        FmuPart("thermostat", foreign("THERMOSTAT", states=states)),
        FmuPart("room", foreign("ROOM", states=states)),
    ]
    h = 0.05
    with System(parts, ["thermostat.on -> room.heat", "room.T -> thermostat.T"]) as system:
        result = system.run(stop=110.0, step=h, master=master)
    on = result["thermostat.on"].to_numpy()
    assert on.dtype == bool
    switched = result["time"].to_numpy()[1:][on[1:] != on[:-1]]
    first = 100.0 * math.log((35.0 - 18.0) / (35.0 - 21.0))
    off = 100.0 * math.log((21.0 - 5.0) / (19.0 - 5.0))
    heating = 100.0 * math.log((35.0 - 19.0) / (35.0 - 21.0))
    expected = np.cumsum([first, off, heating, off, heating, off, heating])
    np.testing.assert_allclose(switched[: len(expected)], expected, atol=3 * h * len(expected))
    assert result["room.T"][1:].max() < 21.1
    assert result["room.T"][500:].min() > 18.9


def test_what_is_found_is_said(foreign: MakeFmu, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "harness")
    with control_loop(foreign, states=False) as system:
        system.run(stop=0.1, step=0.01, master="jacobi")
    assert [record.getMessage() for record in caplog.records if "does not declare" in record.getMessage()] == [
        "controller does not declare its dependencies; a trial shows that u depends on m",
        "plant does not declare its dependencies; a trial shows that x depends on no input",
        "sensor does not declare its dependencies; a trial shows that y depends on u",
    ]


GAINS = ["a.y -> b.u", "b.y -> a.u"]


def test_an_algebraic_loop_that_nobody_declares(foreign: MakeFmu) -> None:
    """y_a = 0.5 y_b + 1 and y_b = 0.5 y_a: y_a = 4/3."""
    parts = [FmuPart(name, foreign("GAIN", states=True)) for name in "ab"]
    with System(parts, GAINS, {"a.k": 0.5, "b.k": 0.5, "a.c": 1.0}) as system:
        for master in EXPLICIT:
            with pytest.raises(AlgebraicLoopError, match=r"algebraic loop .*a\.y.*or use the master newton"):
                system.run(stop=1.0, step=0.1, master=master)
        result = system.run(stop=1.0, step=0.1, master="newton")
        np.testing.assert_allclose(result["a.y"], 4 / 3, rtol=1e-6)
        # the parameters of the run decide: without a gain there is no loop
        result = system.with_start({"b.k": 0.0}).run(stop=1.0, step=0.1, master="jacobi")
        np.testing.assert_allclose(result["a.y"][-1], 1.0, rtol=1e-12)


def test_a_product_with_a_start_value_of_zero_hides_nothing(foreign: MakeFmu) -> None:
    parts = [FmuPart("a", foreign("PRODUCT")), FmuPart("b", foreign("GAIN")), FmuPart("c", foreign("GAIN"))]
    wires = ["a.y -> b.u", "b.y -> a.u", "c.y -> a.w"]
    with System(parts, wires, {"c.u": 0.0}) as system, pytest.raises(AlgebraicLoopError):
        system.run(stop=1.0, step=0.1, master="jacobi")


@pytest.mark.parametrize("master", EXPLICIT)
def test_outputs_that_cannot_be_tried(foreign: MakeFmu, master: str, caplog: pytest.LogCaptureFixture) -> None:
    """An FMU may refuse to be read between an input and the next step: the loop is run, and that is said."""
    parts = [FmuPart("prey", foreign("PREY", stale=True)), FmuPart("predator", foreign("PREDATOR"))]
    with System(parts, PAIR) as system:
        result = system.run(stop=1.0, step=0.01, master=master)
    np.testing.assert_allclose(result["prey.x"], held(master, 100, 0.01)[:, 0], rtol=1e-12)
    (said,) = [record.getMessage() for record in caplog.records]
    assert "prey does not declare its dependencies" in said
    assert "compare with a shorter step" in said


@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_without_saved_states(foreign: MakeFmu, master: str) -> None:
    parts = [FmuPart(name, foreign(name.upper())) for name in ("prey", "predator")]
    with (
        System(parts, PAIR) as system,
        pytest.raises(ExperimentError, match="cannot save its state: use the master gauss-seidel or jacobi"),
    ):
        system.run(stop=1.0, step=0.1, master=master)


@pytest.mark.parametrize("master", ALL)
def test_a_loop_of_booleans_has_no_solution(foreign: MakeFmu, master: str) -> None:
    """No master iterates on them; newton is not offered."""
    parts = [FmuPart(name, foreign("NOT", states=True)) for name in "ab"]
    with System(parts, GAINS) as system, pytest.raises(AlgebraicLoopError) as caught:
        system.run(stop=1.0, step=0.1, master=master)
    assert "newton" not in str(caught.value)


@landing
def test_a_sweep_of_the_pair(pythonfmu: MakeFmu, tmp_path: Path) -> None:
    parts = [FmuPart(name, pythonfmu(name)) for name in ("prey", "predator")]
    samples = [{"prey.birth": birth, "prey.species": name} for birth, name in ((0.9, "hare"), (1.3, "rabbit"))]
    with System(parts, PAIR) as system:
        experiment = Experiment(stop=2.0, step=0.01, master="gauss-seidel")
        measures = ["final(prey.x)", "final(prey.letters)"]
        found = sweep(system, samples, measure=measures, experiment=experiment, workers=2)
    expected = [held("gauss-seidel", 200, 0.01, sample["prey.birth"])[-1, 0] for sample in samples]
    np.testing.assert_allclose(found["final(prey.x)"], expected, rtol=1e-12)
    np.testing.assert_array_equal(found["final(prey.letters)"], [4.0, 6.0])


def test_an_fmu_that_ends_the_simulation(foreign: Callable[..., Path]) -> None:
    """fmi2Discard with fmi2Terminated is a normal end (FMI 2.0.5, section 4.2): the result ends there."""
    with System([FmuPart("p", foreign("PLANT", ends=True))], start={"p.u": 1.0}) as system:
        found = system.run(stop=1.0, step=0.1)
    assert found.attrs["ended"] == "part 'p' ended the simulation in the step from t = 0.6 s"
    times = [*(np.arange(7) * 0.1), 0.625]  # fmi2LastSuccessfulTime
    np.testing.assert_allclose(found["time"], times, rtol=1e-12)
    np.testing.assert_allclose(found["p.x"], 1.0 - np.exp(-np.array(times) / 0.5), rtol=1e-12)


@pytest.mark.parametrize("count", ["-1", "2000000000"])
def test_impossible_event_indicators(foreign: Callable[..., Path], tmp_path: Path, count: str) -> None:
    declared = f' numberOfEventIndicators="{count}" guid="'.encode()
    path = _changed(foreign("GAIN"), tmp_path / "a.fmu", b' guid="', declared)
    with pytest.raises(FmuError, match=f"declares {count} event indicators: correct numberOfEventIndicators"):
        FmuPart("p", path)


def test_a_library_with_another_name(foreign: Callable[..., Path], tmp_path: Path) -> None:
    path = _changed(foreign("GAIN"), tmp_path / "a.fmu", b'modelIdentifier="foreign"', b'modelIdentifier="other"')
    with pytest.raises(FmuError, match=r"has the library .*foreign\..*, but its modelIdentifier is 'other'"):
        FmuPart("p", path)


def test_an_fmu_without_outputs(foreign: Callable[..., Path], tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = _changed(foreign("GAIN"), tmp_path / "a.fmu", b'causality="output"', b'causality="local"')
    path = _changed(path, tmp_path / "b.fmu", b'<Outputs><Unknown index="1"/></Outputs>', b"")
    with System([FmuPart("p", path)], start={"p.u": 3.0}) as system:
        assert not system.run(stop=0.1, step=0.1).data_vars
        assert "nothing is recorded: name variables in record, such as 'p.y'" in caplog.text
        assert float(system.run(stop=0.1, step=0.1, record=["p.y"])["p.y"][-1]) == 3.0


def _changed(given: Path, path: Path, old: bytes, new: bytes) -> Path:
    """An FMU with another text in its description."""
    with ZipFile(given) as archive, ZipFile(path, "w") as written:
        for member in archive.namelist():
            written.writestr(member, archive.read(member).replace(old, new, 1))
    return path
