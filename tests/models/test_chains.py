"""Frenkel-Kontorova, Frenkel-Kontorova-Tomlinson and Burridge-Knopoff chains against closed forms and scipy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult as OdeResult
from shell.instance import OK, Instance, Library, load
from thorough import few, nightly, some

reproducibly = settings(max_examples=few(25), deadline=20_000, derandomize=True, database=None)
GOLDEN = {(55, 34): 34 / 55, (89, 55): 55 / 89}


@pytest.fixture(scope="module")
def fk(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("FrenkelKontorova"))


@pytest.fixture(scope="module")
def fkt(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("FrenkelKontorovaTomlinson"))


@pytest.fixture(scope="module")
def tip(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("PrandtlTomlinson"))


@pytest.fixture(scope="module")
def fault(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("BurridgeKnopoff"))


def laplacian(n: int, ring: bool) -> np.ndarray:
    """Of a ring, or of a chain with free ends."""
    matrix = np.zeros((n, n))
    pairs = [*itertools.pairwise(range(n)), *([(n - 1, 0)] if ring else [])]
    for i, j in pairs:
        matrix[i, j] += 1.0
        matrix[j, i] += 1.0
        matrix[i, i] -= 1.0
        matrix[j, j] -= 1.0
    return matrix


class Chain:
    """Positions and velocities of the atoms by scipy, in absolute positions, from the equations of the paper."""

    def __init__(self, n: int, ring: bool, c: float, amplitude: float, mode: int, **p: float) -> None:
        self.p = {"K": 1.5, "k": 1.0, "kappa": 0.0, "damping": 0.1} | p
        self.n, self.c = n, round(c * n) / n if ring else c
        self.place = np.arange(n) * self.c
        self.springs = laplacian(n, ring)
        self.y = np.concatenate([self.place + amplitude * np.cos(2 * np.pi * mode * np.arange(n) / n), np.zeros(n)])
        self.X = 0.0

    def move(self, h: float, F: float = 0.0, F_slope: float = 0.0, v: float = 0.0, v_slope: float = 0.0) -> None:
        p, n = self.p, self.n

        def rate(s: float, y: np.ndarray) -> np.ndarray:
            x, w = y[:n], y[n:]
            X = self.X + v * s + v_slope * s * s / 2.0
            a = p["k"] * self.springs @ (x - self.place) - p["K"] / (2 * np.pi) * np.sin(2 * np.pi * x)
            a += p["kappa"] * (X + self.place - x) + F + F_slope * s - p["damping"] * w
            return np.concatenate([w, a])

        solution = solve_ivp(rate, (0.0, h), self.y, "DOP853", rtol=1e-13, atol=1e-13)
        assert solution.success
        self.y = solution.y[:, -1]
        self.X += v * h + v_slope * h * h / 2.0

    @property
    def v(self) -> float:
        return float(self.y[self.n :].mean())

    @property
    def pinning(self) -> float:
        return float(self.p["K"] / (2 * np.pi) * np.sin(2 * np.pi * self.y[: self.n]).mean())

    @property
    def slider(self) -> float:
        return float(self.p["kappa"] * (self.X + self.place - self.y[: self.n]).mean())


# ---- the equations


@reproducibly
@given(
    n=st.integers(1, 9),
    ring=st.booleans(),
    c=st.floats(-2.0, 2.0),
    mode=st.integers(0, 4),
    amplitude=st.floats(-0.3, 0.3),
    K=st.floats(0.0, 6.0),
    damping=st.floats(0.0, 5.0),
    h=st.floats(1e-5, 0.3),
    forces=st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=10),
)
def test_a_driven_chain_follows_its_equations(
    fk: Library, n: int, ring: bool, c: float, mode: int, amplitude: float, h: float, forces: list[float], **p: float
) -> None:
    chain = Chain(n, ring, c, amplitude, mode, **p)
    with Instance(fk) as run:
        run.initialise(N=n, periodic=ring, winding=c, amplitude=amplitude, mode=mode, **p)
        t = 0.0
        for force in forces:
            run.set({"F_drive": force})
            run.step(t, h)
            t += h
            chain.move(h, F=force)
            F, v, x, a, ratio = run.get("F", "v", "x", "acceleration", "ratio")
            assert ratio == pytest.approx(chain.c, abs=1e-15)
            assert abs(F - (chain.pinning + p["damping"] * chain.v)) < 1e-9
            assert abs(v - chain.v) < 1e-9
            assert abs(x - (chain.y[:n] - chain.place).mean()) < 1e-9
            assert a == pytest.approx(force - F, abs=1e-12)
            atoms = run.get(*(f"atom[{j + 1}]" for j in range(10)))
            assert atoms == pytest.approx([*chain.y[:n], *[0.0] * (10 - n)], abs=1e-9)


@reproducibly
@given(
    n=st.integers(1, 9),
    ring=st.booleans(),
    c=st.floats(-2.0, 2.0),
    K=st.floats(0.0, 6.0),
    k=st.floats(0.0, 10.0),
    kappa=st.floats(0.0, 5.0),
    damping=st.floats(0.0, 5.0),
    h=st.floats(1e-5, 0.3),
    velocities=st.lists(st.one_of(st.floats(-2.0, 2.0), st.just(0.0)), min_size=1, max_size=10),
)
def test_a_chain_on_a_slider_follows_its_equations(
    fkt: Library, n: int, ring: bool, c: float, h: float, velocities: list[float], **p: float
) -> None:
    chain = Chain(n, ring, c, 0.1, 1, **p)
    with Instance(fkt) as run:
        run.initialise(N=n, periodic=ring, winding=c, amplitude=0.1, mode=1, **p)
        t = 0.0
        for v in velocities:
            run.set({"v": v})
            run.step(t, h)
            t += h
            chain.move(h, v=v)
            F, w, X = run.get("F", "w", "X")
            assert abs(F - chain.slider) < 1e-9
            assert abs(w - chain.v) < 1e-9
            assert abs(X - chain.X) < 1e-12


@pytest.mark.parametrize(("start", "slope"), [(0.0, 0.4), (0.8, -0.9), (-0.5, 1.0)])
def test_linear_inputs_are_followed_through_their_reversal(
    fk: Library, fkt: Library, start: float, slope: float
) -> None:
    p = {"K": 2.0, "damping": 0.3}
    one, other = Chain(8, True, 5 / 8, 0.1, 1, **p), Chain(8, True, 5 / 8, 0.1, 1, kappa=0.4, **p)
    one.move(1.7, F=start, F_slope=slope)
    other.move(1.7, v=start, v_slope=slope)
    layout = {"N": 8, "winding": 5 / 8, "amplitude": 0.1}
    with Instance(fk) as run:
        run.initialise(F_drive=start, **layout, **p)
        assert run.input_derivatives({"F_drive": slope}) == OK
        run.step(0.0, 1.7)
        assert run.get("F", "v") == pytest.approx([one.pinning + 0.3 * one.v, one.v], abs=1e-9)
    with Instance(fkt) as run:
        run.initialise(v=start, kappa=0.4, **layout, **p)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, 1.7)
        assert run.get("F", "w", "X") == pytest.approx([other.slider, other.v, other.X], abs=1e-9)


@pytest.mark.parametrize("pieces", [3, 41, 700])
def test_how_a_span_is_cut_does_not_matter(fk: Library, fkt: Library, fault: Library, pieces: int) -> None:
    for library, values, span in (
        (fk, {"F_drive": 0.2, "amplitude": 0.05}, 8.0),
        (fkt, {"v": 0.4, "amplitude": 0.05}, 8.0),
        (fault, {"N": 8, "l": 2.0, "nu": 0.2}, 12.0),
    ):
        names = library.names("output", "local", type="Real")
        with Instance(library) as whole, Instance(library) as cut:
            for run in (whole, cut):
                run.initialise(**values)
            whole.step(0.0, span)
            for j in range(pieces):
                cut.step(span * j / pieces, span / pieces)
            assert cut.get(*names) == pytest.approx(whole.get(*names), rel=1e-8, abs=1e-8), library


def test_rates_of_outputs_are_those_of_the_motion(fk: Library, fkt: Library, fault: Library) -> None:
    """With one atom the power balance is known from the outputs."""
    with Instance(fk) as run:
        run.initialise(N=1, F_drive=0.6, damping=0.3)
        run.step(0.0, 1.3)
        v, a = run.get("v", "acceleration")
        x_rate, v_rate, energy_rate = run.output_derivatives("x", "v", "energy")
        assert [x_rate, v_rate] == pytest.approx([v, a], rel=1e-7)
        assert energy_rate == pytest.approx(0.6 * v - 0.3 * v * v, rel=1e-7)
    with Instance(fkt) as run:
        run.initialise(v=0.6, kappa=0.7)
        run.step(0.0, 1.3)
        assert run.output_derivatives("F") == pytest.approx([0.7 * (0.6 - run.get1("w"))], rel=1e-7)
    with Instance(fault) as run:
        run.initialise(N=4, nu=1.0)
        run.step(0.0, 1.2)
        assert run.get1("w") > 0.0
        assert run.output_derivatives("F") == pytest.approx([1.0 - run.get1("w")], rel=1e-6)


def test_mirrored_chains_move_mirrored(fk: Library, fkt: Library) -> None:
    for library, drive in ((fk, "F_drive"), (fkt, "v")):
        results = []
        for sign in (1.0, -1.0):
            with Instance(library) as run:
                run.initialise(N=13, winding=sign * 8 / 13, amplitude=sign * 0.05)
                for k in range(40):
                    run.set({drive: sign * math.sin(0.4 * k)})
                    run.step(0.1 * k, 0.1)
                results.append([sign * value for value in run.get("F", "acceleration", "atom[3]")])
        assert results[0] == pytest.approx(results[1], abs=1e-9)


def test_a_thousand_atoms_are_two_hundred_times_five(fk: Library, fkt: Library) -> None:
    """The same winding number in a ring: the long chain repeats the short one."""
    for library, values in ((fk, {"F_drive": 0.3}), (fkt, {"v": 0.5})):
        found = []
        for n in (5, 1000):
            with Instance(library) as run:
                run.initialise(N=n, winding=0.6, **values)
                for k in range(5):
                    run.step(0.2 * k, 0.2)
                found.append(run.get("F", "acceleration", "energy", "atom[2]"))
        assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_a_chain_that_has_gone_far_keeps_its_precision(fk: Library) -> None:
    """Free sliding: v = F / damping over millions of periods, then the pinned force to the last digits."""
    K, F = 1.0, 0.1
    with Instance(fk) as run:
        run.initialise(N=2, winding=1.0, K=0.0, damping=0.01, F_drive=100.0)
        run.step(0.0, 2000.0)
        assert run.get1("x") > 1.8e7
        run.set({"K": K, "damping": 2.0, "F_drive": F})
        run.step(2000.0, 200.0)
        assert run.get1("F") == pytest.approx(F, abs=1e-9)
        x = math.asin(2.0 * math.pi * F / K) / (2.0 * math.pi)
        assert math.remainder(run.get1("x"), 1.0) == pytest.approx(x, abs=2e-8)


# ---- known results of Frenkel-Kontorova


@pytest.mark.parametrize(
    ("n", "winding", "periodic", "K"),
    [(1, 1.0, 1, 0.3), (1, 1.0, 1, 0.971635), (7, 1.0, 1, 0.971635), (7, 0.0, 0, 0.971635), (20, 2.0, 0, 4.0)],
)
def test_b31_a_commensurate_chain_is_held_up_to_k_over_two_pi(
    fk: Library, n: int, winding: float, periodic: int, K: float
) -> None:
    """1e-6 below the limit it rests; 1e-6 above it slides, through each period in 2 pi damping / (K sqrt(2e-6))."""
    limit, damping, beside = K / (2.0 * math.pi), 3.0, 1e-6
    period = 2.0 * math.pi * damping / (K * math.sqrt(2.0 * beside))
    for share, slides in ((1.0 - beside, False), (1.0 + beside, True)):
        with Instance(fk) as run:
            run.initialise(N=n, winding=winding, periodic=periodic, K=K, damping=damping)
            t = 0.0
            for force, span in ((0.99 * limit, 3000.0 / K), (share * limit, period), (share * limit, 2.0 * period)):
                start = run.get1("F_drive")
                assert run.input_derivatives({"F_drive": (force - start) / span}) == OK
                run.step(t, span)
                run.set({"F_drive": force})
                t += span
            x, F = run.get("x", "F")
            assert (x > 0.5) == slides
            if not slides:
                assert pytest.approx(share * limit, rel=1e-8) == F
                assert x == pytest.approx(math.asin(share) / (2.0 * math.pi), rel=1e-6)


@pytest.mark.parametrize("K", some([0.2, 1.0, 5.0], [1.0]))
@pytest.mark.parametrize(("n", "mode"), [(1, 0), (12, 0), (12, 1), (12, 5), (12, 6), (40, 7), (1000, 300)])
def test_b31_phonons(fk: Library, K: float, n: int, mode: int) -> None:
    q, amplitude = 2.0 * math.pi * mode / n, 1e-5
    w = math.sqrt(K + 4.0 * math.sin(q / 2.0) ** 2)
    with Instance(fk) as run:
        run.initialise(N=n, mode=mode, amplitude=amplitude, winding=1.0, K=K, damping=0.0)
        steps = 40 if n < 100 else 4
        for k in range(steps):
            run.step(0.5 * k, 0.5)
            expected = amplitude * math.cos(w * 0.5 * (k + 1))
            assert abs(run.get1("atom[1]") - expected) < 1e-6 * amplitude


@pytest.mark.parametrize("mode", [0, 1, 3, 5])
def test_phonons_of_free_ends(fk: Library, mode: int) -> None:
    """The ends have no image: the modes are those of the matrix of a free chain."""
    n, K, amplitude = 8, 0.7, 1e-5
    start = amplitude * np.cos(2.0 * np.pi * mode * np.arange(n) / n)
    squares, shapes = np.linalg.eigh(K * np.eye(n) - laplacian(n, ring=False))
    with Instance(fk) as run:
        run.initialise(N=n, periodic=0, mode=mode, amplitude=amplitude, winding=1.0, K=K, damping=0.0)
        run.step(0.0, 7.0)
        expected = shapes @ (np.cos(np.sqrt(squares) * 7.0) * (shapes.T @ start))
        found = np.array(run.get(*(f"atom[{j + 1}]" for j in range(n)))) - np.arange(n)
        assert np.abs(found - expected).max() < 1e-6 * amplitude


@pytest.fixture(scope="module")
def depinning() -> Callable[[int, int, float], float]:
    """Static force at which the ground state of n atoms on p periods ceases to be stable: Newton's method, followed
    in K and then in the force until the smallest eigenvalue is 0."""

    def at_rest(u: np.ndarray, place: np.ndarray, K: float, F: float) -> np.ndarray | None:
        springs = laplacian(len(u), ring=True)
        for _ in range(60):
            stiffness = np.diag(K * np.cos(2 * np.pi * (u + place))) - springs
            residual = springs @ u - K / (2 * np.pi) * np.sin(2 * np.pi * (u + place)) + F
            change = np.linalg.solve(stiffness, residual)
            u = u + change * min(1.0, 0.1 / np.abs(change).max())
            if np.abs(change).max() < 1e-13:
                return u if np.linalg.eigvalsh(stiffness)[0] > 0.0 else None
        return None

    def find(n: int, p: int, K: float) -> float:
        place, u = (np.arange(n) * p % n) / n, np.zeros(n)
        for strength in np.linspace(min(K, 1.0), K, 40):
            u = at_rest(u, place, strength, 0.0)
            assert u is not None
        F, dF = 0.0, 1e-3
        while dF > 1e-7 * (F + 1e-9):
            further = at_rest(u, place, K, F + dF)
            if further is None or np.abs(further - u).max() > 0.3:
                dF /= 2.0
            else:
                u, F = further, F + dF
        return F

    return find


def pulled(run: Instance, force: float, rise: float, wait: float) -> float:
    """Mean velocity over `wait` seconds, after the force has risen slowly."""
    t = run.get1("time")
    assert run.input_derivatives({"F_drive": (force - run.get1("F_drive")) / rise}) == OK
    run.step(t, rise)
    run.set({"F_drive": force})
    x = run.get1("x")
    run.step(t + rise, wait)
    return (run.get1("x") - x) / wait


@pytest.mark.parametrize("size", some([*GOLDEN], [*GOLDEN][:1]))
@pytest.mark.parametrize("K", some([1.3, 2.0], [1.3]))
def test_above_the_aubry_transition_a_golden_chain_is_pinned(
    fk: Library, depinning: Callable[[int, int, float], float], size: tuple[int, int], K: float
) -> None:
    limit = depinning(*size, K)
    assert limit > 1e-3
    for share, slides in ((0.95, False), (1.15, True)):
        with Instance(fk) as run:
            run.initialise(N=size[0], winding=GOLDEN[size], K=K, damping=1.0)
            run.step(0.0, 300.0)  # to the ground state
            velocity = pulled(run, share * limit, 2000.0, 3000.0)
            assert (velocity > 0.02 * limit) == slides
            if not slides:
                assert abs(velocity) < 1e-3 * limit
                assert run.get1("F") == pytest.approx(share * limit, rel=1e-4)


@pytest.mark.parametrize("size", some([*GOLDEN], [*GOLDEN][:1]))
@pytest.mark.parametrize("K", some([0.3, 0.7, 0.9], [0.9]))
def test_below_the_aubry_transition_a_golden_chain_slides(fk: Library, size: tuple[int, int], K: float) -> None:
    """Even under a hundredth of the force that it takes at K = 1.3, and in proportion to the force."""
    velocities = []
    for force in (1e-5, 2e-5):
        with Instance(fk) as run:
            run.initialise(N=size[0], winding=GOLDEN[size], K=K, damping=1.0)
            run.step(0.0, 200.0)
            velocities.append(pulled(run, force, 100.0, 4000.0))
    assert 0.2 * 1e-5 < velocities[0] <= 1.001e-5
    assert velocities[1] == pytest.approx(2.0 * velocities[0], rel=0.01)


def test_the_aubry_transition_lies_at_k_c(depinning: Callable[[int, int, float], float]) -> None:
    """The barrier of the oracle itself: a longer approximant lowers it below K_c and keeps it above."""
    below = [depinning(n, p, 0.93) for n, p in ((21, 13), (55, 34))]
    above = [depinning(n, p, 1.3) for n, p in ((21, 13), (55, 34))]
    assert below[1] < 0.2 * below[0]
    assert above[1] == pytest.approx(above[0], rel=0.1)


@reproducibly
@given(K=st.floats(0.0, 5.0), damping=st.floats(0.0, 2.0), amplitude=st.floats(-0.4, 0.4), mode=st.integers(0, 6))
def test_without_drive_energy_is_lost_to_damping_only(
    fk: Library, K: float, damping: float, amplitude: float, mode: int
) -> None:
    with Instance(fk) as run:
        run.initialise(N=13, K=K, damping=damping, amplitude=amplitude, mode=mode)
        first = last = run.get1("energy")
        for k in range(30):
            run.step(0.3 * k, 0.3)
            energy = run.get1("energy")
            assert energy <= last + 1e-9
            last = energy
        if damping == 0.0:
            assert last == pytest.approx(first, abs=1e-8)


def test_an_undamped_chain_keeps_its_energy(fk: Library) -> None:
    with Instance(fk) as run:
        run.initialise(damping=0.0, amplitude=0.3)
        first = run.get1("energy")
        run.step(0.0, 200.0)
        assert run.get1("energy") == pytest.approx(first, rel=1e-8)


# ---- limits of Frenkel-Kontorova-Tomlinson


@pytest.mark.parametrize("periodic", [0, 1])
def test_without_slider_it_is_frenkel_kontorova(fk: Library, fkt: Library, periodic: int) -> None:
    values = {"K": 1.7, "damping": 0.2, "N": 21, "amplitude": 0.2, "mode": 2, "periodic": periodic}
    with Instance(fk) as one, Instance(fkt) as other:
        one.initialise(**values)
        other.initialise(kappa=0.0, v=3.0, **values)
        for k in range(20):
            for run in (one, other):
                run.step(0.5 * k, 0.5)
            assert other.get1("F") == 0.0
            names = ("x", "energy", "acceleration", "atom[2]", "atom[10]")
            assert other.get(*names) == pytest.approx(one.get(*names), abs=1e-9)


@pytest.mark.parametrize(("K", "kappa"), [(3.0, 1.0), (1.5, 2.0), (5.0, 0.7)])
def test_without_neighbours_it_is_independent_tips(fkt: Library, tip: Library, K: float, kappa: float) -> None:
    """N Prandtl-Tomlinson tips with eta = K / kappa whose drivers stand j c apart."""
    n, c, v, h = 5, 2 / 5, 0.3, 0.25
    tips = [Instance(tip) for _ in range(n)]
    with Instance(fkt) as run:
        run.initialise(N=n, winding=c, k=0.0, K=K, kappa=kappa, damping=0.4, v=v)
        for j, each in enumerate(tips):
            E0 = K / (2.0 * math.pi**2)
            each.initialise(k=kappa, E0=E0, damping=0.4, x=j * c, X=j * c, v=v)
            assert each.get1("eta") == pytest.approx(K / kappa, rel=1e-12)
        for k in range(60):
            run.step(h * k, h)
            for each in tips:
                each.step(h * k, h)
            assert run.get1("F") == pytest.approx(sum(each.get1("F") for each in tips) / n, abs=1e-8)
    for each in tips:
        each.free()


def quasi_static(fkt: Library, v: float, **values: float) -> float:
    """Mean force over one period of the substrate, after one, less the viscous part."""
    samples = 1000
    with Instance(fkt) as run:
        run.initialise(v=v, **values)
        run.step(0.0, 1.0 / v)
        total = 0.0
        for j in range(samples):
            run.step(1.0 / v + j / v / samples, 1.0 / v / samples)
            total += run.get1("F") / samples
    return total - values["damping"] * v


@pytest.mark.parametrize(("K", "expected"), [(0.5, 0.0), (0.9, 0.0), (3.0, 0.18006672), (4.0, 0.31314155)])
def test_slow_friction_of_independent_tips_is_their_mean(fkt: Library, K: float, expected: float) -> None:
    """Zero for K <= kappa; above it the tabulated Prandtl-Tomlinson force (B28) at eta = K / kappa = K."""
    values = {"N": 21, "winding": 13 / 21, "k": 0.0, "kappa": 1.0, "K": K, "damping": 1.5}
    F = quasi_static(fkt, 1e-3, **values)
    if expected == 0.0:
        assert 0.0 <= F < 5e-3
        assert quasi_static(fkt, 2.5e-4, **values) == pytest.approx(0.25 * F, rel=0.1)
    else:
        slower = quasi_static(fkt, 1.25e-4, **values)
        assert expected < slower < F < 1.2 * expected
        assert (4.0 * slower - F) / 3.0 == pytest.approx(expected, rel=0.02)


def test_neighbours_lower_slow_friction_of_a_golden_chain(fkt: Library) -> None:
    """K = 1.5 > kappa: the independent tips have friction, the coupled chain next to none."""
    values = {"N": 34, "winding": 21 / 34, "kappa": 0.8, "K": 1.5, "damping": 1.0}
    alone, coupled = (quasi_static(fkt, 1e-3, k=k, **values) for k in (0.0, 1.0))
    assert alone > 0.02
    assert coupled < 0.1 * alone


@reproducibly
@given(k=st.floats(0.0, 5.0), K=st.floats(0.0, 5.0), kappa=st.floats(0.0, 3.0), amplitude=st.floats(-0.4, 0.4))
def test_a_held_slider_takes_no_energy_in(fkt: Library, amplitude: float, **p: float) -> None:
    with Instance(fkt) as run:
        run.initialise(N=13, amplitude=amplitude, **p)
        last = run.get1("energy")
        for j in range(20):
            run.step(0.3 * j, 0.3)
            assert run.get1("energy") <= last + 1e-9
            last = run.get1("energy")


# ---- Burridge-Knopoff


class Fault:
    """Blocks that start and stop at events, by scipy's event location."""

    def __init__(self, u: list[float], ring: bool, nu: float, l: float, sigma: float, alpha: float) -> None:  # noqa: E741
        n = len(u)
        self.n, self.nu, self.sigma, self.alpha = n, nu, sigma, alpha
        self.coupling = l * l * laplacian(n, ring)
        self.t, self.X, self.y, self.slips = 0.0, 0.0, np.array([*u, *[0.0] * n]), np.zeros(n, bool)
        self.starts: list[tuple[float, int]] = []
        self.avalanches, self.moment, self.before = 0, 0.0, 0.0

    def forces(self, t: float, y: np.ndarray) -> np.ndarray:
        u = y[: self.n]
        return self.coupling @ u + (self.X + self.nu * (t - self.t)) - u

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        w = y[self.n :]
        friction = (1 - self.sigma) / (1 + 2 * self.alpha * np.maximum(w, -1e-3) / (1 - self.sigma))
        return np.concatenate([np.where(self.slips, w, 0.0), np.where(self.slips, self.forces(t, y) - friction, 0.0)])

    def run(self, end: float) -> None:
        n = self.n
        while self.t < end:
            if not self.slips.any():
                j = int(np.argmax(self.forces(self.t, self.y)))
                wait = (1.0 - self.forces(self.t, self.y)[j]) / self.nu
                self.arrive(min(self.t + wait, end), self.y)
                if self.t >= end:
                    return
                self.start(j, end)
            events = [self.watch(j) for j in range(n)]
            solution = self.integrate(end, events=events, max_step=0.02)
            for j in range(n):
                if len(solution.t_events[j]) and self.slips[j]:
                    self.slips[j] = False
                    self.y[n + j] = 0.0
                elif len(solution.t_events[j]):
                    self.start(j, end)
            if not self.slips.any() and self.t < end:
                self.avalanches += 1
                self.moment = self.y[:n].sum() - self.before

    def start(self, j: int, end: float) -> None:
        """From now on block j slips; a little further, so that w = 0 is left before it is watched."""
        if not self.slips.any():
            self.before = self.y[: self.n].sum()
        self.slips[j] = True
        self.starts.append((self.t, j))
        self.integrate(min(self.t + 1e-4, end))

    def watch(self, j: int) -> Callable[[float, np.ndarray], float]:
        def event(t: float, y: np.ndarray) -> float:
            return -y[self.n + j] if self.slips[j] else self.forces(t, y)[j] - 1.0

        event.terminal, event.direction = True, 1.0
        return event

    def integrate(self, end: float, **options: object) -> OdeResult:
        solution = solve_ivp(self.rate, (self.t, end), self.y, "DOP853", rtol=1e-12, atol=1e-14, **options)
        self.arrive(solution.t[-1], solution.y[:, -1])
        return solution

    def arrive(self, t: float, y: np.ndarray) -> None:
        self.X += self.nu * (t - self.t)
        self.t, self.y = t, y.copy()


FAULTS = [
    {"N": 1, "l": 1.0, "nu": 0.1, "sigma": 0.1, "alpha": 0.5},
    {"N": 3, "l": 1.0, "nu": 0.1, "sigma": 0.05, "alpha": 0.5},
    {"N": 5, "l": 2.0, "nu": 0.05, "sigma": 0.1, "alpha": 1.0},
    {"N": 8, "l": 3.0, "nu": 0.02, "sigma": 0.05, "alpha": 2.0},
    {"N": 10, "l": 10.0, "nu": 0.01, "sigma": 0.01, "alpha": 2.5, "spread": 1e-3},
]


@pytest.mark.parametrize("values", some(FAULTS, FAULTS[1::2]), ids=lambda values: f"N{values['N']}")
@pytest.mark.parametrize("periodic", some([0, 1], [1]))
def test_the_first_events_are_those_of_an_event_driven_reference(
    fault: Library, values: dict[str, float], periodic: int
) -> None:
    """Positions, velocities, modes and completed avalanches at fixed times, until the blocks have slipped often."""
    n = int(values["N"])
    given_values = {"spread": 0.02, "seed": 3, "periodic": periodic} | values
    with Instance(fault) as run:
        run.initialise(**given_values)
        u = run.get(*(f"u[{j + 1}]" for j in range(n)))
        assert max(map(abs, u)) <= given_values["spread"] and len(set(u)) == n
        reference = Fault(u, bool(periodic), **{name: values[name] for name in ("nu", "l", "sigma", "alpha")})
        t, h = 0.0, 0.05 / values["nu"]
        while len(reference.starts) < 12 and t < 5.0 / values["nu"]:
            run.step(t, h)
            t += h
            reference.run(t)
            found = run.get(*(f"u[{j + 1}]" for j in range(n)))
            assert found == pytest.approx(list(reference.y[:n]), abs=1e-7)
            assert run.get1("F") == pytest.approx(reference.X - reference.y[:n].mean(), abs=1e-7)
            assert run.get1("w") == pytest.approx(reference.y[n:].mean(), abs=1e-6)
            assert run.get(*(f"slipping[{j + 1}]" for j in range(n))) == list(reference.slips.astype(float))
            assert run.get1("avalanches") == reference.avalanches
            assert run.get1("moment") == pytest.approx(reference.moment, abs=1e-7)
        assert len(reference.starts) >= 4


def test_one_block_with_dry_friction_slips_by_the_closed_form(fault: Library) -> None:
    """alpha = 0: u'' = X - u - (1 - sigma) from u = u_0, f = 1: half an oscillation (Coulomb), over 2 sigma."""
    nu, sigma = 0.1, 0.3
    with Instance(fault) as run:
        run.initialise(N=1, nu=nu, sigma=sigma, alpha=0.0, spread=0.0)
        start = 1.0 / nu
        run.step(0.0, start + 1e-9)
        assert run.get("moving", "slipping[1]") == [1.0, 1.0]
        # z = u - (X - 1 + sigma) obeys z'' = -z, z = -sigma, z' = -nu
        for s in np.linspace(0.1, 3.0, 30):
            t = run.get1("time")
            run.step(t, start + s - t)
            z = -sigma * math.cos(s) - nu * math.sin(s)
            assert run.get1("u[1]") == pytest.approx(z + nu * s + sigma, abs=1e-10)
            assert run.get1("w") == pytest.approx(sigma * math.sin(s) - nu * math.cos(s) + nu, abs=1e-10)
        slip = 2.0 * (math.pi - math.atan(sigma / nu))  # velocity sigma sin s + nu (1 - cos s) is 0 again
        run.step(start + 3.0, slip - 3.0 + 0.5)
        assert run.get("moving", "w", "avalanches") == [0.0, 0.0, 1.0]
        rest = -sigma * math.cos(slip) - nu * math.sin(slip) + nu * slip + sigma
        assert run.get("u[1]", "moment") == pytest.approx([rest, rest], abs=1e-10)
        period = (rest - 0.0) / nu  # the block then waits until X has gained what it slipped
        events = []
        for k in range(3):
            t = run.get1("time")
            run.step(t, start + (k + 1) * period - 1e-7 - t)
            events.append(run.get1("moving"))
            run.step(run.get1("time"), 2e-7)
            events.append(run.get1("moving"))
        assert events == [0.0, 1.0] * 3


def test_equal_blocks_move_as_one(fault: Library) -> None:
    """Without spread a ring keeps all springs relaxed, at any l: the mean is the single block."""
    found = []
    for n, stiffness in ((1, 0.0), (30, 5.0)):
        with Instance(fault) as run:
            run.initialise(N=n, l=stiffness, periodic=1, spread=0.0, nu=0.1, sigma=0.1, alpha=1.0)
            run.step(0.0, 12.0)
            run.step(12.0, 30.0)
            found.append(run.get("F", "x", "w", "avalanches"))
    assert found[0][3] >= 1.0
    assert found[1] == pytest.approx(found[0], abs=1e-8)


def test_a_block_never_slips_back(fault: Library) -> None:
    """A driver that returns unloads and then pushes against blocks that stay; it is not held by more than 1."""
    with Instance(fault) as run:
        run.initialise(N=10, nu=0.0, l=3.0, v=0.5)
        run.step(0.0, 20.0)
        run.set({"v": -2.0})
        run.step(20.0, 5.0)
        before = run.get(*(f"u[{j + 1}]" for j in range(10)))
        assert run.get1("moving") == 0.0
        run.step(25.0, 20.0)
        assert run.get(*(f"u[{j + 1}]" for j in range(10))) == before
        assert run.get1("F") < -30.0


@reproducibly
@given(
    seed=st.integers(0, 2**31 - 1),
    n=st.integers(1, 12),
    periodic=st.booleans(),
    sigma=st.floats(0.0, 0.9),
    alpha=st.floats(0.0, 4.0),
    speed=st.lists(st.floats(-1.0, 2.0), min_size=1, max_size=12),
    l=st.floats(0.0, 6.0),
)
def test_blocks_move_forward_only_and_hold_no_more_than_static_friction(
    fault: Library, seed: int, n: int, periodic: bool, speed: list[float], **p: float
) -> None:
    with Instance(fault) as run:
        run.initialise(seed=seed, N=n, periodic=periodic, nu=0.0, **p)
        last = run.get1("x")
        for k, v in enumerate(speed):
            run.set({"v": v})
            run.step(0.7 * k, 0.7)
            x, w, peak, moving, weakened = run.get("x", "w", "peak", "moving", "weakened")
            left = 1.0 - p["sigma"]  # Carlson and Langer 1989: (1 - sigma) / (1 + 2 alpha w / (1 - sigma))
            assert weakened == pytest.approx(left / (1.0 + 2.0 * p["alpha"] * max(w, 0.0) / left), rel=1e-12)
            assert x >= last - 1e-12 and w >= -1e-12
            assert moving == n or peak <= 1.0 + 1e-10
            assert (w > 0.0) <= (moving > 0)
            last = x


@nightly
def test_statistics_of_many_avalanches(fault: Library) -> None:
    """The published set: small events are far more frequent than large ones, the mean force stays between 0 and 1,
    what the driver moves is what the blocks slip, and the seed changes the events but not this."""
    for seed in (1, 2):
        with Instance(fault) as run:
            run.initialise(N=50, seed=seed)
            run.step(0.0, 300.0)
            first, X_first, x_first = run.get("avalanches", "X", "x")
            forces, moments, count, t = [], [], first, 300.0
            for _ in range(1500):
                run.step(t, 1.0)
                t += 1.0
                forces.append(run.get1("F"))
                if run.get1("avalanches") != count:
                    count = run.get1("avalanches")
                    moments.append(run.get1("moment"))
            X, x = run.get("X", "x")
        assert min(forces) > -0.5 and max(forces) <= 1.0
        assert 0.0 < np.mean(forces) < 0.9
        assert x - x_first == pytest.approx(X - X_first, abs=1.5)
        assert min(moments) > 0.0
        assert max(moments) > 1e3 * min(moments)
        small = sum(moment < 0.1 for moment in moments)
        assert small > 0.5 * len(moments)
        assert count - first > 100


def test_blocks_follow_from_the_seed(fault: Library) -> None:
    starts = []
    for seed in (1, 1, 2):
        with Instance(fault) as run:
            run.initialise(seed=seed, N=10)
            starts.append(run.get(*(f"u[{j + 1}]" for j in range(10))))
    assert starts[0] == starts[1] != starts[2]


def test_a_thousand_blocks(fault: Library) -> None:
    with Instance(fault) as run:
        run.initialise(N=1000, spread=1e-3)
        run.step(0.0, 60.0)
        assert run.get1("F") == pytest.approx(0.6, abs=1e-3)
        run.step(60.0, 15.0)
        assert run.get1("avalanches") > 0.0
        assert run.get1("peak") <= 1.0 + 1e-10
