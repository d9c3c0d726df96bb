"""Leuven and ModifiedLeuven against a reference with scipy's event location, and each claim about them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from shell.instance import OK, WARNING, Instance, Library, load
from thorough import few, nightly

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
velocity = st.one_of(st.floats(-5e-3, 5e-3), st.floats(-2e-4, 2e-4), st.sampled_from([0.0, 1e-6, -1e-6])).map(
    lambda v: round(v, 15)
)
held = st.lists(st.tuples(velocity, st.floats(1e-6, 0.02)), min_size=1, max_size=8)
ramps = st.lists(
    st.tuples(velocity, st.floats(-2.0, 2.0).map(lambda a: round(a, 9)), st.floats(1e-5, 0.01)), min_size=1, max_size=5
)
loads = st.sampled_from([(1.0, 1.0), (3.0, 2.0), (0.25, 1.0), (0.0, 1.0), (-1.0, 1.0)])
exponents = st.sampled_from([1.0, 2.0, 1.7, 4.0, 12.5])

P = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "n": 2.0}
ELEMENTS = ((6e4, 3e4, 1e4), (0.5, 0.5, 0.6))
CURVE = {"A": 4.0, "zc": 4e-5}


@pytest.fixture(scope="module")
def modified(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("ModifiedLeuven"))


@pytest.fixture(scope="module")
def leuven(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Leuven"))


@pytest.fixture(scope="module")
def maxwell(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("MaxwellSlip"))


@pytest.fixture(scope="module", params=["Leuven", "ModifiedLeuven"])
def either(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu(request.param))


def vector(**vectors: Sequence[float]) -> dict[str, float]:
    """k = (1, 2) -> k[1] = 1, k[2] = 2, and N = 2."""
    elements = {f"{name}[{i}]": value for name, values in vectors.items() for i, value in enumerate(values, 1)}
    return elements | {"N": max(map(len, vectors.values()))}


THREE = vector(k=ELEMENTS[0], W=ELEMENTS[1])


def move(run: Instance, *distances: float, h: float = 1e-3) -> None:
    """Held velocities that cover these distances, one step each."""
    for distance in distances:
        run.set({"v": distance / h})
        run.step(run.get1("time"), h)


def level(v: float, p: dict[str, float]) -> float:
    return p["Fc"] + (p["Fs"] - p["Fc"]) * math.exp(-((abs(v) / p["vs"]) ** p["delta"]))


def slowing(r: float, n: float) -> float:
    """1 - sgn(r) |r|^n."""
    return 1.0 - math.copysign(math.exp(min(n * math.log(abs(r)), 30.0)) if r else 0.0, r)


class Reference:
    """What both laws share: velocities in pieces of one direction, and dz/dt = |v| (1 - sgn(r) |r|^n) along it."""

    def __init__(self, p: dict[str, float]) -> None:
        self.p = P | p
        self.z = 0.0

    def step(self, v: float, slope: float, h: float) -> None:
        zero = -v / slope if slope else math.inf
        for v_0, duration in [(v, zero), (0.0, h - zero)] if 0.0 < zero < h else [(v, h)]:
            way = float(np.sign(v_0 + slope * duration / 2.0))
            if way:
                self.piece(way, abs(v_0), way * slope, duration)

    def piece(self, way: float, speed: float, slope: float, h: float) -> None:
        raise NotImplementedError

    def solve(
        self,
        rate: Callable[[float, float], float],
        events: Sequence[Callable[[float, float], float]],
        span: tuple[float, float],
        y: float,
        slope: float,
    ) -> tuple[float, float]:
        """(t, y) at the end or at the first rise of an event through zero."""

        def terminal(event: Callable[[float, float], float]) -> Callable[[float, np.ndarray], float]:
            def at(t: float, u: np.ndarray) -> float:
                return event(t, u[0])

            at.terminal, at.direction = True, 1.0  # type: ignore[attr-defined]
            return at

        def solution(span: tuple[float, float], y: float, events: Sequence[Callable[..., float]] | None = None) -> Any:
            longest = min(0.2 * self.p["vs"] / abs(slope), span[1] - span[0]) if slope else math.inf
            result = solve_ivp(
                lambda t, u: [rate(t, u[0])],
                span,
                [y],
                method="DOP853",
                rtol=3e-14 if slope == 0.0 else 1e-11,
                atol=1e-19 if slope == 0.0 else 1e-17,
                max_step=max(longest, 1e-6 * h_total(span)),
                events=events,
            )
            assert result.success
            return result

        result = solution(span, y, [terminal(event) for event in events] or None)
        t_end, y_end = float(result.t[-1]), float(result.y[0, -1])
        if result.status == 1 and len(result.t) > 1:
            # the dense output that locates the event is less exact than the steps: secants between true solutions
            event = next(e for e, at in zip(events, result.t_events, strict=True) if len(at))
            t_0, y_0 = float(result.t[-2]), float(result.y[0, -2])
            for _ in range(3):
                y_end = float(solution((t_0, t_end), y_0).y[0, -1]) if t_end > t_0 else y_0
                high = event(t_end, y_end)
                nearby = t_end - 1e-6 * (t_end - t_0)
                slope_of_event = (high - event(nearby, y_end - rate(t_end, y_end) * (t_end - nearby))) / (
                    t_end - nearby
                )
                if slope_of_event <= 0.0 or not math.isfinite(high / slope_of_event):
                    break
                t_end = min(max(t_end - high / slope_of_event, t_0), span[1])
            y_end = float(solution((t_0, t_end), y_0).y[0, -1]) if t_end > t_0 else y_0
        return t_end, y_end


def h_total(span: tuple[float, float]) -> float:
    return max(span[1] - span[0], 1e-300)


class Modified(Reference):
    def __init__(self, k: Sequence[float], W: Sequence[float], p: dict[str, float]) -> None:
        super().__init__(p)
        self.k, self.W, self.F = np.array(k), np.array(W), np.zeros(len(k))

    def piece(self, way: float, speed: float, slope: float, h: float) -> None:
        p, t = self.p, 0.0
        G = way * self.F
        while t < h * (1.0 - 1e-14):
            gap = level(speed + slope * t, p) - G.sum()
            if abs(gap) < 1e-11:
                if slope == 0.0:
                    break
                gap = level(speed + slope * (t + 1e-9 * h), p) - level(speed + slope * t, p)
            up = 1.0 if gap >= 0.0 else -1.0
            free = up * G < self.W * (1.0 - 1e-13)
            start = G.copy()

            def hysteresis(d: float, start: np.ndarray = start, free: np.ndarray = free, up: float = up) -> float:
                return float(start.sum() + up * d * self.k[free].sum())

            def rate(s: float, d: float, up: float = up) -> float:
                return up * (speed + slope * s) * slowing(hysteresis(d) / level(speed + slope * s, p), p["n"])

            events = [lambda s, d, up=up: up * (hysteresis(d) - level(speed + slope * s, p)) - 1e-13]
            if slope == 0.0:
                events = []
            if G.sum() < -1e-12:
                events.append(lambda s, d: hysteresis(d))  # |r|^n has a kink at 0
            for i in np.flatnonzero(free):
                events.append(lambda s, d, i=i, start=start, up=up: up * start[i] + self.k[i] * d - self.W[i])
            t, d = self.solve(rate, events, (t, h), 0.0, slope)
            G = np.where(free, np.clip(start + up * d * self.k, -self.W, self.W), start)
            near = free & (up * G > self.W * (1.0 - 1e-10))
            G[near] = up * self.W[near]
            self.z += way * up * d
        self.F = way * G


class Original(Reference):
    """Two stacks of reversal points and one of the branches' first points."""

    def __init__(self, p: dict[str, float]) -> None:
        super().__init__(CURVE | p)
        self.maxima: list[float] = []
        self.minima: list[float] = []
        self.bases = [0.0]
        self.way = 0.0

    def curve(self, z: float) -> float:
        return math.copysign(self.p["A"] * -math.expm1(-abs(z) / self.p["zc"]), z)

    @property
    def Fh(self) -> float:
        return self.bases[-1] + self.curve(self.z)

    def base_back_to(self, count: int) -> None:
        force = self.Fh
        del self.bases[count:]
        rest = force - self.bases[-1]
        self.z = math.copysign(-self.p["zc"] * math.log1p(-abs(rest) / self.p["A"]), rest)

    def target(self, way: float) -> float | None:
        stack, other = (self.maxima, self.minima) if way > 0.0 else (self.minima, self.maxima)
        return stack[-1] if stack and other else None

    def settle(self, way: float, S: float) -> None:
        while (target := self.target(way)) is not None and way * (self.Fh - target) >= -1e-13:
            self.maxima.pop()
            self.minima.pop()
            self.base_back_to(len(self.bases) - 2)
        if way * self.curve(self.z) >= (1.0 - 1e-3) * (S - way * self.bases[-1]) - 1e-13:
            self.maxima.clear()
            self.minima.clear()
            self.base_back_to(1)

    def piece(self, way: float, speed: float, slope: float, h: float) -> None:
        p = self.p
        if way == -self.way:
            (self.maxima if way < 0.0 else self.minima).append(self.Fh)
            self.bases.append(self.Fh)
            self.z = 0.0
        self.way = way
        t = 0.0
        while t < h * (1.0 - 1e-14):
            self.settle(way, level(speed + slope * t, p))
            base, target, remembers = way * self.bases[-1], self.target(way), len(self.bases) > 1

            def rate(s: float, d: float, base: float = base, remembers: bool = remembers) -> float:
                distance = level(speed + slope * s, p) - base
                r = self.curve(d) / distance if distance > 0.0 else 1.0
                return (speed + slope * s) * slowing(min(r, 1.0) if remembers else r, p["n"])

            events = []
            if target is not None:
                events.append(lambda s, d, base=base, target=target: base + self.curve(d) - way * target)
            if remembers:
                events.append(
                    lambda s, d, base=base: self.curve(d) - (1.0 - 1e-3) * (level(speed + slope * s, p) - base)
                )
            t, d = self.solve(rate, events, (t, h), way * self.z, slope)
            self.z = way * d
        self.settle(way, level(speed + slope * h, p))


def start(library: Library, run: Instance, **p: float) -> Reference:
    """Initialised, with the reference that belongs to it."""
    if library.identifier == "Leuven":
        run.initialise(**CURVE, **(P | p))
        return Original(p)
    run.initialise(**THREE, **(P | p))
    return Modified(*ELEMENTS, p)


def reference_force(reference: Reference) -> float:
    return float(reference.F.sum()) if isinstance(reference, Modified) else reference.Fh


# ---- both


@reproducibly
@given(steps=held, n=exponents, Fs=st.sampled_from([0.8, 1.0, 1.5]))
def test_held_velocities_agree_with_scipy(
    either: Library, steps: list[tuple[float, float]], n: float, Fs: float
) -> None:
    with Instance(either) as run:
        reference = start(either, run, n=n, Fs=Fs)
        for v, h in steps:
            run.set({"v": v})
            run.step(run.get1("time"), h)
            reference.step(v, 0.0, h)
            assert run.get1("Fh") == pytest.approx(reference_force(reference), abs=1e-10 * Fs)
            assert run.get1("z") == pytest.approx(reference.z, abs=1e-14, rel=1e-10)


laws = st.fixed_dictionaries(
    {
        "n": st.one_of(st.floats(0.5, 20.0), st.sampled_from([1.0, 2.0, 50.0])),
        "Fc": st.floats(0.2, 2.0),
        "Fs": st.floats(0.2, 2.0),
        "vs": st.floats(1e-4, 0.1),
        "delta": st.floats(0.6, 4.0),
    }
)
swings = st.lists(st.tuples(st.floats(0.5, 0.95), st.floats(1e-6, 0.02)), min_size=4, max_size=20)


def nested_loops(run: Instance, reference: Reference, amplitude: float, steps: list[tuple[float, float]]) -> None:
    """Swings about a point that shrink, and one that closes all loops that they leave; compared after each."""
    top, way = max(reference.p["Fs"], reference.p["Fc"]), 1.0
    for k, (shrink, h) in enumerate(steps):
        last = k == len(steps) - 1
        v = way * amplitude * (20.0 if last else 1.8 if k else 1.0) / h
        run.set({"v": v})
        run.step(run.get1("time"), h)
        reference.step(v, 0.0, h)
        assert run.get1("Fh") == pytest.approx(reference_force(reference), abs=1e-10 * top)
        amplitude *= shrink
        way = -way


@settings(reproducibly, max_examples=few(25))
@given(law=laws, A=st.floats(2.0, 5.0), zc=st.floats(1e-6, 1e-4), relative=st.floats(0.3, 1.0), steps=swings)
def test_nested_loops_of_any_leuven_contact_agree_with_scipy(
    leuven: Library, law: dict[str, float], A: float, zc: float, relative: float, steps: list[tuple[float, float]]
) -> None:
    with Instance(leuven) as run:
        p = P | law | {"A": A * max(law["Fs"], law["Fc"]), "zc": zc}
        run.initialise(**p)
        reference = Original(p)
        nested_loops(run, reference, relative * zc, steps)
        assert run.get1("depth") == len(reference.bases) - 1


@settings(reproducibly, max_examples=few(25))
@given(
    law=laws,
    elements=st.lists(
        st.tuples(st.sampled_from([0.0, 1e3, 1e4, 3e4, 1e5]), st.sampled_from([0.0, 0.2, 0.5, 1.0])),
        min_size=1,
        max_size=10,
    ).filter(lambda elements: any(k * W > 0.0 for k, W in elements)),
    relative=st.floats(0.3, 1.0),
    steps=swings,
)
def test_nested_loops_of_any_elements_agree_with_scipy(
    modified: Library,
    law: dict[str, float],
    elements: list[tuple[float, float]],
    relative: float,
    steps: list[tuple[float, float]],
) -> None:
    """Elements without stiffness or strength, too; those that have both reach the level."""
    k, top = [each[0] for each in elements], max(law["Fs"], law["Fc"])
    scale = 1.2 * top / sum(W for stiffness, W in elements if stiffness)
    W = [scale * each[1] for each in elements]
    with Instance(modified) as run:
        run.initialise(**vector(k=k, W=W), **(P | law))
        nested_loops(run, Modified(k, W, law), relative * top / sum(k), steps)


@settings(reproducibly, max_examples=few(80))
@given(steps=ramps, n=exponents, Fs=st.sampled_from([0.8, 1.5]))
def test_linear_velocities_agree_with_scipy(
    either: Library, steps: list[tuple[float, float, float]], n: float, Fs: float
) -> None:
    with Instance(either) as run:
        reference = start(either, run, n=n, Fs=Fs)
        for v, slope, h in steps:
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(run.get1("time"), h)
            reference.step(v, slope, h)
            assert run.get1("Fh") == pytest.approx(reference_force(reference), abs=1e-7)


@nightly
@reproducibly
@given(steps=ramps, cuts=st.integers(2, 7), n=exponents)
def test_how_a_span_is_cut_does_not_matter(
    either: Library, steps: list[tuple[float, float, float]], cuts: int, n: float
) -> None:
    with Instance(either) as whole, Instance(either) as cut:
        start(either, whole, n=n)
        start(either, cut, n=n)
        for v, slope, h in steps:
            t = whole.get1("time")
            whole.set({"v": v})
            assert whole.input_derivatives({"v": slope}) == OK
            whole.step(t, h)
            for j in range(cuts):
                cut.set({"v": v + slope * h * j / cuts})
                assert cut.input_derivatives({"v": slope}) == OK
                cut.step(t + h * j / cuts, h / cuts)
            assert cut.get1("Fh") == pytest.approx(whole.get1("Fh"), abs=1e-8)


@reproducibly
@given(steps=held, normal=loads, n=exponents)
def test_friction_is_odd_bounded_and_scales_with_the_normal_force(
    either: Library, steps: list[tuple[float, float]], normal: tuple[float, float], n: float
) -> None:
    with Instance(either) as run, Instance(either) as mirror, Instance(either) as loaded:
        start(either, run, n=n)
        start(either, mirror, n=n)
        start(either, loaded, n=n, Fn=normal[0], Fn0=normal[1])
        for v, h in steps:
            for each, speed in ((run, v), (mirror, -v), (loaded, v)):
                each.set({"v": speed})
                each.step(each.get1("time"), h)
            F, Fh = run.get("F", "Fh")
            assert mirror.get("F", "Fh") == [-F, -Fh]
            assert abs(Fh) <= 1.5 * (1.0 + 1e-9)
            expected = max(normal[0], 0.0) / normal[1] * (F - 0.4 * v) + 0.4 * v
            assert loaded.get1("F") == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("n", [1.0, 2.0, 3.5, 200.0])
def test_steady_sliding_is_the_stribeck_curve(either: Library, n: float) -> None:
    for v in (-0.3, -1e-3, 1e-4, 2e-3, 0.1, 20.0):
        with Instance(either) as run:
            start(either, run, n=n)
            run.set({"v": v})
            run.step(0.0, 100.0)
            assert run.get1("F") == pytest.approx(math.copysign(level(v, P), v) + 0.4 * v, abs=1e-6 * max(1.0, abs(v)))


@pytest.mark.parametrize("h", [1e-6, 1e-4, 0.02])
def test_a_hold_changes_nothing(either: Library, h: float) -> None:
    with Instance(either) as run:
        start(either, run)
        move(run, 8e-6, -3e-6, 2e-6)
        run.set({"v": 0.0})
        before = run.get("F", "Fh", "z")
        run.step(run.get1("time"), h)
        assert run.get("F", "Fh", "z") == before
        assert before[0] == before[1]


def test_a_constant_level_makes_friction_depend_on_the_path_only(either: Library) -> None:
    distances = (1.2e-5, -1.8e-5, 0.9e-5, -0.2e-5, 2.5e-5)
    seen = []
    for h in (1e-5, 1e-3, 0.1):
        with Instance(either) as run:
            start(either, run, Fs=1.0, sigma1=0.0, sigma2=0.0, n=1.7)
            forces = []
            for distance in distances:
                move(run, distance, h=h)
                forces.append(run.get1("F"))
            seen.append(forces)
    assert seen[0] == pytest.approx(seen[1], abs=1e-11)
    assert seen[2] == pytest.approx(seen[1], abs=1e-11)


@nightly
@reproducibly
@given(steps=held)
def test_a_cycle_of_the_path_dissipates(either: Library, steps: list[tuple[float, float]]) -> None:
    """There and back the same way, after a first cycle: the loop in force over path has an area of at least 0."""
    with Instance(either) as run:
        start(either, run, Fs=1.0, sigma1=0.0, sigma2=0.0, n=12.5)
        area = 0.0
        for cycle in range(2):
            area = 0.0
            for v, h in [*steps, *((-v, h) for v, h in reversed(steps))]:
                run.set({"v": v})
                for _ in range(20):
                    F = run.get1("Fh")
                    run.step(run.get1("time"), h / 20)
                    area += cycle * (F + run.get1("Fh")) / 2.0 * v * h / 20
        assert area >= -1e-9


@pytest.mark.parametrize(
    "p",
    [
        {"Fc": 1e-9, "Fs": 1e-9},
        {"Fs": 0.2},
        {"Fs": 1.0},
        {"vs": 1e-12},
        {"delta": 1e-3},
        {"delta": 0.5},
        {"delta": 100.0},
        {"n": 0.1},
        {"n": 0.7},
        {"n": 1e4},
        {"sigma1": 0.0, "sigma2": 0.0},
    ],
)
@pytest.mark.parametrize("slope", [0.0, 0.2, -0.2])
def test_parameters_at_their_limits_give_numbers(either: Library, p: dict[str, float], slope: float) -> None:
    with Instance(either) as run:
        start(either, run, **p)
        for k, v in enumerate((1e-3, 0.0, -2e-3, 1e-5, -2e-3, 1e-3)):
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(0.01 * k, 0.01)
            assert all(map(math.isfinite, run.get("F", "z", "der(z)")))


# ---- modified Leuven


@reproducibly
@given(steps=ramps, linear=st.booleans())
def test_b17_modified_leuven_with_large_n_is_maxwell_slip(
    modified: Library, maxwell: Library, steps: list[tuple[float, float, float]], linear: bool
) -> None:
    """The level is a little above the sum of W, so that |r|^n is nothing."""
    with Instance(modified) as one, Instance(maxwell) as other:
        one.initialise(**THREE, n=1e4, Fs=1.01 * 1.6, Fc=1.01 * 1.6, sigma1=0.0, sigma2=0.0)
        other.initialise(**THREE)
        for v, slope, h in steps:
            for run in (one, other):
                run.set({"v": v})
                assert run.input_derivatives({"v": slope if linear else 0.0}) == OK
                run.step(run.get1("time"), h)
            assert one.get1("F") == pytest.approx(other.get1("F"), abs=1e-9)


def test_too_small_elements_end_below_the_level_with_a_warning(modified: Library) -> None:
    with Instance(modified) as run:
        run.initialise(**vector(k=[1e5], W=[0.7]), n=2.0, sigma1=0.0, sigma2=0.0, v=0.1)
        assert run.call("DoStep", 0.0, 1.0, 1) == WARNING
        assert run.call("DoStep", 1.0, 1.0, 1) == OK
        assert run.get1("F") == 0.7
        z_2 = run.get1("z")
        run.step(2.0, 1.0)
        assert run.get1("z") - z_2 == pytest.approx(0.1 * (1.0 - 0.49), rel=1e-12)


def test_elements_that_are_just_strong_enough_give_no_warning(modified: Library) -> None:
    """Ten of 0.15 N, whose sum differs from Fs by rounding."""
    with Instance(modified) as run:
        run.initialise(Fs=1.5, v=0.1)
        assert run.call("DoStep", 0.0, 1.0, 1) == OK
        assert not run.messages


@settings(reproducibly, max_examples=few(50))
@given(steps=ramps, n=exponents)
def test_too_small_elements_agree_with_scipy(
    modified: Library, steps: list[tuple[float, float, float]], n: float
) -> None:
    """All elements slip below the level, until it falls below their sum."""
    W = (0.4, 0.4, 0.4)
    with Instance(modified) as run:
        run.initialise(**vector(k=ELEMENTS[0], W=W), **(P | {"n": n, "vs": 3e-3}))
        reference = Modified(ELEMENTS[0], W, {"n": n, "vs": 3e-3})
        for v, slope, h in steps:
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(run.get1("time"), h)
            reference.step(v, slope, h)
            assert run.get1("Fh") == pytest.approx(reference_force(reference), abs=1e-7)


def test_the_deflection_turns_while_the_velocity_does_not(modified: Library) -> None:
    """Speeding up through the Stribeck velocity: z falls, once, and the force is continuous."""
    with Instance(modified) as run:
        run.initialise(sigma1=0.0, sigma2=0.0, v=2e-4)
        run.step(0.0, 1000.0)
        assert run.get1("F") == pytest.approx(level(2e-4, P), rel=1e-6)
        signs, forces, h, slope = [], [run.get1("F")], 1e-5, 2.0
        for k in range(500):
            run.set({"v": 2e-4 + slope * h * k})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(run.get1("time"), h)
            signs.append(np.sign(run.get1("der(z)")))
            forces.append(run.get1("F"))
        turns = np.flatnonzero(np.diff([s for s in signs if s]))
        assert signs[100] == -1.0
        assert len(turns) <= 1, "no chatter"
        assert np.max(np.abs(np.diff(forces))) < 0.02
        assert forces[-1] == pytest.approx(1.0, abs=1e-2)


def test_steady_sliding_does_not_chatter(modified: Library) -> None:
    with Instance(modified) as run:
        run.initialise(v=3e-3)
        run.step(0.0, 1.0)
        seen = set()
        for k in range(200):
            run.step(1.0 + 1e-3 * k, 1e-3)
            seen.add(run.get1("F"))
        assert max(seen) - min(seen) < 1e-12


def test_the_unit_of_force_does_not_matter(modified: Library) -> None:
    """2^-26 N in place of 1 N, in sliding on a Stribeck curve in steps that hardly change the level."""
    found = []
    for unit in (1.0, 2.0**-26):
        forces = {"Fc": 1.0, "Fs": 1.5, "sigma1": 300.0, "sigma2": 0.4} | vector(k=ELEMENTS[0], W=ELEMENTS[1])
        with Instance(modified) as run:
            run.initialise(v=2e-3, **{name: value * (1.0 if name == "N" else unit) for name, value in forces.items()})
            run.step(0.0, 1.0)
            for k in range(100):
                run.set({"v": 2e-3 - 1e-5 * k})
                assert run.input_derivatives({"v": -0.1}) == OK
                run.step(1.0 + 1e-4 * k, 1e-4)
            found.append(run.get1("F") / unit)
    assert found[1] == pytest.approx(found[0], rel=1e-12)


def test_one_element_has_a_closed_form(modified: Library) -> None:
    """Below saturation k dz/dx = k (1 - r^n): an exponential for n = 1, tan and tanh for n = 2."""
    S, k = level(1e-3, P), 1e5
    for n in (1.0, 2.0):
        for h in (1e-6, 1e-3, 0.02):
            with Instance(modified) as run:
                run.initialise(**vector(k=[k], W=[9.0]), n=n, v=1e-3, **{"Fi[1]": -0.5})
                run.step(0.0, h)
                q, r = k * 1e-3 * h / S, -0.5 / S
                if n == 1.0:
                    expected = 1.0 - (1.0 - r) * math.exp(-q)
                else:
                    zero = math.atan(-r)
                    expected = math.tan(q - zero) if q < zero else math.tanh(q - zero)
                assert run.get1("Fh") == pytest.approx(S * expected, rel=1e-12, abs=1e-12)


def test_an_initial_force_beyond_its_limit_counts_as_the_limit(modified: Library) -> None:
    """As after a limit that is lowered; k dz/dx = k (1 - r) from r = -W / S on."""
    S, k, W = level(1e-3, P), 1e5, 2.0
    with Instance(modified) as run:
        run.initialise(**vector(k=[k], W=[W]), n=1.0, v=1e-3, **{"Fi[1]": -9.0})
        run.step(0.0, 5e-3)
        assert run.get1("Fh") == pytest.approx(S - (S + W) * math.exp(-k * 5e-6 / S), rel=1e-12)


# ---- Leuven


def nested(count: int, a: float = 1.2e-5, shrink: float = 0.8) -> Iterator[float]:
    """Distances of an oscillation about a point that shrinks."""
    yield a
    way = -1.0
    for _ in range(count):
        yield way * 1.8 * a
        a *= shrink
        way = -way


def test_inner_loops_close_at_their_reversal_points(leuven: Library) -> None:
    with Instance(leuven) as run:
        start(leuven, run, Fs=1.0, n=50.0, sigma1=0.0, sigma2=0.0)
        move(run, 6e-6)
        top = run.get1("Fh")
        move(run, -5e-6, 1e-6)
        assert run.get("depth", "Fb") == [2.0, pytest.approx(run.get1("Fh") - 4.0 * -math.expm1(-1.0 / 40.0), rel=1e-9)]
        while run.get1("depth") == 2.0:
            move(run, 1e-8)
        assert run.get("depth", "Fb") == [0.0, 0.0]
        assert run.get1("Fh") == pytest.approx(top, abs=1e-3)
        assert run.get1("z") == pytest.approx(-4e-5 * math.log1p(-run.get1("Fh") / 4.0), rel=1e-9)


def test_a_loop_closes_on_its_memory_point(leuven: Library) -> None:
    """Without relaxation the way back is as long as the way there, and ends on the point."""
    with Instance(leuven) as run:
        start(leuven, run, Fs=2.0, Fc=2.0, n=1e4, sigma1=0.0, sigma2=0.0)
        move(run, 6e-6, -5e-6, 2e-6, -2e-6)
        assert run.get1("depth") == 1.0
        move(run, 5e-6)
        assert run.get("depth", "Fb", "z") == [0.0, 0.0, pytest.approx(6e-6, rel=1e-12)]


@pytest.mark.parametrize(
    ("p", "v", "slope", "h"),
    [
        ({"n": 1e4, "Fs": 0.3, "delta": 0.3, "vs": 0.35}, 0.0077, -309.0, 3.2e-4),
        ({"n": 1e4, "Fs": 0.3, "delta": 0.4, "vs": 0.35}, 0.0, 300.0, 6e-3),
        ({"n": 5e3, "Fs": 0.06, "delta": 0.5}, -0.07, 467.0, 5e-3),
        ({"n": 3e3, "Fs": 0.1, "delta": 0.16, "vs": 0.7}, -0.0032, 315.0, 2.4e-4),
        ({"n": 600.0, "delta": 0.1}, -0.05, 1.6e3, 0.016),
        ({"n": 40.0, "Fs": 1.0}, 0.2, -4e3, 1e-3),
    ],
)
def test_sharp_laws_and_steep_curves_are_solved_through_a_stop(
    either: Library, p: dict[str, float], v: float, slope: float, h: float
) -> None:
    """From a contact that slides and one that has just turned; in one step and in seven."""
    for distances in ((1e-3,), (1e-3, -1e-9), (-1e-5, 1e-5, -2e-6)):
        forces = []
        for cuts in (1, 7):
            with Instance(either) as run:
                start(either, run, **p)
                move(run, *distances)
                for j in range(cuts):
                    run.set({"v": v + slope * h * j / cuts})
                    assert run.input_derivatives({"v": slope}) == OK
                    run.step(run.get1("time"), h / cuts)
                forces.append(run.get1("Fh"))
        assert forces[0] == pytest.approx(forces[1], abs=1e-8)


def test_several_loops_close_in_one_step(leuven: Library) -> None:
    for n in (1.0, 2.0, 20.0):
        results = []
        for parts in (1, 1000):
            with Instance(leuven) as run:
                start(leuven, run, Fs=1.0, n=n, sigma2=0.0)
                move(run, *nested(9))
                assert run.get1("depth") >= 8.0
                run.set({"v": 1.9e-5 / 1e-3 * (1.0 if run.get1("v") < 0.0 else -1.0)})
                for _ in range(parts):
                    run.step(run.get1("time"), 1e-3 / parts)
                assert run.get1("depth") < 3.0
                results.append(run.get("Fh", "F", "z", "depth", "Fb"))
        assert results[0] == pytest.approx(results[1], rel=1e-9, abs=1e-9)


def test_sliding_forgets_all_reversal_points(leuven: Library) -> None:
    with Instance(leuven) as run:
        start(leuven, run)
        move(run, *nested(6))
        assert run.get1("depth") >= 5.0
        move(run, 1e-3)
        assert run.get("depth", "Fb", "sliding") == [0.0, 0.0, 1.0]


def test_the_force_jumps_where_an_inner_loop_closes_and_modified_leuven_is_continuous(
    leuven: Library, modified: Library
) -> None:
    """Held velocity, steps of 1 nm: |dF| is that of the stiffness but for the jump through sigma1."""
    largest = {}
    for library in (leuven, modified):
        with Instance(library) as run:
            start(library, run, Fs=1.0, n=1.0)
            move(run, 1.5e-5, -0.6e-5)
            forces = []
            for _ in range(9000):
                move(run, 1e-9, h=1e-6)
                forces.append(run.get1("F"))
            largest[library.identifier] = np.max(np.abs(np.diff(forces)))
    assert largest["ModifiedLeuven"] < 5e-4
    assert largest["Leuven"] > 0.02


def test_a_full_stack_keeps_the_outermost_loops_and_warns_once(leuven: Library) -> None:
    with Instance(leuven) as run:
        start(leuven, run, Fs=1.0, n=1.0, sigma1=0.0, sigma2=0.0)
        move(run, 5e-6)
        outermost = run.get1("Fh")
        statuses = []
        for distance in list(nested(90, 4.5e-6, 0.98))[1:]:
            run.set({"v": distance / 1e-3})
            statuses.append(run.call("DoStep", run.get1("time"), 1e-3, 1))
            assert run.get1("depth") <= 64.0
        assert statuses.count(WARNING) == 1
        assert set(statuses) == {OK, WARNING}
        assert run.get("stack_overflow", "depth") == [1.0, pytest.approx(64.0, abs=1.0)]
        assert statuses.index(WARNING) >= 63
        # out again: the virgin curve is met at the first reversal point
        run.set({"v": 1e-5})
        while run.get1("Fh") < outermost:
            run.step(run.get1("time"), 1e-3)
        assert run.get("depth", "Fb", "stack_overflow") == [0.0, 0.0, 1.0]


def test_a_dead_band_keeps_noise_off_the_stacks(leuven: Library) -> None:
    draw = np.random.default_rng(5)
    noise = np.diff(draw.uniform(-2e-9, 2e-9, 400))  # of the position
    depths = {}
    for dead_band in (0.0, 1e-8):
        with Instance(leuven) as run:
            start(leuven, run, dead_band=dead_band)
            move(run, 5e-6)
            deepest = 0.0
            for d in noise:
                move(run, d)
                deepest = max(deepest, run.get1("depth"))
            depths[dead_band] = deepest
            move(run, -2e-6, 1e-6)
            assert run.get1("depth") >= 2.0
    assert depths[1e-8] <= 1.0 < depths[0.0]


def test_a_reversal_shows_before_the_step(leuven: Library) -> None:
    """The velocity is set and F read without a step: r = 0 on the new branch, so dz/dt = v."""
    with Instance(leuven) as run:
        start(leuven, run)
        move(run, 8e-6)
        Fh, data = run.get1("Fh"), run.serialised()
        run.set({"v": -2e-3})
        expected = Fh + (P["sigma1"] + P["sigma2"]) * -2e-3
        assert run.get("F", "Fb", "depth", "der(z)") == pytest.approx([expected, Fh, 1.0, -2e-3], rel=1e-12)
        run.set({"v": 8e-3})
        assert run.get1("depth") == 0.0
        run.restore(data)
        assert run.get("Fh", "depth") == [Fh, 0.0]


def test_a_base_above_the_level_slides(leuven: Library) -> None:
    """Reversal at almost Fs while creeping, back, and on at a speed where S is below that: the force relaxes to S."""
    with Instance(leuven) as run:
        start(leuven, run, sigma1=0.0, sigma2=0.0)
        run.set({"v": 1e-5})
        run.step(0.0, 10.0)
        move(run, -1e-9, h=1e-4)
        base = run.get1("Fh")
        assert base > 1.4
        run.set({"v": 0.05})
        run.step(run.get1("time"), 1e-7)
        assert run.get("depth", "sliding") == [0.0, 1.0]
        assert 1.4 < run.get1("Fh") < base
        run.step(run.get1("time"), 0.1)
        assert run.get1("Fh") == pytest.approx(1.0, abs=1e-9)


def test_an_initial_deflection_is_a_place_on_the_virgin_curve(leuven: Library) -> None:
    with Instance(leuven) as run:
        run.initialise(z=-1e-5, v=1e-3)
        force = -4.0 * -math.expm1(-0.25)
        assert run.get("Fh", "Fb", "depth") == pytest.approx([force, force, 1.0], rel=1e-12)


def test_a_tolerance_is_honoured(either: Library) -> None:
    errors = {}
    for tolerance in (1e-3, 1e-6, None):
        with Instance(either) as run, Instance(either) as exact:
            run.setup(tolerance=tolerance)
            run.must("EnterInitializationMode")
            run.must("ExitInitializationMode")
            exact.initialise(tolerance=1e-13)
            for each in (run, exact):
                for v, slope in ((1e-4, 0.5), (0.0, -0.8), (-1e-3, 1.0)):
                    each.set({"v": v})
                    assert each.input_derivatives({"v": slope}) == OK
                    each.step(each.get1("time"), 5e-3)
            errors[tolerance] = abs(run.get1("Fh") - exact.get1("Fh"))
    assert errors[1e-3] < 1e-3
    assert errors[1e-6] < 1e-5
    assert errors[None] < 1e-9
