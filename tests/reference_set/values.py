"""Reference values of the cases and their bounds, computed without the code under test.

``python tests/reference_set/values.py`` writes ``reference.csv`` and ``bound.csv`` of each case.

Values are exact rational numbers (`Fraction`) or intervals of mpmath (`iv`). A bound is what a right tool may be off,
see ``bound`` in each case.toml, and half of the last place of the number that is written.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction as Q
from pathlib import Path
from typing import Any

from mpmath import iv, mp

CASES = Path(__file__).parents[2] / "friction_fmus" / "reference" / "cases"

Cell = tuple[Any, Any]  # a value and its bound; texts and blanks have none
Row = tuple[Any, Mapping[str, Cell]]

PROGRAMS: dict[str, Callable[[], list[Row]]] = {}

ULP = Q(1, 2**53)  # relative rounding of one operation
TOLERANCE = Q(1, 10**8)  # of a solver in model exchange
SOLVER = 1000 * TOLERANCE  # what a right solver may be off, see the cases
BLANK: Cell = ("", "")


def case(*names: str) -> Callable[[Callable[[], list[Row]]], Callable[[], list[Row]]]:
    """Register the program of cases."""

    def register(program: Callable[[], list[Row]]) -> Callable[[], list[Row]]:
        PROGRAMS.update(dict.fromkeys(names, program))
        return program

    return register


def between(values: Iterable[Any], extra: Any = Q(0)) -> Cell:
    """The middle of values that are all right, and a bound that contains them and an allowance."""
    found = [*values]
    return (min(found) + max(found)) / 2, (max(found) - min(found)) / 2 + extra


def enclosed(interval: Any, extra: Any = 0) -> Cell:
    """The middle of an interval of mpmath, and its radius with an allowance."""
    return mp.mpf(interval.mid), mp.mpf(interval.delta) / 2 + float(extra)


def rounding(steps: int, largest: Any) -> Q:
    """The bound of 64 roundings of the largest value in each step.

    The exact step of a mass adds at most 4 terms, none of which is above the largest value: 3 products, and 3 sums of
    at most 4 times that value, are 15 roundings. The factors h and h^2/2 of the terms have at most 4 roundings each,
    which are 12 more. The blocks that add or sample values do less.
    """
    return 64 * ULP * max(steps, 1) * Q(largest)


def grid(stop: Any, step: Any, start: Any = 0) -> list[Q]:
    """The communication points, with a shorter last step if the stop time is none."""
    start, stop, step = Q(start), Q(stop), Q(step)
    times = [start + k * step for k in range(math.floor((stop - start) / step) + 1)]
    return times if times[-1] == stop else [*times, stop]


def rows(times: Sequence[Q], program: Callable[[Q], Mapping[str, Any]], extra: Any) -> list[Row]:
    """Rows of exact values with one bound."""
    return [(t, {name: (value, extra) for name, value in program(t).items()}) for t in times]


def called(*given: tuple[Any, ...], names: Sequence[str] = ("x", "v"), extra: Any = None) -> list[Row]:
    """Rows of a case with calls: time and values."""
    bound = rounding(8, 8) if extra is None else extra
    return [
        (Q(t), {name: (Q(value), bound) for name, value in zip(names, values, strict=True)}) for t, *values in given
    ]


def text(value: Any) -> str:
    """A number with all digits of a double, or a text."""
    return value if isinstance(value, str) else repr(float(value))


def written(name: str, all_rows: list[Row]) -> dict[str, str]:
    """The content of the two files of a case."""
    columns = [*all_rows[0][1]]
    found = {}
    for place, file in enumerate(("reference.csv", "bound.csv")):
        lines = [["time", *columns]]
        for t, cells in all_rows:
            lines.append([text(t), *(text(_rounded(cells[column])[place]) for column in columns)])
        found[file] = "".join(",".join(_quoted(cell) for cell in line) + "\n" for line in lines)
    return found


def _rounded(cell: Cell) -> Cell:
    """Add what is lost by writing the value as a double; a bound of 0 stays exact."""
    value, bound = cell
    if isinstance(value, str) or bound == 0:
        return cell
    return value, float(bound) * (1.0 + 1e-15) + abs(float(value)) * float(ULP)


def _quoted(cell: str) -> str:
    return f'"{cell}"' if "," in cell or '"' in cell else cell


# ---- co-simulation ---------------------------------------------------------------------------------------------------


@case("input_ramp", "fmi3_input_ramp")
def input_ramp() -> list[Row]:
    """F = 8 t on 1 kg: held in each step, or as a line."""
    h, found = Q(1, 8), []
    x = v = Q(0)
    for n in range(9):
        t = n * h
        cells = {"x": between([x, 8 * t**3 / 6], rounding(n, 8)), "v": between([v, 4 * t**2], rounding(n, 8))}
        found.append((t, cells))
        x, v = x + h * v + h * h * 8 * t / 2, v + h * 8 * t
    return found


@case("input_jump")
def input_jump() -> list[Row]:
    """F = 0, 1 from 0.5 s, -1 from 0.75 s."""

    def motion(t: Q) -> Mapping[str, Q]:
        x = v = Q(0)
        for begin, end, force in ((Q(1, 2), Q(3, 4), 1), (Q(3, 4), Q(1), -1)):
            s = min(max(t - begin, Q(0)), end - begin)
            x, v = x + v * s + force * s * s / 2, v + force * s
        return {"x": x, "v": v}

    return rows(grid(1, Q(1, 8)), motion, rounding(8, 1))


@case("start_values")
def start_values() -> list[Row]:
    """x = 2 - t + (3/4) t^2/2."""
    return rows(grid(2, Q(1, 4)), lambda t: {"x": 2 - t + t * t * 3 / 8, "v": -1 + t * 3 / 4}, rounding(8, 4))


@case("fmi3_start_values")
def fmi3_start_values() -> list[Row]:
    """The motion of `start_values`, with the start time 2 s."""
    times = grid(Q(53, 16), Q(1, 4), 2)
    return rows(times, lambda t: {"x": 2 - (t - 2) + (t - 2) ** 2 * 3 / 8, "v": -1 + (t - 2) * 3 / 4}, rounding(8, 4))


@case("start_time")
def start_time() -> list[Row]:
    """sin(2 pi t)."""
    iv.prec = 100
    times = grid(Q(17, 4), Q(1, 8), Q(13, 4))
    return [(t, {"r": enclosed(iv.sin(2 * iv.pi * _interval(t)), 6 * 27 * ULP)}) for t in times]


@case("million_steps")
def million_steps() -> list[Row]:
    """sin(200 pi t) at a few times."""
    iv.prec = 200
    times = [Q(n, 1000) for n in (0, 1, 333, 10_001, 100_002, 500_003, 999_999, 1_000_000)]
    return [(t, {"r": enclosed(iv.sin(200 * iv.pi * _interval(t)), 8 * ULP * (1 + 629 * t))}) for t in times]


def _interval(number: Q) -> Any:
    """An interval that contains a rational number."""
    return iv.mpf(number.numerator) / number.denominator


@case("last_step")
def last_step() -> list[Row]:
    """x = t^2 under 2 N."""
    return rows(grid(Q(17, 16), Q(1, 4)), lambda t: {"x": t * t, "v": 2 * t}, rounding(5, 3))


@case("samples_on_steps")
def samples_on_steps() -> list[Row]:
    """The sample k has the integral k Ts; the last one before n Ts is n - 1."""
    return [(Q(n, 10), {"u": (Q(max(n - 1, 0), 10), rounding(n, Q(n + 1, 640)))}) for n in range(101)]


@case("samples_between_steps", "fmi3_clock")
def samples_between_steps() -> list[Row]:
    """The last sample before t, or that at t."""
    Ts, found = Q(3, 16), []
    for t in grid(3, Q(1, 4)):
        last = math.ceil(t / Ts) - 1
        for k in sorted({max(last, 0), math.floor(t / Ts)}):
            found.append((t, {"u": (k * Ts, rounding(1, 3))}))
    return found


@case("types")
def types() -> list[Row]:
    """y = -0.5 16777217 5 t."""
    count = 16777217
    exact = {"count_out": (count, 0), "mode_out": (5, 0), "flag_out": (0, 0)}
    length = (len("Grüße, 世界".encode()), 0)
    return [
        (t, {"y": (-t * count * 5 / 2, rounding(4, count * 3)), **exact, "length": length}) for t in grid(1, Q(1, 4))
    ]


@case("string_output")
def string_output() -> list[Row]:
    """The text of the case."""
    name = "100 % of Müller & Søn"
    return [(t, {"text_out": (name, ""), "length": (len(name.encode()), 0)}) for t in grid(Q(1, 2), Q(1, 4))]


@case("discrete_inputs")
def discrete_inputs() -> list[Row]:
    """The rate is 1, 3, -6 and 10 in the quarters."""

    def y(t: Q) -> Mapping[str, Q]:
        rates = (1, 3, -6, 10)
        return {"y": sum((rate * min(max(t - Q(k, 4), Q(0)), Q(1, 4)) for k, rate in enumerate(rates)), Q(0))}

    return rows(grid(1, Q(1, 8)), y, rounding(8, 4))


@case("partial_step", "messages")
def line() -> list[Row]:
    """y = t."""
    return rows(grid(1, Q(1, 4)), lambda t: {"y": t}, rounding(12, 1))


@case("early_end")
def early_end() -> list[Row]:
    """y = t until the end, at which a row may be missing."""
    return [*rows(grid(Q(1, 2), Q(1, 4)), lambda t: {"y": t}, rounding(4, 1)), (Q(6, 10), {"y": BLANK})]


@case("nan_input")
def nan_input() -> list[Row]:
    """u = 8 (1 - x) of the last sample with a number."""
    found = [(Q(n, 8), 4, 0) for n in range(5)] + [(Q(5, 8), 4, 1), (Q(6, 8), 4, 1), (Q(7, 8), 6, 0), (Q(1), 6, 0)]
    return [(t, {"u": (Q(u), rounding(1, 8)), "fault": (fault, 0)}) for t, u, fault in found]


@case("composite")
def composite() -> list[Row]:
    """v = t of the first mass; its position and that of the support are t^2/2."""
    slack = rounding(400, 1)
    return rows(grid(1, Q(1, 4)), lambda t: {"first.x": t * t / 2, "second.x_support": t * t / 2}, slack)


# ---- calls -----------------------------------------------------------------------------------------------------------


@case("refused_values")
def refused_values() -> list[Row]:
    """a = 1, and a = 1/2 from 0.5 s."""
    return called((Q(1, 2), Q(1, 8), Q(1, 2)), (1, Q(7, 16), Q(3, 4)))


@case("reset")
def reset() -> list[Row]:
    """x = 1 + 2 t + t^2/2; after the reset x = t."""
    return called((1, Q(7, 2), 3), (0, 0, 1), (Q(1, 2), Q(1, 2), 1))


@case("two_instances")
def two_instances() -> list[Row]:
    """a = 1, then 1/2 from 3/4 s; b has a = -1/2."""
    t, u = Q(3, 4), Q(1, 4)
    a = (t * t / 2, t)
    later = (a[0] + t * u + u * u / 4, t + u / 2)
    return called((t, *a), (t, 1 - t * t / 4, -t / 2), (1, *later), (1, Q(3, 4), -Q(1, 2)))


@case("many_instances")
def many_instances() -> list[Row]:
    """x = v0 t."""
    return called(*((1, k) for k in reversed(range(40))), names=["x"], extra=rounding(2, 40))


@case("saved_state")
def saved_state() -> list[Row]:
    """a = 1; from the state at 0.5 s with a = -1."""
    half, later = (Q(1, 2), Q(1, 8), Q(1, 2)), (Q(3, 4), Q(9, 32), Q(3, 4))
    return called((1, Q(1, 2), 1), half, (1, Q(1, 4), 0), later, later)


@case("fmi3_state")
def fmi3_state() -> list[Row]:
    """As before; the other instance continues with the force and mass of the first one."""
    half, later = (Q(1, 2), Q(1, 8), Q(1, 2)), (Q(3, 4), Q(9, 32), Q(3, 4))
    return called((1, Q(1, 2), 1), (1, Q(1, 4), 0), half, later)


@case("serialised_state")
def serialised_state() -> list[Row]:
    """The number of the last sample times 3/16; the other instance has -2 times as much before."""
    Ts = Q(3, 16)
    return called((Q(1, 4), -2 * Ts), (Q(1, 2), 2 * Ts), (1, 5 * Ts), (1, 5 * Ts), names=["u"])


@case("rolled_back_steps")
def rolled_back_steps() -> list[Row]:
    """F = clip(F + 8 dx)."""
    F = Q(1, 2)
    return called((Q(1, 2), 1), (Q(1, 2), F), (Q(3, 4), -1), (Q(1, 2), F), names=["F"])


@case("variable_steps")
def variable_steps() -> list[Row]:
    """x = t^2/2."""
    found, t = [], Q(0)
    for steps in ((Q(1, 2),), (Q(1, 2**20),) * 4, (Q(1, 8), Q(1, 4))):
        t += sum(steps)
        found.append((t, t * t / 2, t))
    return called(*found)


@case("directional_derivatives")
def directional_derivatives() -> list[Row]:
    """Of a = (F_drive - F_friction + d v_support ...)/m and F_ext = F_drive + d v_support ..., d = 3, m = 4."""
    t = Q(1, 4)
    found = ((t, Q(2, 4), 2), (t, (-1 - 2 * 3) / Q(4), -2 * 3))
    return called(*found, names=["da", "dF_ext"], extra=Q(6, 10**9))


@case("fmi3_derivatives")
def fmi3_derivatives() -> list[Row]:
    """J = [[-1/m, d/m], [0, d]]: J (1, -2), then (1, -2) J."""
    m, d, t = 4, 3, Q(1, 4)
    forward = (t, Q(-1 - 2 * d, m), -2 * d)
    backward = (t, Q(-1, m), Q(d, m) - 2 * d)
    return called(forward, backward, names=["s1", "s2"], extra=Q(6, 10**9))


# ---- model exchange --------------------------------------------------------------------------------------------------


@case("me_oscillator")
def me_oscillator() -> list[Row]:
    """x'' + 0.2 x' + x = 0 from x = 1."""
    iv.prec = 100
    w, found = iv.sqrt(iv.mpf(99) / 100), []
    for time in grid(10, Q(1, 2)):
        t = _interval(time)
        decay, c, s = iv.exp(-t / 10), iv.cos(w * t), iv.sin(w * t)
        extra = SOLVER * Q(12, 10)
        x, v = decay * (c + s / (10 * w)), -decay * s / w  # v = -x(0) s/w, as w^2 + 1/100 = 1
        found.append((time, {"x": enclosed(x, extra), "v": enclosed(v, extra)}))
    return found


def karnopp(forces: Sequence[tuple[Q, Q]], w: Q, times: Sequence[Q]) -> Iterable[tuple[Q, Q, Q]]:
    """Time, position and velocity of KarnoppMass; each force acts from the time beside it until the next one."""
    Fc, Fs, DV = Q(1), Q(3, 2), Q(1, 1000)
    side = 1 if w >= DV else 0
    t, x = Q(0), Q(0)
    pending = [*times]
    for number, (begin, force) in enumerate(forces):
        end = forces[number + 1][0] if number + 1 < len(forces) else times[-1]
        assert t == begin
        while True:
            if side:
                rate = force - Fc * side
                reaches = (DV * side - w) / rate if rate * side < 0 else None
            else:
                over = abs(force) - Fs
                rate = over * (1 if force > 0 else -1) if over > 0 else Q(0)
                reaches = (DV * (1 if rate > 0 else -1) - w) / rate if rate else None
            span = end - t if reaches is None else min(reaches, end - t)
            while pending and pending[0] <= t + span and (pending[0] < t + span or span < end - t or end == times[-1]):
                s = pending.pop(0) - t
                yield t + s, x + (w * s + rate * s * s / 2) * abs(side), (w + rate * s) * abs(side)
            x, w, t = x + (w * span + rate * span * span / 2) * abs(side), w + rate * span, t + span
            if reaches is None or reaches > end - (t - span):
                break
            if side:  # into the band, where the force beyond static friction moves it on
                side = (1 if force > 0 else -1) if abs(force) > Fs and force * w > 0 else 0
            else:
                side = 1 if w > 0 else -1
            if t == end:
                break


@case("me_stop", "fmi3_me_stop")
def me_stop() -> list[Row]:
    """v = 1 - t until 0.001 m/s."""
    slack, found = 3 * SOLVER, []
    for t, x, v in karnopp([(Q(0), Q(0))], Q(1), grid(2, Q(1, 8))):
        found.append((t, {"x": (x, slack), "v": (v, slack)}))
    return found


@case("me_stick_slip")
def me_stick_slip() -> list[Row]:
    """1.25 N, 2 N, -3 N and 0 N."""
    forces = [(Q(0), Q(5, 4)), (Q(1), Q(2)), (Q(2), Q(-3)), (Q(3), Q(0))]
    slack, found = 8 * SOLVER, []
    for t, x, v in karnopp(forces, Q(0), grid(6, Q(1, 4))):
        found.append((t, {"x": (x, slack), "v": (v, slack)}))
    return found


@case("me_input_ramp")
def me_input_ramp() -> list[Row]:
    """F = 8 t on 1 kg."""
    return rows(grid(1, Q(1, 8)), lambda t: {"x": t**3 * 4 / 3, "v": 4 * t * t}, 5 * SOLVER)


@case("me_grazing")
def me_grazing() -> list[Row]:
    """v = 0.0011 + (1 - t)^2."""
    lowest = Q(11, 10**4)

    def motion(t: Q) -> Mapping[str, Q]:
        return {"x": lowest * t + (1 - (1 - t) ** 3) / 3, "v": lowest + (1 - t) ** 2}

    return rows(grid(2, Q(1, 8)), motion, 3 * SOLVER)


@case("me_simultaneous")
def me_simultaneous() -> list[Row]:
    """The force of two sliding springs rises to 2 N, stays there until 1 s, and falls to -2 N after the reversal."""
    return rows(grid(2, Q(1, 8)), lambda t: {"F": max(min(5 * t, Q(2)) - max(5 * (t - 1), Q(0)), Q(-2))}, 2 * SOLVER)


def samples(Ts: Q, step: Q, stop: Q, start: Q = Q(0)) -> list[Row]:
    """The last sample of u = t, at a sample also the one before."""
    found = []
    for t in grid(stop, step, start):
        k = (t - start) / Ts
        for each in sorted({max(math.ceil(k) - 1, 0), math.floor(k)}):
            found.append((t, {"y": (start + each * Ts, Q(1, 10**9) + 4 * ULP * (t + 1))}))
    return found


@case("me_samples_between_rows", "fmi3_me_samples")
def me_samples_between_rows() -> list[Row]:
    return samples(Q(3, 10), Q(1, 4), Q(3))


@case("me_samples_on_rows")
def me_samples_on_rows() -> list[Row]:
    return samples(Q(1, 4), Q(1, 4), Q(3))


@case("me_samples_before_rows")
def me_samples_before_rows() -> list[Row]:
    return samples(Q(2499999, 10**7), Q(1, 4), Q(3))


@case("me_start_time")
def me_start_time() -> list[Row]:
    return samples(Q(3, 10), Q(1, 4), Q(12), Q(10))


@case("me_event_iteration")
def me_event_iteration() -> list[Row]:
    """y = t until 0.3 s, and t + 3 afterwards."""
    return rows(grid(1, Q(1, 4)), lambda t: {"y": t + (3 if t > Q(3, 10) else 0)}, 2 * SOLVER)


@case("me_step_event")
def me_step_event() -> list[Row]:
    """y = t until the event, and t + 3 afterwards; the event is at the end of a step, between 0.3 s and 0.5 s."""
    found: list[Row] = []
    for t in grid(1, Q(1, 4)):
        jumps = [0] if t < Q(3, 10) else [0, 3] if t == Q(1, 2) else [3]
        found += [(t, {"y": (t + jump, 2 * SOLVER)}) for jump in jumps]
    return found


@case("me_discrete_input")
def me_discrete_input() -> list[Row]:
    """The slope is 1, -1 and 1."""
    first, second = Q(3, 10), Q(8, 10)
    return rows(grid(1, Q(1, 4)), lambda t: {"y": t - 2 * max(min(t, second) - first, Q(0))}, 2 * SOLVER)


@case("me_early_end")
def me_early_end() -> list[Row]:
    return [*rows(grid(Q(1, 2), Q(1, 4)), lambda t: {"y": t}, SOLVER), (Q(6, 10), {"y": BLANK})]


@case("me_input_jump")
def me_input_jump() -> list[Row]:
    """v = t - 0.3."""

    def motion(t: Q) -> Mapping[str, Q]:
        s = max(t - Q(3, 10), Q(0))
        return {"x": s * s / 2, "v": s}

    return rows(grid(1, Q(1, 4)), motion, 2 * SOLVER)


# ---- FMI 3.0 ---------------------------------------------------------------------------------------------------------


def springs(k: Sequence[int], W: Sequence[Q]) -> list[Row]:
    """The force of springs that slip, at x = t."""
    force = lambda t: {"F": sum((min(a * t, b) for a, b in zip(k, W, strict=True)), Q(0))}  # noqa: E731
    return rows(grid(1, Q(1, 8)), force, rounding(8, 8))


@case("fmi3_arrays")
def fmi3_arrays() -> list[Row]:
    return springs([1, 2, 4, 8], [Q(2), Q(3, 4), Q(1), Q(3)])


@case("fmi3_structural_parameter")
def fmi3_structural_parameter() -> list[Row]:
    return springs([1, 2], [Q(2), Q(3, 4)])


# ---- systems ---------------------------------------------------------------------------------------------------------


@case("ssp_chain")
def ssp_chain() -> list[Row]:
    """t^2/2, of the support h t/2 more or less."""
    h, found = Q(1, 8), []
    for t in grid(1, h):
        extra = rounding(8, 1)
        found.append((t, {"first.x": (t * t / 2, extra), "second.x_support": (t * t / 2, h * t / 2 + extra)}))
    return found


@case("ssp_types")
def ssp_types() -> list[Row]:
    """y = -7 t, or + h in the first step."""
    h, found = Q(1, 4), []
    for t in grid(1, h):
        y = between([-7 * t, -7 * t + 8 * h], rounding(4, 8)) if t else (Q(0), Q(0))
        known = {"sink.count_out": (7, 0) if t else BLANK, "sink.flag_out": (0, 0) if t else BLANK}
        found.append((t, {"sink.y": y, **known}))
    return found


def contact(k: int, d: int, h: Q, every: int) -> list[Row]:
    """x'' + d x' + k x = 0 from v = 1, and the masters that hold v and F in each step."""
    mp.dps = 50
    step, w = mp.mpf(h.numerator) / h.denominator, mp.sqrt(k - mp.mpf(d) ** 2 / 4)
    decay = mp.exp(-d * step)
    gain = (1 - decay) / d  # of the force in v, with another sign
    path = (step - gain) / d  # and in x

    def mass(x: Any, v: Any, F: Any) -> tuple[Any, Any]:
        return x + gain * v - path * F, decay * v - gain * F

    schemes = [(mp.mpf(0), mp.mpf(1), mp.mpf(0))] * 3  # Jacobi; mass first; contact first
    found = []
    for n in range(1001):
        if n % every == 0:
            t = n * step
            envelope = mp.exp(-d * t / 2)
            x = envelope * mp.sin(w * t) / w
            v = envelope * (mp.cos(w * t) - d / (2 * w) * mp.sin(w * t))
            errors = [max(abs(each[i] - exact) for each in schemes) for i, exact in enumerate((x, v))]
            cells = {
                name: (value, 1.5 * e + 1e-12)
                for name, value, e in zip(("mass.x", "mass.v"), (x, v), errors, strict=True)
            }
            found.append((n * h, cells))
        (x0, v0, F0), (x1, v1, F1), (x2, v2, F2) = schemes
        next1 = mass(x1, v1, F1)
        late = F2 + k * step * v2
        schemes = [
            (*mass(x0, v0, F0), F0 + k * step * v0),
            (*next1, F1 + k * step * next1[1]),
            (*mass(x2, v2, late), late),
        ]
    return found


@case("ssp_contact_1e5")
def ssp_contact_1e5() -> list[Row]:
    return contact(10**5, 100, Q(2, 10**5), 50)


@case("ssp_contact_1e8")
def ssp_contact_1e8() -> list[Row]:
    return contact(10**8, 4000, Q(1, 10**6), 50)


@case("ssp_sampled_loop")
def ssp_sampled_loop() -> list[Row]:
    """u = 100 (1 - x) - 14 v every 8 steps, on 1 kg."""
    mp.dps = 50
    h = mp.mpf(1) / 1000

    def law(x: Any, v: Any) -> Any:
        return 100 * (1 - x) - 14 * v

    def mass(x: Any, v: Any, u: Any) -> tuple[Any, Any]:
        return x + h * v + h * h * u / 2, v + h * u

    first = (mp.mpf(0), mp.mpf(0), law(0, 0))
    ideal, jacobi, mass_first = first, first, first  # outputs are exchanged at the start
    found = []
    for n in range(401):
        if n % 20 == 0:
            errors = [max(abs(each[i] - ideal[i]) for each in (jacobi, mass_first)) for i in range(2)]
            names = ("mass.x", "mass.v")
            found.append((Q(n, 1000), {name: (ideal[i], 1.5 * errors[i] + 1e-12) for i, name in enumerate(names)}))
        due = n % 8 == 0
        u = law(*ideal[:2]) if due else ideal[2]
        ideal = (*mass(*ideal[:2], u), u)
        jacobi = (*mass(*jacobi), law(*jacobi[:2]) if due else jacobi[2])
        moved = mass(*mass_first)
        mass_first = (*moved, law(*moved) if due else mass_first[2])
    return found


@case("ssp_algebraic_loop")
def ssp_algebraic_loop() -> list[Row]:
    """a = b = 1/3."""
    return rows(grid(Q(1, 2), Q(1, 8)), lambda t: {"a.y": Q(1, 3), "b.y": Q(1, 3)}, Q(1, 10**6))


@case("ssp_units")
def ssp_units() -> list[Row]:
    """The integrals of t and of 293.15 + 10 t, held."""
    h, found = Q(1, 8), []
    for t in grid(1, h):
        metres, kelvin = (
            (t * t / 2, h * t / 2 + rounding(8, 1)),
            (Q(29315, 100) * t + 5 * t * t, 5 * h * t + rounding(8, 300)),
        )
        found.append((t, {"metres.y": metres, "kelvin.y": kelvin}))
    return found


@case("ssp_transformation")
def ssp_transformation() -> list[Row]:
    """The integral of 1/2 - 2 t, held."""
    h, found = Q(1, 8), []
    for t in grid(1, h):
        extra = rounding(8, 1)
        found.append((t, {"first.x": (t * t / 2, extra), "second.x_support": (t / 2 - t * t, h * t + extra)}))
    return found


@case("ssp_parameters")
def ssp_parameters() -> list[Row]:
    """x0 = 250 mm, v0 = 4 m/s / 2, a = 1 N / 2 kg."""
    return rows(
        grid(1, Q(1, 8)), lambda t: {"mass.x": Q(1, 4) + 2 * t + t * t / 4, "mass.v": 2 + t / 2}, rounding(8, 3)
    )


@case("ssp_nested")
def ssp_nested() -> list[Row]:
    """t^2/2 with both ways to hold, at this communication point or the one before."""
    h, found = Q(1, 8), []
    for t in grid(1, h):
        extra, s = rounding(8, 1), max(t - h, Q(0))
        y = between([(t * t + h * t) / 2, (s * s - h * s) / 2], extra)
        found.append((t, {"first.x": (t * t / 2, extra), "sum.y": y}))
    return found


@case("ssp_many_instances")
def ssp_many_instances() -> list[Row]:
    """x = v0 t."""
    return rows(grid(1, Q(1, 4)), lambda t: {f"m{k}.x": k * t for k in range(20)}, rounding(4, 20))


@case("ssp_enumeration")
def ssp_enumeration() -> list[Row]:
    """y = 5 t, or 4 h less."""
    h, found = Q(1, 4), []
    for t in grid(1, h):
        y = between([5 * t, 5 * t - 4 * h], rounding(4, 5)) if t else (Q(0), Q(0))
        found.append((t, {"sink.y": y, "sink.mode_out": (5, 0) if t else BLANK}))
    return found


@case("fmi3_matrix")
def fmi3_matrix() -> list[Row]:
    """sin(2 pi t) + sin(6 pi t)/2."""
    iv.prec = 100
    found = []
    for t in grid(1, Q(1, 8)):
        angle = 2 * iv.pi * _interval(t)
        found.append((t, {"r": enclosed(iv.sin(angle) + iv.sin(3 * angle) / 2, 64 * 20 * ULP)}))
    return found


if __name__ == "__main__":
    for name, program in PROGRAMS.items():
        for file, content in written(name, program()).items():
            (CASES / name / file).write_text(content, encoding="utf-8")
