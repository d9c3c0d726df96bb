"""Decisions of the implicit master from one iterate, span or check to the next, by the rules in step_check.h; those of
turns.h."""

from __future__ import annotations

import ctypes
import math
import subprocess
from ctypes import c_bool, c_double, c_int64
from pathlib import Path
from typing import Any

import pytest

from harness.compiling.toolchain import compiler
from harness.engine.native import EngineData
from harness.masters.newton import Moving, NewtonData, StateOutput, StepCheck
from harness.system.plan import SET, STEP

FOLDER = Path(__file__).parents[2] / "harness"
CODE = """
#include "newton.h"
#include "turns.h"
EXPORT double next_iterate(Bracket *b, double w, double r, double candidate, int64_t tries);
EXPORT double next_iterate(Bracket *b, double w, double r, double candidate, int64_t tries)
{
    return inside(b, w, r, candidate, tries);
}
EXPORT void span_after(const Newton *newton, const Progress *p, double piece, Span *found);
EXPORT void span_after(const Newton *newton, const Progress *p, double piece, Span *found)
{
    *found = next_span(newton, 0, p, piece);
}
EXPORT double shortest_span(const Newton *newton, const Progress *p, double before);
EXPORT double shortest_span(const Newton *newton, const Progress *p, double before)
{
    return shortest(newton, p, before);
}
EXPORT void conclude_check(Newton *newton, int64_t tick, const Span *s, double off, bool smallest);
EXPORT void conclude_check(Newton *newton, int64_t tick, const Span *s, double off, bool smallest)
{
    conclude(newton, 0, tick, s, off, smallest);
}
EXPORT double largest(const Newton *newton, int64_t first, int64_t count, int64_t unit);
EXPORT double largest(const Newton *newton, int64_t first, int64_t count, int64_t unit)
{
    const Group g = {.state = first, .states = count};
    return largest_of_unit(newton, &g, unit);
}
static int refuse_directly(void *component, const Ports *ports, const double *signals) { return NOT_DIRECT; }
static int set_by_fmi(void *component, const uint32_t *references, size_t n, void *values) { return *(int *)component; }
EXPORT bool turn_settled(int verified, int by_fmi, Engine *found);
EXPORT bool turn_settled(int verified, int by_fmi, Engine *found)
{
    static const Direct direct = {.set = refuse_directly};
    double signals[1] = {NAN};
    const uint32_t reference = 7;
    EnginePart parts[2] = {{0}, {.component = &by_fmi, .direct = &direct, .set = {set_by_fmi}, .inputs = {0, 1, 1, 1},
                                 .input_references = &reference}};
    found->parts = parts;
    found->signals = signals;
    return settle_turn(found, 1, verified, 3.0);
}
"""
RUNG, RUNGS, SLOWER, SOON, CONFIRMATIONS, AMPLIFIED = 4.0, 8, 64.0, 16, 4, 4.0


class Bracket(ctypes.Structure):
    _fields_ = [
        *(("w", c_double * 2), ("width", c_double), ("known", c_bool * 2), ("w0", c_double), ("r0", c_double)),
        *(("limit", c_double), ("r", c_double * 2), ("wide", c_double)),
    ]


class Span(ctypes.Structure):
    _fields_ = [*((name, c_double) for name in ("t", "h", "begin", "end", "ratio")), ("flat", c_bool)]


class Progress(ctypes.Structure):
    _fields_ = [*((name, c_double) for name in ("t", "h", "done", "since")), ("tick", c_int64)]


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("master")
    (folder / "master.c").write_text(CODE, encoding="utf-8")
    places = [f"-I{FOLDER / name}" for name in ("engine", "masters", "../fmu_src")]
    flags = ["-std=c99", "-O0", "-fno-sanitize=undefined", "-w", "-shared", "-fPIC", *places]
    subprocess.run([*compiler(), *flags, "master.c", "-lm", "-o", "master.so"], cwd=folder, check=True)
    loaded = ctypes.CDLL(str(folder / "master.so"))
    loaded.next_iterate.restype = loaded.shortest_span.restype = c_double
    loaded.next_iterate.argtypes = (ctypes.c_void_p, c_double, c_double, c_double, c_int64)
    loaded.span_after.argtypes = (ctypes.c_void_p, ctypes.c_void_p, c_double, ctypes.c_void_p)
    loaded.shortest_span.argtypes = (ctypes.c_void_p, ctypes.c_void_p, c_double)
    loaded.largest.restype, loaded.turn_settled.restype = c_double, c_bool
    loaded.largest.argtypes = (ctypes.c_void_p, c_int64, c_int64, c_int64)
    loaded.turn_settled.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_void_p)
    loaded.conclude_check.argtypes = (ctypes.c_void_p, c_int64, ctypes.c_void_p, c_double, c_bool)
    return loaded


class Loop:
    """A loop with one line."""

    def __init__(self, **values: Any) -> None:
        self.moving, self.guards, self.before = (Moving * 1)(), (StepCheck * 1)(), (c_double * 1)(0.5)
        self.data = NewtonData(finest=1.0, **values)
        for name in ("moving", "guards", "before"):
            setattr(self.data, name, ctypes.addressof(getattr(self, name)))
        self.guard, self.line, self.address = self.guards[0], self.moving[0], ctypes.addressof(self.data)


@pytest.mark.parametrize(
    ("tries", "width", "candidate", "expected"),
    [
        (1, 1.0, 0.3, 0.3),
        (1, 1.0, 1.2, 0.5),  # beyond the bracket
        (1, 1.0, 0.0, 0.5),  # where the residual is known
        (1, 1.0, 1.0, 0.5),
        (3, 2.1, 0.3, 0.3),  # three evaluations have halved the bracket
        (3, 1.95, 0.3, 0.5),  # and here they have not
        (4, 1.95, 0.3, 0.3),
    ],
)
def test_an_iterate_stays_in_the_bracket(
    master: ctypes.CDLL, tries: int, width: float, candidate: float, expected: float
) -> None:
    bracket = Bracket((0.0, 1.0), width, (True, True), 0.0, 4.0, 10.0)
    assert master.next_iterate(ctypes.addressof(bracket), 1.0, 1.0, candidate, tries) == expected


@pytest.mark.parametrize(
    ("tries", "r", "limit", "expected"),
    [(1, 3.0, 10.0, 1.1), (2, 1.0, 10.0, 1.1), (2, 3.0, 10.0, 3.0), (2, 3.0, 0.9, 1.1)],
)
def test_without_a_bracket_steps_become_longer_while_the_residual_lags(
    master: ctypes.CDLL, tries: int, r: float, limit: float, expected: float
) -> None:
    """Four times the last step of 0.5, if more than half of the residual of 4 is left."""
    bracket = Bracket((0.0, 0.0), 1.0, (False, True), 0.5, 4.0, limit)
    assert master.next_iterate(ctypes.addressof(bracket), 1.0, r, 1.1, tries) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(("piece", "last"), [(0.2, True), (0.2 * (1.0 - 1e-12), True), (0.2 * (1.0 - 1e-6), False)])
def test_the_last_span_ends_with_the_step(master: ctypes.CDLL, piece: float, last: bool) -> None:
    span, h, done = Span(), 0.7, 0.5
    progress = Progress(3.0, h, done, -1.0, 0)
    master.span_after(Loop().address, ctypes.addressof(progress), piece, ctypes.addressof(span))
    assert (span.t, span.begin) == (3.0 + done, done / h)
    length = h - done if last else piece
    assert (span.h, span.ratio) == (length, length / 0.5)
    assert (span.end == 1.0) is last


def test_spans_after_a_jump_may_be_shorter(master: ctypes.CDLL) -> None:
    """A part of the time since the jump, at most the usual one, at the jump as short as any."""

    def found(done: float, since: float, before: float = 2.0) -> float:
        progress = Progress(0.0, 2.0, done, since, 0)
        return float(master.shortest_span(Loop().address, ctypes.addressof(progress), before))

    assert found(1.0, -1.0) == 2.0
    assert found(0.9, 0.5) == pytest.approx(0.4 / SLOWER, rel=1e-15)
    assert found(0.5, 0.5) == math.ldexp(2.0, -20)
    assert found(1.0, -1.0, 1e-3) == found(0.9, 0.5, 1e-3) == RUNG * 1e-3  # it is compared with the piece before it
    assert found(0.0, 0.0, 1e-9) == math.ldexp(2.0, -20)  # which the last step does not count as


def test_findings_that_recur_are_counted(master: ctypes.CDLL) -> None:
    """Those that follow the last one within 16 ticks and those in which steps are limited."""
    loop, whole = Loop(), Span(0.0, 0.1, 0.0, 1.0, 1.0)
    for tick, recurrences in ((100, 0), (100 + SOON, 1), (101 + 2 * SOON, 0), (110 + 2 * SOON, 1)):
        master.conclude_check(loop.address, tick, ctypes.addressof(whole), 1.5, False)
        assert (loop.guard.recurrences, loop.guard.last) == (recurrences, tick)
        assert (loop.guard.checks_due, loop.guard.cooldown) == (CONFIRMATIONS, 0)
    loop.guard.limited_ticks = 20
    master.conclude_check(loop.address, 130 + 3 * SOON, ctypes.addressof(whole), 1.5, False)
    assert loop.guard.recurrences == 2
    amplified = Loop()
    master.conclude_check(amplified.address, 100, ctypes.addressof(whole), AMPLIFIED, False)
    assert amplified.guard.recurrences == 2


@pytest.mark.parametrize(
    ("error", "begin", "end", "limited", "counts"),
    [
        (0.0, 0.0, 1.0, 0, True),
        (0.0, 0.0, 0.5, 0, False),
        (0.0, 0.5, 1.0, 0, False),
        (0.0, 0.5, 1.0, 7, True),
        (1e-3, 0.0, 0.5, 0, True),
    ],
)
def test_steps_that_agree_with_their_halves_end_the_checks(
    master: ctypes.CDLL, error: float, begin: float, end: float, limited: int, counts: bool
) -> None:
    """Undivided ones, those of the limited length, and all of the adaptive master; then the guard rests ever longer."""
    loop, span = Loop(error=error), Span(0.0, 0.1, begin, end, 1.0)
    loop.guard.checks_due, loop.guard.limit, loop.guard.limited_ticks = 2, 0.1, limited
    found = []
    for tick in range(50, 55):
        master.conclude_check(loop.address, tick, ctypes.addressof(span), 0.5, False)
        found.append((loop.guard.checks_due, loop.guard.cooldown, loop.guard.next))
    expected = [(1, 0, 51), (0, 0, 52), (0, 1, 54), (0, 3, 57), (0, 7, 62)]
    assert found == (expected if counts else [(2, 0, 0)] * 5)


def test_errors_that_no_span_resolves_are_kept(master: ctypes.CDLL) -> None:
    """Those of values as the root of the sum of their squares, those of the distance as their sum."""
    loop, quarter, whole = Loop(), Span(7.0, 0.1, 0.25, 0.5, 1.0), Span(2.0, 0.1, 0.0, 1.0, 1.0)
    master.conclude_check(loop.address, 50, ctypes.addressof(whole), 1.5, False)
    assert loop.guard.time == 2.0  # it was resolved by a division
    for apart, distance in ((3.0, 0.5), (4.0, 0.25)):
        loop.guard.apart, loop.guard.distance_error = apart, distance
        master.conclude_check(loop.address, 100, ctypes.addressof(quarter), 1.5, False)
        master.conclude_check(loop.address, 101, ctypes.addressof(quarter), 1.5, True)
    assert (loop.line.accumulated_error, loop.line.distance_error) == (5.0, 0.75)
    assert (loop.guard.unresolved, loop.guard.time, loop.guard.distance_error) == (0.5, 7.0, 0.0)
    loop.guard.distance_error = 0.125  # tolerated
    master.conclude_check(loop.address, 102, ctypes.addressof(quarter), 0.5, False)
    assert (loop.line.accumulated_error, loop.line.distance_error) == (5.0, 0.875)


def test_the_magnitude_of_a_position_is_the_largest_of_its_unit_in_the_loop(master: ctypes.CDLL) -> None:
    """The first state belongs to another loop; an acceleration, of another unit, is larger than all."""
    states, sizes = (StateOutput * 5)(*((i, unit) for i, unit in enumerate((1, 1, 2, 1, 1)))), (c_double * 5)()
    sizes[:] = 9.0, 0.5, 40.0, 3.0, 2.0
    data = NewtonData(states=ctypes.addressof(states), state_sizes=ctypes.addressof(sizes))
    found = [master.largest(ctypes.addressof(data), 1, 4, unit) for unit in (0, 1, 2)]
    assert found == [0.0, 3.0, 40.0]


@pytest.mark.parametrize(
    ("verified", "by_fmi", "operation"),
    [(0, 3, None), (1, 3, None), (2, 0, STEP), (3, 0, STEP), (-1, 0, None), (-1, 1, None), (-1, 3, SET)],
)
def test_a_turn_that_is_not_direct_fails_if_the_call_of_fmi_does(
    master: ctypes.CDLL, verified: int, by_fmi: int, operation: int | None
) -> None:
    """-1: the inputs have to be set by FMI, which says what is wrong; else, the status is that of the turn."""
    engine = EngineData(failed_part=-1)
    assert master.turn_settled(verified, by_fmi, ctypes.addressof(engine)) == (operation is None)
    if operation is None:
        assert engine.failed_part == -1
    else:
        assert (engine.failed_part, engine.failed_operation, engine.failed_time) == (1, operation, 3.0)
        assert engine.status == max(verified, by_fmi)
