"""Static and switching friction models against their formulas, closed forms, published numbers and scipy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from shell.instance import OK, Instance, Library, load
from thorough import few

reproducibly = settings(max_examples=few(60), deadline=20_000, derandomize=True, database=None)
velocities = st.one_of(st.floats(-5e-3, 5e-3), st.floats(-1.0, 1.0), st.sampled_from([0.0, -0.0, 1e-9, -1e-9, 30.0]))
forces = st.floats(-5.0, 5.0)
level = st.floats(0.0, 5.0)
normal = st.one_of(st.floats(-2.0, 20.0), st.sampled_from([0.0, 1.0]))

GetLibrary = Callable[[str], Library]


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> GetLibrary:
    return lambda name: load(build_fmu(name))


def sign(v: float) -> float:
    return float(np.sign(v))


def clip(F: float, limit: float) -> float:
    return min(max(F, -limit), limit)


# ---- the formulas


def coulomb(v: float, F_ext: float, n: float, p: dict[str, float]) -> float:
    return clip(F_ext, n * p["Fc"]) if v == 0.0 else n * p["Fc"] * sign(v)


def stiction(v: float, F_ext: float, n: float, p: dict[str, float]) -> float:
    return clip(F_ext, n * p["Fs"]) if v == 0.0 else n * p["Fc"] * sign(v) + p["Fv"] * v


def tustin(v: float, F_ext: float, n: float, p: dict[str, float]) -> float:
    if v == 0.0:
        return clip(F_ext, n * p["Fs"])
    return n * sign(v) * (p["Fc"] + (p["Fs"] - p["Fc"]) * math.exp(-abs(v) / p["vs"])) + p["Fv"] * v


def karnopp(v: float, F_ext: float, n: float, p: dict[str, float]) -> float:
    if abs(v) < p["DV"] or v == 0.0:
        return clip(F_ext, n * p["Fs"])
    return n * p["Fc"] * sign(v) + p["Fv"] * v


def dead_zone(v: float, F_ext: float, n: float, p: dict[str, float]) -> float:
    if (abs(v) < p["DV"] or v == 0.0) and abs(F_ext) <= n * p["T_dz"]:
        return F_ext
    return n * p["Fc"] * sign(v if v != 0.0 else F_ext) + p["Fv"] * v


LAWS: dict[str, tuple[Callable[..., float], tuple[str, ...]]] = {
    "Coulomb": (coulomb, ("Fc",)),
    "Stiction": (stiction, ("Fc", "Fs", "Fv")),
    "Tustin": (tustin, ("Fc", "Fs", "Fv", "vs")),
    "Karnopp": (karnopp, ("Fc", "Fs", "Fv", "DV")),
    "DeadZoneTorque": (dead_zone, ("Fc", "T_dz", "Fv", "DV")),
}
ranges = {"vs": st.floats(1e-5, 0.1), "DV": st.floats(0.0, 0.01)}


@pytest.mark.parametrize("name", LAWS)
@reproducibly
@given(data=st.data(), v=velocities, F_ext=forces, Fn=normal, Fn0=st.floats(0.5, 10.0))
def test_the_force_is_the_formula_and_scales_with_the_normal_force(
    block: GetLibrary, name: str, data: st.DataObject, v: float, F_ext: float, Fn: float, Fn0: float
) -> None:
    law, names = LAWS[name]
    p = {each: data.draw(ranges.get(each, level), each) for each in names}
    expected = pytest.approx(law(v, F_ext, max(Fn, 0.0) / Fn0, p), rel=1e-12, abs=1e-13)
    with Instance(block(name)) as run:
        run.initialise(v=v, F_ext=F_ext, Fn=Fn, Fn0=Fn0, **p)
        assert run.get1("F") == expected
        run.step(0.0, 1e-3)
        assert run.get1("F") == expected
        slow = v == 0.0 or abs(v) < p.get("DV", 0.0)
        most = max(Fn, 0.0) / Fn0 * p.get("T_dz", p.get("Fs", p["Fc"]))
        assert run.get1("stuck") == float(slow and abs(F_ext) <= most)
        if run.get1("stuck"):
            assert run.get1("F") == F_ext
        if name == "Karnopp":
            assert run.get1("v_reported") == (0.0 if slow else v)


@pytest.mark.parametrize("name", LAWS)
@reproducibly
@given(data=st.data(), v=velocities, F_ext=forces)
def test_friction_is_odd_and_bounded_and_outside_a_band_takes_power_out(
    block: GetLibrary, name: str, data: st.DataObject, v: float, F_ext: float
) -> None:
    p = {each: data.draw(ranges.get(each, level), each) for each in LAWS[name][1]}
    found = []
    for s in (1.0, -1.0):
        with Instance(block(name)) as run:
            run.initialise(v=s * v, F_ext=s * F_ext, **p)
            found.append(s * run.get1("F"))
    assert found[0] == found[1]
    highest = max(p["Fc"], p.get("Fs", 0.0), p.get("T_dz", 0.0)) + p.get("Fv", 0.0) * abs(v)
    assert abs(found[0]) <= highest * (1.0 + 1e-12)
    if abs(v) >= p.get("DV", 0.0):
        assert v * found[0] >= 0.0


@reproducibly
@given(v=velocities, Fv=level, delta_v=st.one_of(st.floats(0.0, 4.0), st.sampled_from([0.0, 1.0, 2.0])))
def test_viscous_friction_is_an_odd_power(block: GetLibrary, v: float, Fv: float, delta_v: float) -> None:
    found = []
    for s in (1.0, -1.0):
        with Instance(block("Viscous")) as run:
            run.initialise(v=s * v, Fv=Fv, delta_v=delta_v)
            found.append(s * run.get1("F"))
    assert found[0] == found[1] == pytest.approx(Fv * abs(v) ** delta_v * sign(v), rel=1e-12)
    assert v * found[0] >= 0.0


@reproducibly
@given(
    v=velocities.filter(bool),
    Fn=normal,
    delta=st.floats(0.3, 4.0),
    offset=forces,
    Fc=level,
    Fs=level,
    vs=st.floats(1e-4, 0.1),
)
def test_the_lorentzian_shape_of_stribeck(
    block: GetLibrary, v: float, Fn: float, delta: float, offset: float, Fc: float, Fs: float, vs: float
) -> None:
    """Hess and Soom 1990; load and viscous part as for the exponential shape, which the other file tests."""
    n = max(Fn, 0.0) / 2.0
    for shape, falloff in ((0, math.exp(-((abs(v) / vs) ** delta))), (1, 1.0 / (1.0 + (abs(v) / vs) ** delta))):
        with Instance(block("Stribeck")) as run:
            run.initialise(v=v, Fn=Fn, Fn0=2.0, delta=delta, shape=shape, offset=offset, Fc=Fc, Fs=Fs, vs=vs)
            expected = n * sign(v) * (Fc + (Fs - Fc) * falloff) + 0.4 * v + offset
            assert run.get1("F") == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_the_stribeck_effect_ends_before_denormal_numbers(block: GetLibrary) -> None:
    """exp(-708) is the last normal one of the powers below; the processor takes longer for others."""
    with Instance(block("Tustin")) as run:
        run.initialise(Fc=0.0, Fs=1.0, vs=1.0, Fv=0.0, v=-707.0)
        assert run.get1("F") == pytest.approx(-math.exp(-707.0), rel=1e-12)
        run.set({"v": -720.0})
        assert run.get1("F") == 0.0


@reproducibly
@given(F_ext=forces, Fn=normal, offset=forces, Fs=level, shape=st.sampled_from([0, 1]))
def test_at_rest_stribeck_holds_up_to_the_loaded_static_friction(
    block: GetLibrary, F_ext: float, Fn: float, offset: float, Fs: float, shape: int
) -> None:
    n = max(Fn, 0.0)
    with Instance(block("Stribeck")) as run:
        run.initialise(F_ext=F_ext, Fn=Fn, offset=offset, Fs=Fs, shape=shape)
        assert run.get1("F") == min(max(F_ext, offset - n * Fs), offset + n * Fs)


# ---- identities (B17) and limits of the parameters

SAME = [
    ("Coulomb", {"Fc": 1.3}, "Stiction", {"Fc": 1.3, "Fs": 1.3, "Fv": 0.0}),
    ("Stiction", {"Fc": 1.3, "Fs": 0.7}, "Karnopp", {"Fc": 1.3, "Fs": 0.7, "DV": 0.0}),
    ("Stiction", {"Fc": 1.3, "Fs": 1.3}, "DeadZoneTorque", {"Fc": 1.3, "T_dz": 1.3, "DV": 0.0}),
    ("Stiction", {"Fc": 1.3, "Fs": 1.3}, "Tustin", {"Fc": 1.3, "Fs": 1.3}),
    ("Stiction", {"Fc": 1.3, "Fs": 1.3}, "Stribeck", {"Fc": 1.3, "Fs": 1.3, "shape": 1}),
    ("Tustin", {"vs": 2e-3}, "Stribeck", {"vs": 2e-3, "delta": 1.0}),
]


@pytest.mark.parametrize(("one", "of_one", "other", "of_other"), SAME, ids=[f"{a}-{b}" for a, _, b, _ in SAME])
@reproducibly
@given(v=velocities, F_ext=forces, Fn=normal)
def test_models_that_are_special_cases_of_each_other_agree(
    block: GetLibrary,
    one: str,
    of_one: dict[str, float],
    other: str,
    of_other: dict[str, float],
    v: float,
    F_ext: float,
    Fn: float,
) -> None:
    found = []
    for name, values in ((one, of_one), (other, of_other)):
        with Instance(block(name)) as run:
            run.initialise(v=v, F_ext=F_ext, Fn=Fn, **values)
            found.append(run.get1("F"))
    assert found[0] == pytest.approx(found[1], rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("name", ["Tustin", "Stribeck"])
def test_parameters_at_their_limits_give_no_nan(block: GetLibrary, name: str) -> None:
    for values in ({"vs": 1e-12}, {"Fs": 0.0}, {"Fc": 0.0}, {"Fc": 0.0, "Fs": 0.0}, {"vs": 1e300}):
        for v in (0.0, 5e-324, 1e-12, 1.0, -1e150):
            with Instance(block(name)) as run:
                run.initialise(v=v, F_ext=2.0, Fv=0.0, **values)
                assert abs(run.get1("F")) <= 1.5


# ---- Karnopp's mass

Piece = tuple[float, float, float, float, float]  # duration, F_ext and its slope, Fn and its slope
P_MASS = {"m": 0.7, "Fc": 1.0, "Fs": 1.6, "Fv": 0.4, "DV": 1e-2}


def karnopp_oracle(x: float, w: float, pieces: Sequence[Piece], p: dict[str, float]) -> tuple[float, float, float]:
    """x, w and the time in the band by scipy, for load Fs >= load Fc + Fv DV, between events that scipy finds.

    Where the load fades below that while the mass is at the edge of the band, the oracle switches without end: such
    a case is rejected.
    """
    m, Fc, Fs, Fv, DV = (p[name] for name in ("m", "Fc", "Fs", "Fv", "DV"))
    inside, band, switches = abs(w) < DV, 0.0, 0

    for duration, f0, f1, n0, n1 in pieces:
        knots = [0.0, duration]
        # where the force passes static friction, and the load zero
        for value, slope in ((f0 - Fs * n0, f1 - Fs * n1), (f0 + Fs * n0, f1 + Fs * n1), (f0, f1), (n0, n1)):
            if slope != 0.0 and 0.0 < -value / slope < duration:
                knots.append(-value / slope)
        knots.sort()
        for begin, end in itertools.pairwise(knots):
            t, middle = begin, 0.5 * (begin + end)
            n_middle = max(n0 + n1 * middle, 0.0)
            push = f0 + f1 * middle - clip(f0 + f1 * middle, Fs * n_middle)
            while t < end - 1e-13:
                switches += 1
                if switches > 500:
                    reject()

                def load_at(s: float, n0: float = n0, n1: float = n1) -> float:
                    return max(n0 + n1 * s, 0.0)

                if inside:
                    if push == 0.0:
                        band += end - t
                        t = end
                        continue
                    s = sign(push)
                    if s * w >= DV * (1.0 - 1e-12):
                        inside, w = False, s * DV
                        continue

                    def rate(
                        u: float, y: np.ndarray, s: float = s, f0: float = f0, f1: float = f1
                    ) -> tuple[float, float]:
                        return 0.0, (f0 + f1 * u - s * Fs * load_at(u)) / m

                    def event(_: float, y: np.ndarray, s: float = s) -> float:
                        return float(s * y[1] - DV)
                else:
                    s = sign(w)

                    def rate(
                        u: float, y: np.ndarray, s: float = s, f0: float = f0, f1: float = f1
                    ) -> tuple[float, float]:
                        return y[1], (f0 + f1 * u - s * Fc * load_at(u) - Fv * y[1]) / m

                    def event(u: float, y: np.ndarray, s: float = s) -> float:
                        return float(DV - s * y[1])

                    if s * w <= DV and s * rate(t, np.array([x, w]))[1] <= 0.0:
                        inside, w = True, s * DV * (1.0 - 1e-15)
                        continue
                event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
                solution = solve_ivp(rate, (t, end), [x, w], "DOP853", rtol=1e-12, atol=1e-15, events=event)
                band += (solution.t[-1] - t) * inside
                t, (x, w) = float(solution.t[-1]), solution.y[:, -1]
                if solution.status == 1:
                    inside = not inside
                    w = sign(w) * DV * (1.0 - 1e-15 if inside else 1.0)
    return x, w, band


def run_pieces(
    library: Library, pieces: Sequence[Piece], cuts: int = 1, **values: float
) -> tuple[list[float], list[float]]:
    """x, w, v and F of KarnoppMass at the end of each piece, each cut into `cuts` steps; and the forces."""
    with Instance(library) as run:
        run.initialise(**values)
        t = 0.0
        for duration, f0, f1, n0, n1 in pieces:
            for k in range(cuts):
                at = duration * k / cuts
                run.set({"F_ext": f0 + f1 * at, "Fn": n0 + n1 * at})
                assert run.input_derivatives({"F_ext": f1, "Fn": n1}) == OK
                run.step(t, duration / cuts)
                t += duration / cuts
        return run.get("x", "w", "v", "F"), run.get("F_ext", "Fn")


piece = st.tuples(
    st.floats(1e-3, 1.0), st.floats(-3.0, 3.0), st.floats(-8.0, 8.0), st.floats(-0.5, 1.5), st.floats(-2.0, 2.0)
)
held_piece = st.tuples(st.floats(1e-6, 0.5), st.floats(-3.0, 3.0), st.just(0.0), st.floats(0.2, 1.5), st.just(0.0))


@pytest.mark.parametrize("pieces", [piece, held_piece], ids=["linear", "held"])
@reproducibly
@given(data=st.data(), v0=st.floats(-0.3, 0.3))
def test_karnopps_mass_moves_as_scipy_integrates_it(
    block: GetLibrary, pieces: st.SearchStrategy[Piece], data: st.DataObject, v0: float
) -> None:
    drawn = data.draw(st.lists(pieces, min_size=1, max_size=5))
    x, w, _ = karnopp_oracle(0.1, v0, drawn, P_MASS)
    for cuts in (1, 7):
        found, _ = run_pieces(block("KarnoppMass"), drawn, cuts, x0=0.1, v0=v0, **P_MASS)
        assert found[:2] == pytest.approx([x, w], abs=2e-10)
        assert found[2] == (0.0 if abs(found[1]) < P_MASS["DV"] else found[1])


@reproducibly
@given(
    v0=st.floats(0.02, 3.0),
    m=st.floats(0.1, 10.0),
    Fv=st.floats(0.0, 3.0),
    F_ext=st.floats(-1.5, 0.9),
    h=st.floats(1e-6, 0.5),
    s=st.sampled_from([1.0, -1.0]),
)
def test_sliding_to_rest_is_the_closed_form(
    block: GetLibrary, v0: float, m: float, Fv: float, F_ext: float, h: float, s: float
) -> None:
    """m v' = F - Fc - Fv v until v = DV; then nothing moves, as |F| <= Fs. At any step size."""
    a, drive, DV = Fv / m, (F_ext - 1.0) / m, 1e-3
    if a > 1e-3:
        ratio = (v0 - drive / a) / (DV - drive / a)
        stop = math.log(ratio) / a
        distance = drive / a * stop + (v0 - drive / a) * -math.expm1(-a * stop) / a
    else:
        Fv = a = 0.0
        stop = (DV - v0) / drive
        distance = v0 * stop + 0.5 * drive * stop**2
    with Instance(block("KarnoppMass")) as run:
        run.initialise(v0=s * v0, m=m, Fv=Fv, F_ext=s * F_ext)
        t, steps = 0.0, min(math.ceil(stop / h) + 1, 200)
        for _ in range(steps):
            run.step(t, h)
            t += h
        run.step(t, max(stop - t, 0.0) + h)
        x, v, F, stuck = run.get("x", "v", "F", "stuck")
        assert s * x == pytest.approx(distance, rel=1e-11, abs=1e-13)
        assert (v, F, stuck) == (0.0, s * F_ext, 1.0)


def test_a_held_mass_does_not_creep_and_the_first_break_away_is_late(block: GetLibrary) -> None:
    """The band has to be crossed under the growing force: by sqrt(2 m DV / rate) late."""
    rate, late = 0.5, math.sqrt(2.0 * 1.0 * 1e-3 / 0.5)
    with Instance(block("KarnoppMass")) as run:
        run.initialise()
        for k in range(300):
            run.set({"F_ext": rate * 0.01 * k})
            assert run.input_derivatives({"F_ext": rate}) == OK
            run.step(0.01 * k, 0.01)
        assert run.get("x", "v", "w", "stuck") == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-15)
        assert run.input_derivatives({"F_ext": rate}) == OK
        run.step(3.0, late * (1.0 - 1e-9))
        assert run.get1("v") == 0.0
        assert run.get1("w") == pytest.approx(1e-3, rel=1e-8)
        assert run.input_derivatives({"F_ext": rate}) == OK
        t = run.get1("time")
        run.step(t, late * 2e-9)
        assert run.get1("v") >= 1e-3


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_at_the_edge_of_the_band_a_mass_still_slides(block: GetLibrary, s: float) -> None:
    """v = v0 - t is DV after 0.5 s; all numbers are exact."""
    with Instance(block("KarnoppMass")) as run:
        run.initialise(v0=s * (0.5 + 2.0**-10), DV=2.0**-10, Fv=0.0)
        run.step(0.0, 0.5)
        assert run.get("v", "F", "stuck") == [s * 2.0**-10, s, 0.0]
        run.step(0.5, 1e-9)
        assert run.get("v", "F", "stuck") == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_below_the_friction_of_sliding_a_mass_stays_at_the_edge(block: GetLibrary, s: float) -> None:
    """Fs < F_ext < Fc: the band pushes out what sliding slows down; it rests, and slides above Fc + Fv DV."""
    with Instance(block("KarnoppMass")) as run:
        run.initialise(Fs=0.5, F_ext=s * 0.8)
        run.step(0.0, 10.0)
        assert run.get("x", "v", "F", "stuck") == [0.0, 0.0, s * 0.8, 1.0]
        assert run.get1("w") == pytest.approx(s * 1e-3, rel=1e-12)
        run.set({"F_ext": s * (1.0 + 0.4e-3 + 1e-6)})
        run.step(10.0, 1.0)
        assert s * run.get1("v") > 1e-3


@reproducibly
@given(drawn=st.lists(piece, min_size=1, max_size=4), v0=st.floats(-0.3, 0.3))
def test_karnopps_mass_is_odd_and_friction_is_bounded_and_takes_power_out(
    block: GetLibrary, drawn: list[Piece], v0: float
) -> None:
    mirrored = [(d, -f0, -f1, n0, n1) for d, f0, f1, n0, n1 in drawn]
    one, (_, Fn) = run_pieces(block("KarnoppMass"), drawn, v0=v0, **P_MASS)
    other, _ = run_pieces(block("KarnoppMass"), mirrored, v0=-v0, **P_MASS)
    assert one == [-value for value in other]
    v, F = one[2:]
    assert v * F >= 0.0
    assert abs(F) <= max(Fn, 0.0) * P_MASS["Fs"] + P_MASS["Fv"] * max(abs(v), P_MASS["DV"])


# ---- Leine's switch model


def leine_oracle(
    x: float, v: float, pieces: Sequence[tuple[float, float, float, float]], p: dict[str, float]
) -> tuple[float, float]:
    """x and v by scipy's events; pieces of (duration, v_belt, F_load, its slope)."""
    m, k, Fs, delta, eta, ratio = (p[name] for name in ("m", "k", "Fs", "delta", "eta", "ratio"))
    for duration, belt, f0, f1 in pieces:
        t, forced = 0.0, ""
        while t < duration - 1e-13:
            v_r, P = v - belt, f0 + f1 * t - k * x
            mode = forced or ("slip" if abs(v_r) > eta else "transition" if abs(P) > Fs else "stick")
            forced = ""
            s = sign(v_r) if mode == "slip" else sign(P)

            def rate(
                u: float,
                y: np.ndarray,
                mode: str = mode,
                s: float = s,
                belt: float = belt,
                f0: float = f0,
                f1: float = f1,
            ) -> tuple[float, float]:
                if mode == "stick":
                    return belt, -(y[1] - belt) * math.sqrt(k / m)
                F = s * Fs
                if mode == "slip":
                    F *= ratio + (1.0 - ratio) / (1.0 + delta * s * (y[1] - belt))
                return y[1], (f0 + f1 * u - k * y[0] - F) / m

            def slow(_: float, y: np.ndarray, s: float = s, belt: float = belt) -> float:
                return float(eta - s * (y[1] - belt))

            def fast(_: float, y: np.ndarray, s: float = s, belt: float = belt) -> float:
                return float(s * (y[1] - belt) - eta)

            def weak(u: float, y: np.ndarray, s: float = s, f0: float = f0, f1: float = f1) -> float:
                return float(Fs - s * (f0 + f1 * u - k * y[0]))

            def strong(u: float, y: np.ndarray, f0: float = f0, f1: float = f1) -> float:
                return float(abs(f0 + f1 * u - k * y[0]) - Fs)

            events = {"slip": (slow,), "transition": (fast, weak), "stick": (strong,)}[mode]
            for event in events:
                event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
            solution = solve_ivp(
                rate, (t, duration), [x, v], "DOP853", rtol=1e-12, atol=1e-14, events=events, max_step=0.02
            )
            t, (x, v) = float(solution.t[-1]), solution.y[:, -1]
            if solution.status == 1:
                if mode == "slip":
                    v = belt + s * eta * (1.0 - 1e-9)
                elif mode == "stick":
                    forced = "transition"
                elif len(solution.t_events[0]):
                    v, forced = belt + s * eta * (1.0 + 1e-9), "slip"
                else:
                    forced = "stick"
    return x, v


P_SWITCH = {"m": 0.8, "k": 1.5, "Fs": 1.0, "delta": 3.0, "eta": 1e-3, "ratio": 0.2}


@pytest.mark.parametrize("h", [1.2, 0.3])
def test_leines_mass_breaks_away_where_a_falling_load_no_longer_holds_it(block: GetLibrary, h: float) -> None:
    """Fs Fn / Fn0 = F_load at t = 0.6 s; then its acceleration grows linearly."""
    Fs, m, rate, t = 3.0, 0.5, -0.5, 0.0
    held = 0.6
    start = {"m": m, "k": 1e-12, "Fs": Fs, "ratio": 1.0, "Fn0": 2.0, "eta": 1e-12, "x0": 0.0, "v0": 0.0}
    with Instance(block("SwitchMass")) as run:
        run.initialise(**start)
        while t < 1.2 - 1e-9:
            Fn = 1.6 + rate * t
            run.set({"v_belt": 0.0, "F_load": Fs / 2.0 * (1.6 + rate * held), "Fn": Fn})
            assert run.input_derivatives({"Fn": rate}) == OK
            run.step(t, h)
            t += h
            moved = max(t - held, 0.0)
            push = -Fs * rate / 2.0 / m
            assert run.get("x", "v") == pytest.approx([push * moved**3 / 6.0, push * moved**2 / 2.0], abs=2e-6)


@pytest.mark.parametrize("seed", range(25))
def test_leines_mass_moves_as_scipy_integrates_it(block: GetLibrary, seed: int) -> None:
    """Jumps of the belt and ramps of the load, drawn so that no event is a tie; in one step and in many."""
    draw = np.random.default_rng(seed)
    x0, v0 = draw.uniform(-1.5, 1.5), draw.uniform(-0.5, 0.5)
    drawn = [
        (draw.uniform(0.05, 3.0), draw.choice([0.2, -0.3, 0.0, 1.0]), *draw.uniform(-1.5, 1.5, 2))
        for _ in range(draw.integers(1, 4))
    ]
    expected = leine_oracle(x0, v0, drawn, P_SWITCH)
    for cuts in (1, 9, 200):
        with Instance(block("SwitchMass")) as run:
            run.initialise(x0=x0, v0=v0, **P_SWITCH)
            t = 0.0
            for duration, belt, f0, f1 in drawn:
                for k in range(cuts):
                    run.set({"v_belt": belt, "F_load": f0 + f1 * duration * k / cuts})
                    assert run.input_derivatives({"F_load": f1}) == OK
                    run.step(t, duration / cuts)
                    t += duration / cuts
            assert run.get("x", "v") == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_a_force_of_just_the_static_friction_is_held(block: GetLibrary, s: float) -> None:
    with Instance(block("SwitchMass")) as run:
        run.initialise(v_belt=0.0, v0=0.0, F_load=s)
        run.step(0.0, 10.0)
        assert run.get("x", "v", "F", "stuck") == [0.0, 0.0, s, 1.0]
        run.set({"F_load": s * 1.001})
        run.step(10.0, 10.0)
        assert s * run.get1("x") > 1e-3


@pytest.mark.parametrize("rate", [0.5, 5.0])
def test_friction_that_grows_from_nothing_holds_a_load_that_grows_more_slowly(block: GetLibrary, rate: float) -> None:
    with Instance(block("SwitchMass")) as run:
        run.initialise(v_belt=0.0, v0=0.0, Fn=0.0)
        assert run.input_derivatives({"Fn": rate, "F_load": 0.9 * rate}) == OK
        run.step(0.0, 2.0)
        assert run.get("x", "v", "stuck") == [0.0, 0.0, 1.0]
        assert run.get1("F") == pytest.approx(1.8 * rate, rel=1e-12)


def belt_period(library: Library, h: float, **values: float) -> float:
    """The second period, from the passages of x = 0.5 in stick, where x is linear in time."""
    passages: list[float] = []
    with Instance(library) as run:
        run.initialise(**values)
        before = INF
        for k in range(round(40.0 / h)):
            run.step(k * h, h)
            x, stuck = run.get("x", "stuck")
            if before < 0.5 <= x and stuck:
                passages.append((k + 1) * h - (x - 0.5) / 0.2)
            before = x
    return passages[2] - passages[1]


INF = math.inf


@pytest.mark.parametrize(
    ("eta", "expected", "accuracy"),
    [(1e-2, 12.0627, 5e-5), (1e-3, 12.0040, 5e-5), (1e-4, 12.00114, 5e-6), (1e-6, 12.00103, 5e-6)],
)
def test_b10_the_error_of_the_switch_model_is_of_first_order_in_eta(
    block: GetLibrary, eta: float, expected: float, accuracy: float
) -> None:
    assert belt_period(block("SwitchMass"), 0.05, eta=eta) == pytest.approx(expected, abs=accuracy)


def test_the_steps_do_not_matter_to_the_period(block: GetLibrary) -> None:
    coarse, fine = (belt_period(block("SwitchMass"), h, eta=1e-9) for h in (0.1, 2e-3))
    assert coarse == pytest.approx(fine, abs=1e-9)


def test_a_stuck_mass_follows_the_belt_without_drift(block: GetLibrary) -> None:
    """The relative velocity decays at the rate sqrt(k/m); x is the path of the belt, which may accelerate."""
    with Instance(block("SwitchMass")) as run:
        run.initialise(v0=0.2 + 5e-4, eta=1e-3, x0=-0.3, k=2.0, m=0.5)
        assert run.get1("F") == pytest.approx(0.6 + 0.5 * 5e-4 * 2.0, rel=1e-12)
        assert run.input_derivatives({"v_belt": 0.1}) == OK
        run.step(0.0, 0.7)
        v_r, x, stuck = run.get("v_r", "x", "stuck")
        assert v_r == pytest.approx(5e-4 * math.exp(-2.0 * 0.7), rel=1e-9)
        assert x == pytest.approx(-0.3 + 0.2 * 0.7 + 0.05 * 0.49, rel=1e-14)
        assert stuck == 1.0
        run.set({"v_belt": 0.27})
        run.step(0.7, 1e-3)
        assert run.get1("F") == pytest.approx(-2.0 * run.get1("x") + 0.5 * 2.0 * run.get1("v_r"), rel=1e-12)


def test_the_load_scales_the_friction_of_the_switch_model(block: GetLibrary) -> None:
    found = []
    for values in ({"Fn": 3.0, "Fn0": 2.0, "Fs": 1.0}, {"Fs": 1.5}):
        with Instance(block("SwitchMass")) as run:
            run.initialise(**values)
            for k in range(300):
                run.step(0.05 * k, 0.05)
            found.append(run.get("x", "v", "F"))
    assert found[0] == pytest.approx(found[1], rel=1e-9)


@settings(reproducibly, max_examples=few(20))
@given(x0=st.floats(-1.5, 1.5), v0=st.floats(-1.0, 1.0), delta=st.floats(0.0, 50.0))
def test_leines_mass_is_odd_and_on_a_belt_at_rest_loses_energy(
    block: GetLibrary, x0: float, v0: float, delta: float
) -> None:
    with Instance(block("SwitchMass")) as one, Instance(block("SwitchMass")) as other:
        one.initialise(v_belt=0.0, x0=x0, v0=v0, delta=delta)
        other.initialise(v_belt=0.0, x0=-x0, v0=-v0, delta=delta)
        energy = INF
        for k in range(200):
            for run in (one, other):
                run.step(0.05 * k, 0.05)
            x, v, F = one.get("x", "v", "F")
            assert other.get("x", "v", "F") == pytest.approx([-x, -v, -F], abs=1e-9)
            assert abs(F) <= 1.0 + 1e-6
            assert 0.5 * x * x + 0.5 * v * v <= energy + 1e-9
            energy = 0.5 * x * x + 0.5 * v * v
