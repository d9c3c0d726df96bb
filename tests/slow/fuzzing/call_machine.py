"""Random legal and illegal calls of the FMI API, beside a model that says which status each of them must have.

Run as a program, it goes on for a while with ever new sequences: ``python call_machine.py SECONDS [BLOCK...]``, the
time shared by the blocks; ``BLOCK:3`` is the block in FMI 3.0.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer
from io import FileIO
from pathlib import Path
from typing import NamedTuple

from hypothesis import HealthCheck, Phase, note, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

sys.path.insert(0, str(Path(__file__).parents[2]))

from shell.exchanging import KINDS
from shell.facade import IN_3, in_either
from shell.instance import (
    CO_SIMULATION,
    DISCARD,
    ERROR,
    MODEL_EXCHANGE,
    OK,
    WARNING,
    EventInfo,
    Instance,
    Library,
    load,
)
from shell.selection import COMPOSITES

INSTANTIATED, INITIALIZING, STEP_COMPLETE, STEP_FAILED, TERMINATED, EVENTS, SOLVING = "INCFTEX"
BEFORE, WITH_RESULTS, STEPPED, ALWAYS = "IN", "NCFTEX", "CFT", "INCFTEX"
EXCHANGING, WITH_VECTORS = "EX", "NTEX"
MAY_SET, MAY_SET_SLOPES = "INCEX", "INC"
HEADER = 64  # bytes of a serialised state before the model

REFUSED = {DISCARD, ERROR}
DONE = {OK}

NAN, INF = math.nan, math.inf
EXTREME = (0.0, -0.0, 1e-308, 5e-324, -1e-308, 1e308, -1e308, sys.float_info.max, -sys.float_info.max, NAN, INF, -INF)
numbers = st.one_of(
    st.sampled_from(EXTREME), st.floats(-1.0, 1.0), st.floats(-1e6, 1e6), st.floats(allow_nan=True, allow_infinity=True)
)
calm_numbers = st.floats(-1e-2, 1e-2)
sizes = st.sampled_from((1e-4, 1e-3, 1e-3 / 3.0, 1e-2, 0.1))
picks = st.lists(st.tuples(st.integers(0, 10**6), numbers), max_size=4)
statuses = st.integers(-1, 5)


class Kept(NamedTuple):
    """A serialised state, and what the model knew then."""

    data: bytes
    known: tuple[object, ...]


class Calls(RuleBasedStateMachine):
    """One instance of `library`; a line is written to `trace` before each call, for the reader of a crash."""

    library: Library
    kind: int = CO_SIMULATION
    trace: Callable[[str], None]

    def __init__(self) -> None:
        """A new instance."""
        super().__init__()
        self.trace(f"new instance for {KINDS[self.kind]}")
        self.run = Instance(self.library, kind=self.kind)
        sizes = ("Integer", "fixed") if self.library.fmi == 3 else ()  # for configuration mode, see tests/fmi3
        self.rows = [v for v in self.library.variables.values() if (v.type, v.variability) != sizes]
        self.reals = [v for v in self.rows if v.type == "Real"]
        self.states = {v.derivative.name for v in self.rows if v.derivative is not None}
        self.guarded = {v.name for v in self.rows if self._is_guarded(v)}
        self.kept: list[Kept] = []
        self.begin()
        first = self.run.serialised()
        self.run.must("EnterInitializationMode")
        second = self.run.serialised()
        self.run.must("Reset")
        # of a composite FMU also the modes of its parts, and the checksums of their states
        self.modes_at = {k // 4 for k in range(HEADER, len(first)) if first[k] != second[k]}

    def _is_guarded(self, v: object) -> bool:
        """An input of a law, which may be NaN."""
        fault = f"{v.name.rpartition('.')[0]}.fault".lstrip(".")
        return v.causality == "input" and fault in self.library.variables

    def teardown(self) -> None:
        self.trace("free")
        self.run.free()

    def begin(self) -> None:
        """What is known of a new instance."""
        self.mode, self.t, self.start, self.stop = INSTANTIATED, 0.0, 0.0, INF
        self.calm = True  # no value was set that may make a step fail

    # ---- calls

    def try_call(self, allowed: str, expected: set[int], function: str, *arguments: object) -> int:
        """Call; in other modes than the allowed ones it must be an error, else one of the expected statuses."""
        shown = f"fmi2{function}{tuple(map(_shown, arguments))} in {self.mode}"
        self.trace(shown)
        note(shown)
        before = self.run.serialised()
        status = self.run.call(function, *arguments)
        assert status in (expected if self.mode in allowed else {ERROR}), (shown, status, self.run.messages[-1:])
        if status in REFUSED:
            after = self.run.serialised()
            if function == "DoStep" and status == DISCARD:
                before, after = self._without_mode(before), self._without_mode(after)
            assert after == before, f"{shown} was refused with {status} and changed something"
        return status

    def slave(self, modes: str) -> str:
        """The modes in which a function of co-simulation is allowed: none in model exchange."""
        return modes if self.kind == CO_SIMULATION else ""

    def _without_mode(self, data: bytes) -> bytes:
        return b"".join(data[4 * k : 4 * k + 4] for k in range(HEADER // 4, len(data) // 4) if k not in self.modes_at)

    def references(self, chosen: Sequence[tuple[int, float]], among: Sequence[object] | None = None) -> list[int]:
        """Value references: of the given variables mostly, one in seven of any, now and then of none."""
        found = []
        for k, _ in chosen:
            rows = self.rows if k % 7 == 0 or not among else among
            row = rows[k // 7 % len(rows)]
            found.append(10**6 + k if k % 61 == 0 else int(row.valueReference))
        return found

    def row(self, reference: int, type: str) -> object | None:
        """The variable of that type and value reference."""
        return next((v for v in self.rows if v.type == type and int(v.valueReference) == reference), None)

    # ---- life

    @rule(
        limited=st.booleans(),
        tolerance=st.one_of(numbers, st.just(1e-6)),
        start=st.one_of(numbers, st.just(0.0)),
        stops=st.booleans(),
        stop=numbers,
    )
    def setup(self, limited: bool, tolerance: float, start: float, stops: bool, stop: float) -> None:
        good = (
            math.isfinite(start)
            and (not limited or 0.0 < tolerance < INF)
            and (not stops or stop >= start)  # NaN is not
        )
        expected = DONE if good else {ERROR}
        status = self.try_call("I", expected, "SetupExperiment", limited, tolerance, start, stops, stop)
        if status == OK:
            self.t = self.start = start
            self.stop = stop if stops else INF
            self.calm = self.calm and abs(start) < 1e3 and (not limited or tolerance > 1e-9)
            if self.library.fmi == 3:  # the experiment belongs to the next call there
                self.enter()

    @rule()
    def enter(self) -> None:
        if self.try_call("I", DONE, "EnterInitializationMode") == OK:
            self.mode = INITIALIZING

    @rule()
    def leave(self) -> None:
        expected = DONE if self.calm else {OK, ERROR}
        if self.try_call("N", expected, "ExitInitializationMode") == OK:
            self.mode = STEP_COMPLETE if self.kind == CO_SIMULATION else EVENTS

    @rule()
    def initialise(self) -> None:
        """The usual way, so that most calls meet an instance that runs."""
        self.enter()
        self.leave()

    @rule(really=st.integers(0, 3))
    def terminate(self, really: int) -> None:
        if (self.mode not in "CFEX" or really == 0) and self.try_call("CFEX", DONE, "Terminate") == OK:
            self.mode = TERMINATED

    @rule(really=st.integers(0, 2))
    def reset(self, really: int) -> None:
        if (really == 0 or self.mode in "FT") and self.try_call(ALWAYS, DONE, "Reset") == OK:
            self.begin()

    # ---- values

    @rule(chosen=picks, type=st.sampled_from(("Real", "Real", "Real", "Integer", "Boolean")), gentle=st.booleans())
    def set(self, chosen: list[tuple[int, float]], type: str, gentle: bool) -> None:
        among = [v for v in self.rows if v.type == type and v.causality in ("input", "parameter")]
        references = self.references(chosen, among)
        if self.library.fmi == 3 and len({*references}) < len(references):
            return  # an array has each element once
        values, expected = [], DONE
        for reference, (_, number) in zip(references, chosen, strict=True):
            row = self.row(reference, type)
            value = self._value(row, number, type, gentle)
            values.append(value)
            found = self._expected_of_set(row, value, type)
            if expected == DONE:
                expected = found
            elif self.library.fmi == 3 and found != DONE:
                expected = expected | found  # the types of all variables are checked first
        if self.try_call(MAY_SET, expected, f"Set{type}", *_arrays(references, values, type)) == OK:
            rows = [self.row(reference, type) for reference in references]
            self.calm = self.calm and all(
                v.causality == "input" and math.isfinite(x) and abs(x) <= 1e-2
                for v, x in zip(rows, values, strict=True)
            )

    def _value(self, row: object | None, number: float, type: str, gentle: bool) -> float:
        if type != "Real":
            low, high = (-(2**31), 2**31 - 1) if type == "Integer" else (0, 1)
            return int(min(max(number, low), high)) if math.isfinite(number) else low
        if gentle and row is not None and row.causality == "input":
            return 1e-2 * math.sin(number) if math.isfinite(number) else 0.0
        if gentle and row is not None and row.start is not None:
            return float(row.start) * (1.0 + 0.1 * math.sin(number) if math.isfinite(number) else 1.0)
        return number

    def _expected_of_set(self, row: object | None, value: float, type: str) -> set[int]:
        if row is None:
            return {ERROR}
        tunable = row.causality == "input" or (row.causality == "parameter" and row.variability == "tunable")
        if self.mode == SOLVING:
            tunable = row.causality == "input" and type == "Real"
        tunable = tunable or (self.mode in EXCHANGING and row.name in self.states)
        early = row.causality == "parameter" or (row.causality in ("local", "output") and row.initial == "exact")
        if not (tunable or (self.mode in BEFORE and early)):
            return {ERROR}
        if row.name in self.guarded:
            return DONE
        if type == "Boolean":
            return DONE
        low, high = float(row.min or "-inf"), float(row.max or "inf")
        return DONE if math.isfinite(value) and low <= value <= high else {DISCARD}

    @rule(chosen=picks, type=st.sampled_from(("Real", "Real", "Integer", "Boolean")))
    def get(self, chosen: list[tuple[int, float]], type: str) -> None:
        references = self.references(chosen, [v for v in self.rows if v.type == type])
        rows = [self.row(reference, type) for reference in references]
        expected = {ERROR} if None in rows else DONE if self.calm else self.unless_not_finite()
        arrays = _arrays(references, [7.0] * len(references), type)
        status = self.try_call(WITH_RESULTS, expected, f"Get{type}", *arrays)
        for row, value in zip(rows, list(arrays[2]), strict=True):
            if status != OK:
                assert value == 7.0, "a refused call wrote a value"
            elif row.name not in self.guarded:
                assert math.isfinite(value), f"{row.name} = {value} with fmi2OK"

    def unless_not_finite(self) -> set[int]:
        """Statuses of a call that may meet a result that is not finite: a solver then takes another trial."""
        return {OK, DISCARD if self.mode == SOLVING else ERROR}

    @rule(type=st.sampled_from(("Real", "Integer", "Boolean", "String")), sets=st.booleans(), n=st.integers(0, 2))
    def null_arrays(self, type: str, sets: bool, n: int) -> None:
        function, allowed = (f"Set{type}", MAY_SET) if sets else (f"Get{type}", WITH_RESULTS)
        nothing = DONE if sets or self.calm or type == "String" else self.unless_not_finite()
        self.try_call(allowed, {ERROR} if n else nothing, function, None, n, None)

    # ---- derivatives

    @rule(chosen=picks, order=st.sampled_from((1, 1, 1, 0, 2, -1)))
    def input_derivatives(self, chosen: list[tuple[int, float]], order: int) -> None:
        references = self.references(chosen, [v for v in self.reals if v.causality == "input"])
        values = [number for _, number in chosen]
        rows = [self.row(reference, "Real") for reference in references]
        good = all(row is not None and row.causality == "input" for row in rows) and (order == 1 or not rows)
        finite = all(map(math.isfinite, values))
        expected = {ERROR} if not good else DONE if finite else {DISCARD}
        status = self.try_call(
            self.slave(MAY_SET_SLOPES), expected, "SetRealInputDerivatives", *_with_orders(references, order, values)
        )
        self.calm = self.calm and (status != OK or not any(abs(value) > 1.0 for value in values))

    @rule(chosen=picks, order=st.sampled_from((1, 1, 1, 0, 2)))
    def output_derivatives(self, chosen: list[tuple[int, float]], order: int) -> None:
        references = self.references(chosen, [v for v in self.reals if v.causality == "output"])
        rows = [self.row(reference, "Real") for reference in references]
        good = all(row is not None and row.causality == "output" for row in rows) and (order == 1 or not rows)
        arrays = _with_orders(references, order, [7.0] * len(references))
        expected = {OK, ERROR} if good else {ERROR}
        status = self.try_call(self.slave(STEPPED), expected, "GetRealOutputDerivatives", *arrays)
        assert all(map(math.isfinite, arrays[3])) if status == OK else {*arrays[3]} <= {7.0}, "a refused call wrote"

    @rule(unknown=picks, known=picks)
    def directional(self, unknown: list[tuple[int, float]], known: list[tuple[int, float]]) -> None:
        a = self.references(unknown, [v for v in self.reals if v.causality == "output"])
        b = self.references(known, [v for v in self.reals if v.causality == "input"])
        result = (c_double * max(len(a), 1))()
        first, n, _ = _arrays(a, [0.0] * len(a), "Real")
        second, m, seeds = _arrays(b, [number for _, number in known], "Real")
        good = all(map(math.isfinite, seeds)) and None not in [self.row(k, "Real") for k in (*a, *b)]
        expected = {OK, ERROR} if good else {ERROR}
        status = self.try_call(WITH_RESULTS, expected, "GetDirectionalDerivative", first, n, second, m, seeds, result)
        assert all(map(math.isfinite, result)) if status == OK else not any(result), "a refused call wrote a value"

    # ---- steps

    @rule(h=sizes, more=st.integers(1, 3))
    def step(self, h: float, more: int) -> None:
        for _ in range(more):
            self._step(self.t, h)

    @rule(t=numbers, h=numbers, here=st.booleans())
    def step_anyhow(self, t: float, h: float, here: bool) -> None:
        # a step of hours is legal work, but takes as long; one of ages must be discarded at once
        if not 0.1 < h < 1e200:
            self._step(self.t if here else t, h)

    def _step(self, t: float, h: float) -> None:
        slack = 1e-6 * h + 1e-12 * (abs(t) + abs(self.start)) + 1e-12
        good = abs(t) < INF and 0.0 < h < INF and abs(t - self.t) <= slack and t + h <= self.stop + slack
        calm = self.calm and 1e-9 < h < 1.0
        expected = {ERROR} if not good else {OK, WARNING} if calm else {OK, WARNING, DISCARD}
        status = self.try_call("C", expected, "DoStep", t, h, 1)
        if status in (OK, WARNING):
            self.t = t + h
        elif status == DISCARD and self.library.fmi == 2:  # FMI 3.0 keeps the state before the call
            self.mode = STEP_FAILED

    @rule(kind=statuses, type=st.sampled_from(("", "Real", "Integer", "Boolean", "String")), null=st.booleans())
    def ask_status(self, kind: int, type: str, null: bool) -> None:
        if self.library.fmi == 3:
            return
        value = {"Real": c_double, "String": c_char_p}.get(type, c_int)()
        known = (type, kind) in (("Real", 2), ("Boolean", 3))
        expected = {DISCARD} if not known else {ERROR} if null else DONE
        allowed = self.slave(STEPPED)
        self.try_call(allowed, expected, f"Get{type}Status", kind, None if null else byref(value))
        if known and not null and self.mode in allowed:
            assert value.value == (self.t if type == "Real" else 0)

    @rule()
    def cancel(self) -> None:
        if self.library.fmi == 2:
            self.try_call("", DONE, "CancelStep")

    @rule(names=st.lists(st.sampled_from((b"logAll", b"logStatusError", b"logEvents", b"nonsense", None)), max_size=3))
    def log(self, names: list[bytes | None]) -> None:
        good = not {b"nonsense", None} & {*names}
        array = (c_char_p * len(names))(*names)
        self.try_call(ALWAYS, DONE if good else {ERROR}, "SetDebugLogging", 1, len(names), array)

    # ---- states

    @rule()
    def keep(self) -> None:
        known = (self.mode, self.t, self.start, self.stop, self.calm)
        self.kept = [*self.kept[-2:], Kept(self.run.serialised(), known)]

    @rule(which=st.integers(0, 2))
    def restore(self, which: int) -> None:
        if self.kept:
            kept = self.kept[which % len(self.kept)]
            self.trace("restore")
            self.run.restore(kept.data)
            assert self.run.serialised() == kept.data
            self.mode, self.t, self.start, self.stop, self.calm = kept.known
            if self.library.fmi == 3 and self.mode == INSTANTIATED:  # forget the experiment of the facade
                self.run.must("SetupExperiment", 0, 0.0, 0.0, 0, 0.0)

    @rule(place=st.integers(0, 10**7), bits=st.integers(1, 255), cut=st.integers(0, 3))
    def restore_damaged(self, place: int, bits: int, cut: int) -> None:
        data = bytearray(self.run.serialised())
        data[place % len(data)] ^= bits
        damaged = bytes(data[: len(data) - place % len(data)] if cut == 0 else data)
        state = c_void_p()
        self.try_call(ALWAYS, {ERROR}, "DeSerializeFMUstate", damaged, len(damaged), byref(state))
        assert not state.value

    @rule(function=st.sampled_from(("GetFMUstate", "SetFMUstate", "SerializedFMUstateSize", "SerializeFMUstate",
                                    "DeSerializeFMUstate")), n=st.integers(0, 100))  # fmt: skip
    def null_states(self, function: str, n: int) -> None:
        arguments = {
            "SerializedFMUstateSize": (None, None),
            "SerializeFMUstate": (None, None, n),
            "DeSerializeFMUstate": (None, n, None),
        }
        self.try_call(ALWAYS, {ERROR}, function, *arguments.get(function, (None,)))

    @rule(missing=st.integers(1, 100))
    def too_small_a_buffer(self, missing: int) -> None:
        with self.run.saved() as state:
            size = c_size_t()
            self.run.must("SerializedFMUstateSize", state, byref(size))
            buffer = create_string_buffer(size.value)
            few = max(size.value - missing, 0)
            self.try_call(ALWAYS, {ERROR}, "SerializeFMUstate", state, buffer, few)
            assert not any(buffer.raw)


class Exchange(Calls):
    """An instance for model exchange."""

    kind = MODEL_EXCHANGE

    @initialize(far=st.integers(0, 5))
    def start_far(self, far: int) -> None:
        """Most sequences begin in event mode or later."""
        if far > 0:
            self.initialise()
        if far > 1:
            self.discrete_states(1)
            self.solve()

    @rule()
    def enter_events(self) -> None:
        if self.try_call("X", DONE, "EnterEventMode") == OK:
            self.mode = EVENTS

    @rule()
    def solve(self) -> None:
        if self.try_call("E", DONE, "EnterContinuousTimeMode") == OK:
            self.mode = SOLVING

    @rule(null=st.integers(0, 9))
    def discrete_states(self, null: int) -> None:
        info = EventInfo(next=7.0)
        expected = {OK, WARNING} if self.calm else {OK, WARNING, ERROR}
        arguments = (None,) if null == 0 else (byref(info),)
        status = self.try_call("E", {ERROR} if null == 0 else expected, "NewDiscreteStates", *arguments)
        if status not in (OK, WARNING):
            assert info.next == 7.0, "a refused call wrote a value"
            return
        assert (info.again, info.terminate, info.nominals_changed) == (0, 0, 0)
        assert bool(info.defined) == self.library.sampled
        assert not info.defined or self.t < info.next < INF

    @rule(t=numbers, ahead=sizes, far=st.integers(0, 9))
    def set_time(self, t: float, ahead: float, far: int) -> None:
        t = t if far == 0 else self.t + ahead
        if self.library.sampled and abs(t) > self.t + 1e3:
            return  # so many samples are legal work, but take as long
        if self.try_call(EXCHANGING, DONE if math.isfinite(t) else {ERROR}, "SetTime", t) == OK:
            self.calm = self.calm and abs(t) < 1e3
            self.t = t

    @rule(values=st.lists(numbers, min_size=1, max_size=8), gentle=st.integers(0, 3), more=st.integers(0, 20))
    def set_states(self, values: list[float], gentle: int, more: int) -> None:
        n = self.library.states
        given = [values[k % len(values)] for k in range(n + (more == 0))]
        if gentle:
            given = [1e-5 * math.sin(x) if math.isfinite(x) else 0.0 for x in given]
        expected = {ERROR} if more == 0 else DONE if all(map(math.isfinite, given)) else {DISCARD}
        status = self.try_call("X", expected, "SetContinuousStates", (c_double * len(given))(*given), len(given))
        self.calm = self.calm and (status != OK or bool(gentle) or not n)

    @rule(
        what=st.sampled_from(("ContinuousStates", "Derivatives", "EventIndicators", "NominalsOfContinuousStates")),
        more=st.integers(0, 20),
        null=st.integers(0, 20),
    )
    def vector(self, what: str, more: int, null: int) -> None:
        right = self.library.indicators if what == "EventIndicators" else self.library.states
        n = right + (more == 0)
        values = (c_double * n)(*[7.0] * n)
        nominals = what == "NominalsOfContinuousStates"
        sure = nominals or self.calm or (what == "EventIndicators" and not n)
        expected = {ERROR} if more == 0 or (null == 0 and n) else DONE if sure else self.unless_not_finite()
        allowed = INSTANTIATED + WITH_VECTORS if nominals and self.library.fmi == 2 else WITH_VECTORS
        status = self.try_call(allowed, expected, f"Get{what}", None if null == 0 else values, n)
        if null and status == OK:
            assert all(map(math.isfinite, values)), f"{what}: {[*values]} with fmi2OK"
        else:
            assert {*values} <= {7.0}, "a refused call wrote a value"

    @rule(null=st.integers(0, 5))
    def completed(self, null: int) -> None:
        event, ends = c_int(7), c_int(7)
        expected = {ERROR} if null == 0 else DONE if self.calm else self.unless_not_finite()
        status = self.try_call("X", expected, "CompletedIntegratorStep", 1, event, None if null == 0 else ends)
        assert (event.value, ends.value) == ((0, 0) if status == OK else (7, 7))

    @rule(ahead=sizes)
    def euler(self, ahead: float) -> None:
        """The usual way: an event, a step, and the mode in which it began."""
        if self.mode not in EXCHANGING or not self.calm:
            return
        n = self.library.states
        self.enter_events()
        self.discrete_states(1)
        self.solve()
        x, rates = (self.run.vector(f"Get{what}", n) for what in ("ContinuousStates", "Derivatives"))
        self.set_time(0.0, ahead, 1)
        moved = [a + ahead * b for a, b in zip(x, rates, strict=True)]
        self.try_call("X", DONE, "SetContinuousStates", (c_double * n)(*moved), n)
        self.calm = max(map(abs, moved), default=0.0) < 1.0


def _arrays(references: Sequence[int], values: Sequence[float], type: str) -> tuple[object, int, object]:
    n = len(references)
    buffer = (c_double * n)(*values) if type == "Real" else (c_int * n)(*map(int, values))
    return (c_uint * n)(*references), n, buffer


def _with_orders(references: Sequence[int], order: int, values: Sequence[float]) -> tuple[object, int, object, object]:
    n = len(references)
    return (c_uint * n)(*references), n, (c_int * n)(*[order] * n), (c_double * n)(*values)


def _shown(argument: object) -> object:
    if hasattr(argument, "_length_"):
        return list(argument)
    if isinstance(argument, bytes):
        return f"{len(argument)} bytes"
    return argument if isinstance(argument, (int, float, type(None))) else "pointer"


def run(fmu: Path, trace: Path, examples: int, start: int | None = None) -> None:
    """Random calls of one FMU, of each kind that it is.

    Parameters
    ----------
    fmu : Path
        The FMU.
    trace : Path
        Gets the calls of the sequence that runs, each before it is made.
    examples : int
        Number of sequences of each kind, of up to 30 calls.
    start : int, optional
        Where the random numbers start; without it the sequences are always the same.

    Raises
    ------
    AssertionError
        With the shortest sequence found that fails.
    """
    library = load(fmu)
    for machine in (Calls, Exchange) if library.exchanges else (Calls,):
        with trace.open("wb", buffering=0) as file:
            _run(machine, library, file, examples, start)


def _run(machine: type[Calls], opened: Library, file: FileIO, examples: int, start: int | None) -> None:
    class Machine(machine):  # type: ignore[misc,valid-type]
        library = opened

        @staticmethod
        def trace(line: str) -> None:
            if line.startswith("new instance"):
                file.seek(0)
                file.truncate()
            file.write(line.encode() + b"\n")

    if start is not None:
        seed(start)(Machine)
    run_state_machine_as_test(
        Machine,
        settings=settings(
            max_examples=examples,
            stateful_step_count=30,
            deadline=None,
            database=None,
            phases=(Phase.generate,),
            derandomize=start is None,
            suppress_health_check=list(HealthCheck),
        ),
    )


def main(seconds: float, names: Iterable[str]) -> None:
    """Each block for its share of the time."""
    chosen = list(names)
    with tempfile.TemporaryDirectory() as scratch:
        for name in chosen:
            trace = Path(tempfile.gettempdir()) / f"calls-{name}-{os.getpid()}.txt"
            print(f"{name}; should it crash, its calls are in {trace}", flush=True)
            fmu = in_either(name, scratch)
            end, start = time.monotonic() + seconds / len(chosen), time.time_ns()  # what it takes to build is no share
            while time.monotonic() < end:
                run(fmu, trace, 50, start)
                start += 1
            trace.unlink()


if __name__ == "__main__":
    from friction_fmus import catalogue

    every = (*catalogue(), *COMPOSITES)
    main(float(sys.argv[1]), sys.argv[2:] or (*every, *(name + IN_3 for name in every)))
