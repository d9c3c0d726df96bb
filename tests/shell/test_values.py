"""Setting and getting values: everything can be read, nothing wrong can be set, and a refusal changes nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from ctypes import c_char_p, c_double, c_int, c_uint
from pathlib import Path

import pytest
from shell.elsewhere import Elsewhere
from shell.exchanging import SITUATIONS, begin, go_on, go_to
from shell.instance import (
    ABSENT,
    CO_SIMULATION,
    DISCARD,
    ERROR,
    LAST_SUCCESSFUL_TIME,
    OK,
    TERMINATED,
    Instance,
    Library,
    load,
    signals,
)
from shell.jobs import called

NOT_FINITE = (math.nan, math.inf, -math.inf)
TYPES = ("Real", "Integer", "Boolean")


@pytest.fixture
def running(library: Library, situation: str) -> Iterator[Instance]:
    """An instance after a step of 10 ms."""
    first = signals(library, 1, 1)
    with Instance(library, kind=SITUATIONS[situation]) as made:
        begin(made, SITUATIONS[situation], **first[0])
        between = "co-simulation" if situation == "co-simulation" else "continuous-time mode"
        go_on(made, between, first, 0.0, 0.01)
        go_to(made, situation)
        yield made


def settable(library: Library, situation: str) -> list[str]:
    """Names of the Real variables that may be set: while a solver works, of inputs only."""
    names = library.names("input") if situation == "continuous-time mode" else library.settable()
    return [name for name in names if library.variables[name].type == "Real"]


def states(library: Library) -> set[str]:
    """Names of the continuous states."""
    return {v.derivative.name for v in library.variables.values() if v.derivative is not None}


def unused_reference(library: Library) -> int:
    return 1 + max(int(v.valueReference) for v in library.variables.values())


# ---- reading


def test_one_call_reads_all_reals_and_time_among_them(library: Library, running: Instance) -> None:
    """As libcosim does each step, parameters and the independent variable included."""
    names = library.names(type="Real")
    assert "time" in names
    assert dict(zip(names, running.get(*names), strict=True)) == {name: running.get1(name) for name in names}


# ---- refusing


def guarded(library: Library) -> set[str]:
    """Inputs that may be NaN: those of a law, also inside a composite FMU, see tests/laws/test_fault.py."""
    faults = {name: f"{name.rpartition('.')[0]}.fault".lstrip(".") for name in library.names("input")}
    return {name for name, fault in faults.items() if fault in library.variables}


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_values_that_are_not_finite_are_discarded(
    library: Library, situation: str, running: Instance, bad: float
) -> None:
    before = running.everything(), running.serialised()
    states_too = set() if situation == "co-simulation" else states(library)
    for name in (*settable(library, situation), *states_too):
        if name not in guarded(library):
            running.messages.clear()
            assert running.try_set({name: bad}) == [DISCARD], name
            _, status, category, message = running.messages[-1]
            assert (status, category) == (DISCARD, "logStatusDiscard")
            assert name.split("[")[0].encode() in message and b"not finite" in message
            assert (running.everything(), running.serialised()) == before
    go_on(running, situation, signals(library, 1, 1), 0.01, 0.01)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_start_values_that_are_not_finite_are_discarded(library: Library, instance: Instance, bad: float) -> None:
    reals = [v.name for v in library.variables.values() if v.start is not None and v.type == "Real"]
    started = [name for name in reals if name not in guarded(library)]
    before = instance.serialised()
    for name in started:
        assert instance.try_set({name: bad}) == [DISCARD], name
        assert instance.serialised() == before
    assert len(instance.messages) == len(started)


@pytest.mark.parametrize("type", TYPES)
@pytest.mark.parametrize("function", ["Get", "Set"])
def test_unknown_and_wrongly_typed_references_are_errors(
    library: Library, running: Instance, function: str, type: str
) -> None:
    before = running.everything(), running.serialised()
    wrong = [int(v.valueReference) for v in library.variables.values() if v.type != type]
    for reference in (*wrong, unused_reference(library), 2**31, 2**32 - 1):
        running.messages.clear()
        assert running.call_values(f"{function}{type}", [reference], [0]) == ERROR
        assert running.messages[-1][1:3] == (ERROR, "logStatusError")
        assert type.encode() in running.messages[-1][3]
    assert (running.everything(), running.serialised()) == before


def test_a_get_with_one_wrong_reference_writes_nothing(library: Library, running: Instance) -> None:
    buffer = (c_double * 2)(-7.0, -7.0)
    assert running.call("GetReal", (c_uint * 2)(0, unused_reference(library)), 2, buffer) == ERROR
    assert list(buffer) == [-7.0, -7.0]


def test_there_are_no_strings(running: Instance) -> None:
    references, values = (c_uint * 1)(0), (c_char_p * 1)(b"text")
    assert running.call("GetString", references, 1, values) == ERROR
    assert running.call("SetString", references, 1, values) == ERROR
    assert running.call("GetString", None, 0, None) == OK
    assert running.call("SetString", None, 0, None) == OK


def test_nothing_is_a_legal_number_of_variables(situation: str, running: Instance) -> None:
    """PyFMI's master calls fmi2SetReal with n = 0."""
    before = running.everything()
    for type in TYPES:
        for function in ("Get", "Set"):
            assert running.call(f"{function}{type}", None, 0, None) == OK
    if situation == "co-simulation":
        assert running.call("SetRealInputDerivatives", None, 0, None, None) == OK
        assert running.call("GetRealOutputDerivatives", None, 0, None, None) == OK
    assert running.call("GetDirectionalDerivative", None, 0, None, 0, None, None) == OK
    assert running.everything() == before


def test_outputs_locals_and_time_cannot_be_set(library: Library, situation: str, running: Instance) -> None:
    """Except for states in model exchange."""
    before = running.everything(), running.serialised()
    except_for = set() if situation == "co-simulation" else states(library)
    for v in library.variables.values():
        if v.causality in ("output", "local", "independent") and v.name not in except_for:
            assert running.try_set({v.name: running.get1(v.name)}) == [ERROR], v.name
            assert v.name.split("[")[0].encode() in running.messages[-1][3]
    assert (running.everything(), running.serialised()) == before


def test_outputs_and_time_cannot_be_set_before_the_run_either(library: Library, instance: Instance) -> None:
    before = instance.serialised()
    for v in library.variables.values():
        if v.causality in ("output", "independent") or v.initial == "calculated":
            assert instance.try_set({v.name: 0.0}) == [ERROR], v.name
    assert instance.serialised() == before


def test_fixed_parameters_cannot_be_set_during_the_run(library: Library, running: Instance) -> None:
    before = running.everything(), running.serialised()
    for v in library.variables.values():
        if v.variability == "fixed":
            assert running.try_set({v.name: running.get1(v.name)}) == [ERROR], v.name
    assert (running.everything(), running.serialised()) == before


@pytest.mark.parametrize("position", ["first", "last"])
@pytest.mark.parametrize("kind", ["not finite", "unknown"])
def test_a_set_with_one_bad_value_sets_none(
    library: Library, situation: str, running: Instance, position: str, kind: str
) -> None:
    before = running.everything(), running.serialised()
    names = settable(library, situation)
    refusing = [name for name in names if name not in guarded(library)]
    if names and not refusing and kind == "not finite":
        pytest.skip("all that may be set may be NaN")
    for good in names:
        if library.fmi == 3 and "[" in good and good == refusing[-1]:
            continue  # an array of FMI 3.0 has each element once
        v = library.variables[good]
        other = min(max(0.75 * running.get1(good) + 0.01, float(v.min or "-inf")), float(v.max or "inf"))
        pair = [(running.reference(good), other)]
        bad = (running.reference(refusing[-1]), math.nan) if kind == "not finite" else (unused_reference(library), 1.0)
        pair.insert(0 if position == "first" else 1, bad)
        references, values = zip(*pair, strict=True)
        assert running.call_values("SetReal", references, values) == (DISCARD if kind == "not finite" else ERROR)
        assert (running.everything(), running.serialised()) == before


# ---- failed steps


@pytest.mark.parametrize(("name", "values", "h"), [("LuGre", {"v": 1e308}, 0.01), ("Mass", {"F_drive": 1e308}, 10.0)])
def test_a_step_that_overflows_is_discarded_and_leaves_the_instance_at_its_start(
    build_fmu: Callable[..., Path], name: str, values: dict[str, float], h: float
) -> None:
    library = load(build_fmu(name))
    with Instance(library) as run, Instance(library) as undisturbed:
        for each in (run, undisturbed):
            each.initialise()
            each.step(0.0, 0.5)
        with run.saved() as before:
            run.set(values)
            assert run.call("DoStep", 0.5, h, 1) == DISCARD
            assert run.messages[-1][1:3] == (DISCARD, "logStatusDiscard")
            if library.fmi == 2:
                time, ended = c_double(), c_int(7)
                assert run.call("GetRealStatus", LAST_SUCCESSFUL_TIME, time) == OK
                assert run.call("GetBooleanStatus", TERMINATED, ended) == OK
                assert (time.value, ended.value) == (0.5, 0)
                assert run.call("DoStep", 0.5, 0.1, 1) == ERROR, "a failed step is left by a restored state only"
            run.must("SetFMUstate", before)
        for each in (run, undisturbed):
            each.step(0.5, 0.5)
        assert run.everything() == undisturbed.everything()


def test_initial_values_that_overflow_are_refused_at_the_end_of_initialization(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"v": 1e308, "sigma2": 1e10})
        assert run.call("ExitInitializationMode") == ERROR
        assert run.messages[-1][1:3] == (ERROR, "logStatusError")
        run.set({"v": 0.0})
        run.must("ExitInitializationMode")
        run.step(0.0, 0.1)


def test_an_output_that_would_be_nan_is_an_error_of_the_get(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.initialise()
        run.set({"v": 1e308})
        value = c_double(-7.0)
        assert run.call("GetReal", (c_uint * 1)(run.reference("F")), 1, value) == ERROR
        assert value.value == -7.0
        run.set({"v": 1e-3})
        assert math.isfinite(run.get1("F"))


# ---- null pointers

CO_SIMULATION_ONLY = {
    *("SetRealInputDerivatives", "GetRealOutputDerivatives", "GetRealStatus", "GetBooleanStatus"),
}
NULL_CALLS = {
    "GetReal": ("none, 1, none", "one, 1, none"),
    "SetReal": ("none, 1, none", "one, 1, none"),
    "GetInteger": ("none, 1, none",),
    "SetInteger": ("none, 1, none",),
    "GetBoolean": ("none, 1, none",),
    "SetBoolean": ("none, 1, none",),
    "GetString": ("none, 1, none",),
    "SetString": ("none, 1, none",),
    "SetDebugLogging": ("1, 1, none",),
    "GetFMUstate": ("none",),
    "SetFMUstate": ("none",),
    "SerializedFMUstateSize": ("none, none",),
    "SerializeFMUstate": ("none, none, 100",),
    "DeSerializeFMUstate": ("none, 100, none",),
    "GetDirectionalDerivative": (
        *("none, 1, none, 1, none, none", "none, 1, input, 1, number, number", "output, 1, none, 1, number, number"),
        *("output, 1, input, 1, none, number", "output, 1, input, 1, number, none"),
    ),
    "SetRealInputDerivatives": ("none, 1, order, number", "input, 1, none, number", "input, 1, order, none"),
    "GetRealOutputDerivatives": ("none, 1, order, number", "output, 1, none, number", "output, 1, order, none"),
    "GetRealStatus": (f"{LAST_SUCCESSFUL_TIME}, none",),
    "GetBooleanStatus": (f"{TERMINATED}, none",),
}


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(called)
    yield made
    made.end()


EXCHANGE_NULL_CALLS = {
    "continuous-time mode": {
        "CompletedIntegratorStep": ("1, none, none", "1, flag, none", "1, none, flag"),
        "SetContinuousStates": ("none, 1",),
        "GetContinuousStates": ("none, 1",),
        "GetNominalsOfContinuousStates": ("none, 1",),
        "GetDerivatives": ("none, 1",),
        "GetEventIndicators": ("none, 1",),
    },
    "event mode": {"NewDiscreteStates": ("none",), "GetDerivatives": ("none, 1",)},
}
EACH_NULL_CALL = [
    (situation, name, each)
    for situation, kind in SITUATIONS.items()
    for name, calls in (NULL_CALLS | EXCHANGE_NULL_CALLS.get(situation, {})).items()
    for each in calls
    if kind == CO_SIMULATION or name not in CO_SIMULATION_ONLY
]


@pytest.mark.parametrize(("situation", "function", "arguments"), EACH_NULL_CALL)
def test_a_null_pointer_for_an_array_is_an_error_with_a_message(
    build_fmu: Callable[..., Path], elsewhere: Elsewhere, tmp_path: Path, situation: str, function: str, arguments: str
) -> None:
    """In another process, as a crash would end this one; of Dahl, which has a state and an event indicator."""
    fmu = build_fmu("Dahl")
    if load(fmu).fmi == 3 and function in ABSENT:
        pytest.skip(f"FMI 3.0 has no function for {function}")
    given = tuple(int(each) if each.isdigit() else each for each in arguments.split(", "))
    assert elsewhere.run(fmu, tmp_path / "trace.txt", function, given, situation) == (ERROR, 1)
