"""A refused call changes nothing: neither the saved state, to the last byte, nor the arrays of the caller.

The states are compared as they are. No other call refreshes the outputs before, as that would hide a change.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from ctypes import c_double, c_int, c_uint
from itertools import product
from pathlib import Path

import pytest
from shell.exchanging import SITUATIONS, begin, go_on, go_to
from shell.instance import DISCARD, ERROR, MODEL_EXCHANGE, OK, EventInfo, Instance, Library, load
from thorough import some

H = 1e-3
HEADER = 64  # bytes of a serialised state before the model
UNTOUCHED = -7.25
EXTREMES = (1e308, 1.7e308, 1e160)
OVERFLOWING = {
    "Belt": ("F_friction", 1e308, "v"),
    "Bristle": ("v", 1e308, "F"),
    "BurridgeKnopoff": ("v", 1e308, "F"),
    "ElastoPlastic": ("v", 1e160, "F"),
    "FrenkelKontorova": ("F_drive", 1e308, "v"),
    "FrenkelKontorovaTomlinson": ("v", 1e308, "energy"),
    "GenericAsperity": ("v", 1e308, "F"),
    "KarnoppMass": ("F_ext", 1e308, "v"),
    "LuGre": ("v", 1e160, "F"),
    "Mass": ("F_drive", 1e308, "v"),
    "PrandtlTomlinson": ("v", 1e308, "F"),
    "SevenParameter": ("v", 1e308, "F"),
    "SwitchMass": ("F_load", 1e308, "v"),
}
"""Blocks, an input and its value, an output: the output is finite, its derivative is not."""


def running(library: Library, situation: str = "co-simulation") -> Instance:
    kind = SITUATIONS[situation]
    run = begin(Instance(library, kind=kind), kind)
    if kind == MODEL_EXCHANGE:
        go_on(run, "continuous-time mode", [{}], 0.0, H)
        go_to(run, situation)
    else:
        run.step(0.0, H)
    return run


def places_of_mode(library: Library) -> set[int]:
    """Words in which the mode is stored, which a discarded step may change; a composite also has those of its parts."""
    with Instance(library) as run:
        first = run.serialised()
        run.must("EnterInitializationMode")
        second = run.serialised()
    return {k // 4 for k in range(HEADER, len(first)) if first[k] != second[k]}


def without(data: bytes, words: set[int]) -> bytes:
    return b"".join(data[4 * k : 4 * k + 4] for k in range(HEADER // 4, len(data) // 4) if k not in words)


def check(run: Instance, function: str, *arguments: object, mode: set[int] | None = None) -> bool:
    """Call; whether the call was refused. It must have changed nothing then, except for the mode in these words."""
    written = [each for each in arguments if isinstance(each, (ctypes.Array, ctypes.Structure))]
    before, arrays = run.serialised(), [bytes(each) for each in written]
    status = run.call(function, *arguments)
    if status not in (DISCARD, ERROR):
        return False
    after = run.serialised()
    if mode is not None:
        before, after = without(before, mode), without(after, mode)
    assert after == before, f"{function} was refused and changed the state: {run.messages[-1:]}"
    assert [bytes(each) for each in written] == arrays, f"{function} wrote a value"
    return True


def output_derivatives(run: Instance, names: Sequence[str]) -> tuple[object, ...]:
    n = len(names)
    return (c_uint * n)(*map(run.reference, names)), n, (c_int * n)(*[1] * n), (c_double * n)(*[UNTOUCHED] * n)


def calls_of_results(library: Library, run: Instance, situation: str) -> Iterator[tuple[object, ...]]:
    """Calls that compute a result from the values as they are, for one variable and for all."""
    outputs, inputs = library.names("output", type="Real"), library.names("input", type="Real")
    if situation == "co-simulation":
        for names in (outputs, *([name] for name in outputs)):
            yield "GetRealOutputDerivatives", *output_derivatives(run, names)
        yield "DoStep", H, H, 1
    else:
        vectors = {"GetDerivatives": library.states, "GetContinuousStates": library.states}
        for function, n in (vectors | {"GetEventIndicators": library.indicators}).items():
            yield function, (c_double * n)(*[UNTOUCHED] * n), n
    if situation == "event mode":
        yield "NewDiscreteStates", EventInfo(next=UNTOUCHED)
    n = len(outputs)
    references, values = (c_uint * n)(*map(run.reference, outputs)), (c_double * n)(*[UNTOUCHED] * n)
    for name in inputs[:1]:
        known, seed = (c_uint * 1)(run.reference(name)), (c_double * 1)(1.0)
        yield "GetDirectionalDerivative", references, n, known, 1, seed, values
    yield "GetReal", references, n, values


def changes(library: Library, situation: str) -> Iterator[Callable[[Instance], int]]:
    """Each input, state, slope and tunable parameter set to values of any size; the status is returned.

    What may not be set in the situation is refused and so no change.
    """

    def value(name: str, x: float) -> Callable[[Instance], int]:
        return lambda run: run.try_set({name: x})[0]

    def slope(name: str, x: float) -> Callable[[Instance], int]:
        return lambda run: run.input_derivatives({name: x})

    for name, x in product(library.names("input", type="Real"), EXTREMES):
        yield value(name, x)
        if situation == "co-simulation":
            yield slope(name, x)
    for v in library.variables.values():
        if (v.type, v.causality, v.variability) == ("Real", "parameter", "tunable"):
            yield value(v.name, 1e308)
        if v.derivative is not None and situation != "co-simulation":
            yield from (value(v.derivative.name, x) for x in EXTREMES)


def test_results_that_are_not_finite_change_nothing(library: Library, situation: str) -> None:
    """Values of any size, and every call that computes something from them."""
    mode = places_of_mode(library)
    with running(library, situation) as run, run.saved() as state:
        for change in changes(library, situation):
            for call in calls_of_results(library, run, situation):
                run.must("SetFMUstate", state)
                if change(run) == OK:
                    check(run, *call, mode=mode if call[0] == "DoStep" else None)


@pytest.mark.parametrize("name", some([*OVERFLOWING], [*OVERFLOWING][::4]))
def test_a_derivative_that_overflows_changes_nothing(name: str, build_fmu: Callable[..., Path]) -> None:
    value, size, output = OVERFLOWING[name]
    library = load(build_fmu(name))
    with running(library) as run:
        run.set({value: size})
        assert check(run, "GetRealOutputDerivatives", *output_derivatives(run, [output]))


@pytest.mark.parametrize("name", ["Bristle", "BurridgeKnopoff", "GenericAsperity"])
def test_a_failed_step_leaves_what_an_earlier_larger_run_has_left_alone(
    name: str, build_fmu: Callable[..., Path]
) -> None:
    """Of a memory for many members the run before used more than the one of now."""
    library = load(build_fmu(name))
    mode = places_of_mode(library)
    with Instance(library) as run:
        for count in (900, 5):
            run.must("Reset")
            run.initialise(N=count, v=1e-3)
            for k in range(3):
                run.step(k * H, H)
        run.set({"v": 1e300})
        assert check(run, "DoStep", 3 * H, 1e10, 1, mode=mode)
