"""What surrounds every law and controller: inputs that are not finite, and relations of parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from shell.instance import DISCARD, ERROR, OK, WARNING, Instance, Library, load, signals
from shell.selection import EACH_FEATURE
from thorough import some

from friction_fmus import build
from friction_fmus.blocks.catalogue import catalogue, laws_folder
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.law import discover_laws
from harness import CallablePart, FmuPart, System, Wire

LAWS = {law.name: law for law in discover_laws(laws_folder())}
CONTROLLERS = [block.name for block in catalogue().values() if block.kind == "compensator" and not block.is_law]


def knows_time(library: Library) -> bool:
    """Whether a gap counts; see test_fault_in_time.py and test_missing_samples.py."""
    return library.identifier in IN_TIME or "missed" in library.variables


IN_TIME = ("LocalFunctionEstimator", "ImpulsiveControl", "IterativeLearning", "RepetitiveController")
"""Controllers for which a bad sample is one that passes; their tests are in test_fault_in_time.py."""
Ts = 1e-3
BAD = (math.nan, math.inf, -math.inf)


@pytest.fixture(params=some([*LAWS, *CONTROLLERS], [*EACH_FEATURE, *CONTROLLERS[:1]]))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu(request.param, Ts=Ts))


def shown(run: Instance) -> list[float]:
    """Outputs and states, but for the number of samples missed."""
    return run.get(*(v for v in run.library.names("output", "local") if v not in ("fault", "missed")))


def test_fault_is_a_boolean_output_that_depends_on_every_real_input(library: Library) -> None:
    fault = library.variables["fault"]
    assert (fault.type, fault.causality, fault.variability) == ("Boolean", "output", "discrete")
    (unknown,) = [u for u in library.description.outputs if u.variable.name == "fault"]
    assert {v.name for v in unknown.dependencies} == set(library.names("input", type="Real"))


@pytest.mark.parametrize("bad", BAD)
def test_a_bad_input_holds_everything_and_warns_once(library: Library, bad: float) -> None:
    """Every input in turn; the values before, the step with it and the one after it, as without the bad step."""
    for name in library.names("input", type="Real"):
        with Instance(library) as run, Instance(library) as other:
            inputs = signals(library, 2, 20)
            for one in (run, other):
                one.initialise()
                for k, values in enumerate(inputs):
                    one.set(values)
                    one.step(k * Ts, Ts)
            before = shown(run)
            run.messages.clear()
            for k, expected in ((20, WARNING), (21, OK), (22, OK)):
                assert run.try_set({name: bad}) == [OK]
                assert run.call("DoStep", k * Ts, Ts, 1) == expected
                assert run.get1("fault") == 1.0
                assert shown(run) == before
            (message,) = run.messages
            assert message[1:3] == (WARNING, "logStatusWarning")
            assert f": {name} is not finite" in message[3].decode()
            # the good input comes back: as if the bad samples had not been, if the law does not know the time
            run.set(inputs[-1])
            run.step(23 * Ts, Ts)
            other.set(inputs[-1])
            other.step(20 * Ts, Ts)
            assert run.get1("fault") == 0.0
            assert knows_time(library) or shown(run) == shown(other)
            # a second fault is no second warning
            run.set({name: bad})
            assert run.call("DoStep", 24 * Ts, Ts, 1) == OK
            assert run.get1("fault") == 1.0


def test_a_bad_input_before_the_first_sample_leaves_the_start(library: Library) -> None:
    name = library.names("input", type="Real")[0]
    with Instance(library) as run, Instance(library) as other:
        run.initialise(**{name: math.nan})
        assert run.get1("fault") == 1.0
        assert all(value == 0.0 for value in run.get(*library.names("output", type="Real")))
        assert run.call("DoStep", 0.0, Ts, 1) == WARNING
        other.initialise()
        for one, t in ((run, Ts), (other, 0.0)):
            one.set(signals(library, 3, 1)[0])
            one.step(t, Ts)
        assert library.identifier == "LocalFunctionEstimator" or shown(run) == shown(other)


def test_a_bad_sample_inside_a_step_of_many(library: Library) -> None:
    """The input is held over the step: all of its samples are bad; a state saved in the fault carries it."""
    name = library.names("input", type="Real")[0]
    with Instance(library) as run:
        run.initialise()
        run.set({name: math.nan})
        assert run.call("DoStep", 0.0, 10 * Ts, 1) == WARNING
        with run.saved() as state:
            run.set({name: 0.0})
            run.step(10 * Ts, Ts)
            assert run.get1("fault") == 0.0
            run.must("SetFMUstate", state)
        assert run.get1("fault") == 1.0
        assert run.call("DoStep", 10 * Ts, Ts, 1) == OK


def test_a_sensor_that_fails_in_a_system(build_fmu: Callable[..., Path], caplog: pytest.LogCaptureFixture) -> None:
    """Three samples of NaN to a PID in the harness: what it knew, then the closed form without those samples."""
    times = np.arange(12) * Ts
    bad = (times > 0.0045) & (times < 0.0075)
    x = np.where(bad, math.nan, 1e-3 * times)
    sensor = CallablePart("sensor", lambda t, u, s: x[min(round(t / Ts), 11)], [], ["y"], sampled=True)
    start = {f"pid.{name}": 0.0 for name in ("r", "rd", "rdd", "v")}
    system = System([sensor, FmuPart("pid", build_fmu("PID", Ts=Ts))], [Wire("sensor.y", "pid.x")], start=start)
    result = system.run(stop=12 * Ts, step=Ts)
    good = np.where(bad, 0.0, x)
    integral = Ts * (np.cumsum(good) - good)
    u = -(12000.0 * good + 250e3 * integral)
    u[bad] = u[~bad & (times < 0.005)][-1]
    np.testing.assert_allclose(result["pid.u"].values[1:], u, rtol=1e-12, atol=1e-15)
    assert (result["pid.fault"].values[1:] == bad).all()
    assert sum("pid at t = 0.005 s: x is not finite" in record.message for record in caplog.records) == 1


# ---- relations of parameters

LIMITS = [name for name, law in LAWS.items() if "u_min <= u_max" in law.conditions.texts]


def test_all_laws_with_limits_say_their_order() -> None:
    assert {name for name, law in LAWS.items() if {"u_min", "u_max"} <= {v.name for v in law.given}} == set(LIMITS)


@pytest.mark.parametrize("name", some([*LIMITS, *CONTROLLERS], ["PID", "LuGreFeedforward", *CONTROLLERS[:1]]))
def test_limits_in_the_wrong_order_are_refused(name: str, build_fmu: Callable[..., Path]) -> None:
    library = load(build_fmu(name, Ts=Ts))
    with Instance(library) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"u_min": 2.0, "u_max": 1.0})
        assert run.call("ExitInitializationMode") == ERROR
        assert b'the parameters of "instance" must satisfy u_min <= u_max' in run.messages[-1][3]
        run.set({"u_max": 2.0})
        run.must("ExitInitializationMode")
        run.step(0.0, Ts)
        # tuned to it later: no step
        run.set({"u_max": 1.0})
        assert run.call("DoStep", Ts, Ts, 1) == DISCARD
        assert b"must satisfy u_min <= u_max" in run.messages[-1][3]
        assert run.get1("time") == Ts


LAW = """
from casadi import SX
from friction_fmus.lawkit.law import *

@law("Notch", "Two frequencies", source="none", Ts=1e-3, outputs={"u": Output(FORCE, "sum")}, CONDITIONS)
def notch(
    x: SX = Input(LENGTH, 0.5, "displacement"),
    w: SX = Parameter("rad/s", 20.0, "frequency", min=0.0),
    k: SX = Parameter(STIFFNESS, (5e4, 3e4), "stiffness of the elements", min=0.0),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    '''Elements.'''
    return {"u": (k[0] - k[1]) * w * x * Ts}
"""
GOOD = """conditions={
    "w Ts < 1": lambda w, Ts: w * Ts < 1.0,
    "k[1] > k[2]": lambda k: k[0] > k[1],
}"""


def test_conditions_with_a_vector_and_the_sample_time(tmp_path: Path) -> None:
    path = tmp_path / "notch.py"
    path.write_text(LAW.replace("CONDITIONS", GOOD), encoding="utf-8")
    (law,) = discover_laws(path)
    assert law.conditions.violated({}) == ()
    assert law.conditions.violated({"w": 1e3, "k": (1.0, 1.0)}) == ("w Ts < 1", "k[1] > k[2]")
    library = load(build(path, tmp_path))
    for values, text in (({"w": 1e3}, b"w Ts < 1"), ({"k[2]": 5e4}, b"k[1] > k[2]"), ({"Ts": 0.05}, b"w Ts < 1")):
        with Instance(library) as run:
            run.setup()
            run.must("EnterInitializationMode")
            run.set(values)
            assert run.call("ExitInitializationMode") == ERROR
            assert text in run.messages[-1][3]


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        ('conditions={"w > 1": lambda W: W > 1}', "the condition 'w > 1' reads W, which is not a parameter (did you"),
        ('conditions={"x > 1": lambda x: x > 1}', "the condition 'x > 1' reads x, which is not a parameter"),
        ('conditions={"w > 30": lambda w: w > 30}', "its start values violate the condition w > 30"),
        ('conditions={"k > 0": lambda k: k > 0}', "the condition 'k > 0' has the shape (2, 1); return one truth value"),
        ('conditions={"": lambda w: w > 0}', "the text of a condition must be one line of text"),
    ],
)
def test_bad_conditions_get_one_sentence(conditions: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "notch.py"
    path.write_text(LAW.replace("CONDITIONS", conditions), encoding="utf-8")
    with pytest.raises(FrictionError) as caught:
        discover_laws(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
