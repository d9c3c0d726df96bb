"""Setting and getting values: everything can be read, nothing wrong can be set, and a refusal changes nothing."""

from __future__ import annotations

import math
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from ctypes import c_char_p, c_double, c_int, c_uint
from pathlib import Path

import pytest
from fmi.instance import DISCARD, ERROR, LAST_SUCCESSFUL_TIME, OK, TERMINATED, Instance, Library, load, signals

NOT_FINITE = (math.nan, math.inf, -math.inf)
TYPES = ("Real", "Integer", "Boolean")


def unused_reference(library: Library) -> int:
    return 1 + max(int(v.valueReference) for v in library.variables.values())


def settable(library: Library) -> list[str]:
    """What may be set during a run: inputs and tunable parameters."""
    return [v.name for v in library.variables.values() if v.causality == "input" or v.variability == "tunable"]


@pytest.fixture
def running(library: Library, instance: Instance) -> Instance:
    instance.initialise(**signals(library, 1, 1)[0])
    instance.step(0.0, 0.01)
    instance.everything()
    return instance


# ---- reading


def test_everything_declared_can_be_read_in_initialization_mode_and_later(instance: Instance) -> None:
    instance.setup()
    instance.must("EnterInitializationMode")
    instance.everything()
    instance.must("ExitInitializationMode")
    instance.everything()
    instance.step(0.0, 0.01)
    instance.everything()
    instance.must("Terminate")
    instance.everything()


def test_one_call_reads_all_reals_and_time_among_them(library: Library, running: Instance) -> None:
    """As libcosim does each step, parameters and the independent variable included."""
    names = library.names(type="Real")
    assert "time" in names
    assert dict(zip(names, running.get(*names), strict=True)) == {name: running.get1(name) for name in names}


def test_what_was_set_is_read_back(library: Library, running: Instance) -> None:
    for name in settable(library):
        v = library.variables[name]
        if v.type == "Boolean":
            value = 1.0 - running.get1(name)
        else:
            value = max(min(0.75, float(v.max or "inf")), float(v.min or "-inf"))
        running.set({name: value})
        assert running.get1(name) == value, name


def test_reading_twice_gives_the_same(running: Instance) -> None:
    assert running.everything() == running.everything()


def test_outputs_follow_inputs_that_are_set_without_a_step(library: Library) -> None:
    """Masters read outputs again after setting inputs: what feeds through must be computed on the way."""
    with Instance(library) as in_run, Instance(library) as new:
        in_run.initialise()
        inputs = signals(library, 9, 1)[0]
        outputs = library.names("output")
        in_run.everything()
        in_run.set(inputs)
        after = in_run.get(*outputs)
        new.initialise(**inputs)
        assert after == new.get(*outputs)


def test_inputs_pass_to_outputs_in_initialization_mode(library: Library) -> None:
    """Masters iterate over connected inputs there: whatever was set before, the last set counts."""
    outputs = library.names("output")
    with Instance(library) as once, Instance(library) as iterated:
        for run in (once, iterated):
            run.setup()
            run.must("EnterInitializationMode")
        for inputs in signals(library, 10, 10):
            iterated.set(inputs)
            iterated.get(*outputs)
        once.set(inputs)
        assert once.get(*outputs) == iterated.get(*outputs)
        for run in (once, iterated):
            run.must("ExitInitializationMode")
        assert once.get(*outputs) == iterated.get(*outputs)
        once.step(0.0, 0.1)
        iterated.step(0.0, 0.1)
        assert once.everything() == iterated.everything()


@pytest.mark.parametrize("when", ["instantiated", "before initialization mode", "initialization mode", "after it"])
def test_inputs_and_parameters_may_be_set_early(library: Library, when: str) -> None:
    values = signals(library, 11, 1)[0]
    draw = random.Random(11)
    for name in library.names("parameter", type="Real"):
        v = library.variables[name]
        if when != "after it" or v.variability == "tunable":
            unset = 2.0 if name.startswith("pair[") else 0.1  # zeros belong outside the unit circle
            value = (library.start(name) or unset) * draw.uniform(0.9, 1.1)
            values[name] = min(max(value, float(v.min or "-inf")), float(v.max or "inf"))
    with Instance(library) as run:
        if when == "instantiated":
            run.set(values)
        run.setup()
        if when == "before initialization mode":
            run.set(values)
        run.must("EnterInitializationMode")
        if when == "initialization mode":
            run.set(values)
        run.must("ExitInitializationMode")
        if when == "after it":
            run.set(values)
        assert run.get(*values) == list(values.values())
        run.step(0.0, 0.01)
        with Instance(library) as other:
            other.initialise(**values)
            other.step(0.0, 0.01)
            assert run.everything() == other.everything()


# ---- refusing


def guarded(library: Library) -> set[str]:
    """Inputs that may be NaN: those of a law, see tests/laws/test_fault.py."""
    return set(library.names("input")) if "fault" in library.variables else set()


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_values_that_are_not_finite_are_discarded(library: Library, running: Instance, bad: float) -> None:
    before = running.everything(), running.serialised()
    for name in settable(library):
        if library.variables[name].type == "Real" and name not in guarded(library):
            running.messages.clear()
            assert running.try_set({name: bad}) == [DISCARD], name
            _, status, category, message = running.messages[-1]
            assert (status, category) == (DISCARD, "logStatusDiscard")
            assert name.split("[")[0].encode() in message and b"not finite" in message
            assert (running.everything(), running.serialised()) == before
    running.step(0.01, 0.01)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_start_values_that_are_not_finite_are_discarded(library: Library, instance: Instance, bad: float) -> None:
    reals = [v.name for v in library.variables.values() if v.start is not None and v.type == "Real"]
    started = [name for name in reals if name not in guarded(library)]
    before = instance.serialised()
    for name in started:
        assert instance.try_set({name: bad}) == [DISCARD], name
        assert instance.serialised() == before
    assert len(instance.messages) == len(started)


def test_values_outside_their_limits_are_discarded(library: Library, instance: Instance) -> None:
    before = instance.serialised()
    tried = 0
    for v in library.variables.values():
        if v.causality not in ("parameter", "input") or v.type == "Boolean":
            continue
        for limit, way in ((v.min, -1.0), (v.max, 1.0)):
            if limit is not None:
                outside = (
                    int(limit) + int(way) if v.type == "Integer" else float(limit) + way * max(abs(float(limit)), 1e-3)
                )
                assert instance.try_set({v.name: outside}) == [DISCARD], v.name
                assert instance.messages[-1][1] == DISCARD
                assert instance.try_set({v.name: float(limit)}) == [OK], v.name
                instance.set({v.name: library.start(v.name)})
                tried += 1
    assert instance.serialised() == before
    assert len(instance.messages) == tried


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


def test_nothing_is_a_legal_number_of_variables(running: Instance) -> None:
    """PyFMI's master calls fmi2SetReal with n = 0."""
    before = running.everything()
    for type in TYPES:
        for function in ("Get", "Set"):
            assert running.call(f"{function}{type}", None, 0, None) == OK
    assert running.call("SetRealInputDerivatives", None, 0, None, None) == OK
    assert running.call("GetRealOutputDerivatives", None, 0, None, None) == OK
    assert running.call("GetDirectionalDerivative", None, 0, None, 0, None, None) == OK
    assert running.everything() == before


def test_outputs_locals_and_time_cannot_be_set(library: Library, running: Instance) -> None:
    before = running.everything(), running.serialised()
    for v in library.variables.values():
        if v.causality in ("output", "local", "independent"):
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
def test_a_set_with_one_bad_value_sets_none(library: Library, running: Instance, position: str, kind: str) -> None:
    before = running.everything(), running.serialised()
    names = [name for name in settable(library) if library.variables[name].type == "Real"]
    for good in names:
        v = library.variables[good]
        other = min(max(0.75 * running.get1(good) + 0.01, float(v.min or "-inf")), float(v.max or "inf"))
        pair = [(running.reference(good), other)]
        bad = (running.reference(names[-1]), math.nan) if kind == "not finite" else (unused_reference(library), 1.0)
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
    "GetDirectionalDerivative": ("none, 1, none, 1, none, none", "one, 1, one, 1, none, none"),
    "SetRealInputDerivatives": ("none, 1, none, none", "one, 1, none, none"),
    "GetRealOutputDerivatives": ("none, 1, none, none", "two, 1, none, none"),
    "GetRealStatus": (f"{LAST_SUCCESSFUL_TIME}, none",),
    "GetBooleanStatus": (f"{TERMINATED}, none",),
}
CALL = """
import sys
from ctypes import c_uint
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmi.instance import Instance, load
none, one, two = None, (c_uint * 1)(1), (c_uint * 1)(2)
with Instance(load(Path(sys.argv[2]))) as run:
    run.initialise()
    print(run.call(sys.argv[3], *eval(f"({sys.argv[4]},)")), len(run.messages))
"""


@pytest.mark.parametrize(
    ("function", "arguments"), [(name, each) for name, calls in NULL_CALLS.items() for each in calls]
)
def test_a_null_pointer_for_an_array_is_an_error_with_a_message(
    build_fmu: Callable[..., Path], tmp_path: Path, function: str, arguments: str
) -> None:
    """In a child process, as a crash would end this one."""
    command = [sys.executable, "-c", CALL, Path(__file__).parents[1], shutil.copy(build_fmu("LuGre"), tmp_path)]
    run = subprocess.run([*command, function, arguments], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout.split()) == (0, [str(ERROR), "1"]), run.stderr
