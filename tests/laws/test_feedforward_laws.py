"""Friction feedforward against the friction blocks, closed forms and independent recursions.

The sample time and all velocities are dyadic numbers, so that r[k] - r[k-1] = v Ts without rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from shell.instance import Instance, Library, load
from thorough import few, nightly, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import VECTORS, Kind, Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
TS = 2.0**-10
UNIT = 2.0**-22  # [m/s] of the velocities
WIDE = {"u_min": -1e30, "u_max": 1e30}
WITH_PATH = ["DahlFeedforward", "LuGreFeedforward", "ElastoPlasticFeedforward", "GMSFeedforward"]
STATIC = ["CoulombFeedforward", "KarnoppFeedforward", "DeadZoneFeedforward"]

reproducibly = settings(max_examples=few(40), deadline=20_000, derandomize=True, database=None)
speeds = st.one_of(st.integers(-(2**10), 2**10), st.integers(-(2**18), 2**18), st.sampled_from([0, 1, -1]))
velocities = st.lists(st.builds(lambda n: n * UNIT, speeds), min_size=1, max_size=30)


def run(law: Law, samples: Iterable[dict[str, float]], **parameters: float | tuple[float, ...]) -> list[dict]:
    """Outputs and next states of consecutive samples."""
    given = {v.name for v in law.given}
    states = {v.name: v.starts if v.kind in VECTORS else v.start for v in law.select(Kind.STATE, Kind.STATES)}
    results = []
    for sample in samples:
        values = {**WIDE, **parameters, **states} | {name: value for name, value in sample.items() if name in given}
        results.append(law.evaluate(values))
        states = {name: results[-1][name] for name in states}
    return results


def along(v: list[float]) -> list[dict[str, float]]:
    """Samples of a reference that had the velocity v[k] from sample k to k + 1; in sample k + 1, rd is v[k]."""
    r = np.concatenate([[0.0], np.cumsum(v) * TS])
    return [{"r": a, "rd": b} for a, b in zip(r, [v[0], *v], strict=True)]


def friction(library: Library, v: list[float], *names: str, **values: float) -> np.ndarray:
    """Variables of the friction block after steps of TS with held velocities."""
    found = []
    with Instance(library) as block:
        block.initialise(**values)
        for k, speed in enumerate(v):
            block.set({"v": speed})
            block.step(k * TS, TS)
            found.append(block.get(*names))
    return np.array(found)


def names_in_block(parameters: dict[str, float | tuple[float, ...]]) -> dict[str, float]:
    """Vectors element by element."""
    scalars = {}
    for name, value in parameters.items():
        if isinstance(value, tuple):
            scalars |= {f"{name}[{i + 1}]": element for i, element in enumerate(value)}
        else:
            scalars[name] = value
    return scalars


def compare(law: str, library: Library, v: list[float], scale: float, tolerance: float = 1e-12, **parameters) -> None:
    """F_hat is the block's force at the end of every step, relative to the size of the forces."""
    found = [sample["F_hat"] for sample in run(LAWS[law], along(v), m=0.0, Ts=TS, **parameters)][1:]
    expected = friction(library, v, "F", **names_in_block(parameters))[:, 0]
    assert np.abs(found - expected).max() <= tolerance * max(scale, np.abs(expected).max())


# ---- the exact model: the friction block itself


@pytest.fixture(scope="module")
def block(build_fmu: Callable[..., Path]) -> Callable[[str], Library]:
    return lambda name: load(build_fmu(name))


@reproducibly
@given(velocities, st.floats(0.0, 20.0))
def test_coulomb_is_the_block_in_motion(block, v, Fc):
    expected = friction(block("Coulomb"), v, "F", Fc=Fc)[:, 0]
    found = run(LAWS["CoulombFeedforward"], [{"rd": speed} for speed in v], m=0.0, Fc=Fc)
    assert [sample["F_hat"] for sample in found] == list(expected)


@reproducibly
@given(velocities, st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.floats(0.0, 0.01))
def test_karnopp_is_the_block_under_the_inertia_force(block, v, rdd, Fs, DV):
    parameters = {"Fc": 1.25, "Fs": Fs, "Fv": 3.0, "DV": DV}
    expected = friction(block("Karnopp"), v, "F", F_ext=2.0 * rdd, **parameters)[:, 0]
    found = run(LAWS["KarnoppFeedforward"], [{"rd": speed, "rdd": rdd} for speed in v], m=2.0, **parameters)
    assert [sample["F_hat"] for sample in found] == pytest.approx(list(expected), rel=1e-15, abs=0.0)


@reproducibly
@given(velocities, st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.floats(0.0, 0.01))
def test_dead_zone_is_the_block_up_to_its_dead_zone(block, v, force, T_dz, DV):
    parameters = {"Fc": 1.25, "T_dz": T_dz, "Fv": 3.0, "DV": DV}
    expected = friction(block("DeadZoneTorque"), v, "F", F_ext=force, **parameters)[:, 0]
    samples = [{"rd": speed, "rdd": 0.5, "f": force - 1.0} for speed in v]
    for speed, sample, F in zip(
        v, run(LAWS["DeadZoneFeedforward"], samples, m=2.0, **parameters), expected, strict=True
    ):
        if (abs(speed) < DV or speed == 0.0) and abs(force) > T_dz:
            F = math.copysign(T_dz, force)
        assert sample["F_hat"] == pytest.approx(F, rel=1e-14, abs=1e-15)
        assert sample["u"] == pytest.approx(force + F, rel=1e-12, abs=1e-14)


@reproducibly
@given(velocities, st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.floats(0.0, 0.01))
def test_dead_zone_without_a_controller_is_karnopp(v, rdd, level, DV):
    samples = [{"rd": speed, "rdd": rdd} for speed in v]
    shared = {"m": 2.0, "Fc": 1.25, "Fv": 3.0, "DV": DV}
    assert run(LAWS["DeadZoneFeedforward"], samples, T_dz=level, **shared) == run(
        LAWS["KarnoppFeedforward"], samples, Fs=level, **shared
    )


def test_karnopp_gives_the_inertia_force_inside_the_band():
    for rd in (0.0, 0.9e-3, -0.9e-3):
        found = LAWS["KarnoppFeedforward"].evaluate({"rd": rd, "rdd": 0.3, "m": 2.0, "Fs": 1.5, "DV": 1e-3})
        assert found["F_hat"] == 0.6
    assert LAWS["KarnoppFeedforward"].evaluate({"rdd": -5.0, "Fs": 1.5})["F_hat"] == -1.5


exponents = st.one_of(st.sampled_from([0.0, 0.5, 1.0, 1.5, 2.0, 3.0]), st.floats(0.0, 5.0))


@reproducibly
@given(velocities, exponents, st.floats(1e2, 1e6), st.floats(0.1, 20.0))
def test_dahl_is_the_block(block, v, n, sigma, Fc):
    compare("DahlFeedforward", block("Dahl"), v, Fc, n=n, sigma=sigma, Fc=Fc)


stribeck = {
    "Fc": st.floats(0.2, 2.0),
    "Fs": st.floats(0.2, 3.0),
    "vs": st.floats(1e-4, 0.1),
    "delta": st.floats(0.5, 3.0),
}
bristles = {"sigma0": st.floats(1e3, 1e6), "sigma1": st.floats(0.0, 400.0), "v_d": st.sampled_from([0.0, 0.02])}


@reproducibly
@given(velocities, st.fixed_dictionaries({**stribeck, **bristles}), st.sampled_from([0.0, 1.0]))
def test_lugre_is_the_block(block, v, parameters, asymmetric):
    own = {"asymmetric": asymmetric, "sigma2_neg": 3.0, "Fc_neg": 0.7, "Fs_neg": 0.9, "vs_neg": 2e-3, "delta_neg": 1.0}
    compare("LuGreFeedforward", block("LuGre"), v, 1.0, **parameters, **own)


@reproducibly
@given(velocities, st.fixed_dictionaries({**stribeck, **bristles, "z_ba": st.floats(0.0, 2e-4)}))
def test_elasto_plastic_is_the_block(block, v, parameters):
    """To the error of its five steps, one part in 1e5 of the plastic range, over every sample."""
    compare("ElastoPlasticFeedforward", block("ElastoPlastic"), v, 3.0, 3e-5, **parameters)


@reproducibly
@given(st.lists(st.builds(lambda n: n * 2.0**-30, st.integers(-(2**10), 2**10)), min_size=1, max_size=30))
def test_elasto_plastic_is_exact_below_break_away(block, v):
    """Up to 2^-30 2^10 30 m/s Ts = 2.8e-8 m, far below z_ba."""
    compare("ElastoPlasticFeedforward", block("ElastoPlastic"), v, 0.0)


elements = st.lists(st.tuples(st.floats(0.0, 1e5), st.floats(0.01, 1.0)), min_size=1, max_size=10)


@reproducibly
@given(velocities, st.fixed_dictionaries({**stribeck, "C": st.floats(0.0, 1e4)}), elements)
def test_gms_is_the_block(block, v, parameters, elements):
    k, alpha = (tuple([*column, *[0.0] * (10 - len(elements))]) for column in zip(*elements, strict=True))
    compare("GMSFeedforward", block("GMS"), v, 1.0, sigma2=3.0, k=k, alpha=alpha, **parameters)


def test_gms_is_the_block_in_every_element(block):
    v = [UNIT * n for n in np.random.default_rng(1).integers(-(2**14), 2**14, 300).tolist()]
    found = run(LAWS["GMSFeedforward"], along(v), Ts=TS)[1:]
    names = [f"Fi[{i}]" for i in range(1, 11)], [f"slipping[{i}]" for i in range(1, 11)]
    expected = friction(block("GMS"), v, *names[0], *names[1])
    assert np.array([sample["Fi"] for sample in found]) == pytest.approx(expected[:, :10], rel=1e-12, abs=1e-13)
    assert np.array([sample["slipping"] for sample in found]) == pytest.approx(expected[:, 10:])
    assert [sample["slips"] for sample in found] == list(expected[:, 10:].sum(axis=1))
    assert {0.0, 10.0} < {sample["slips"] for sample in found}


# ---- closed forms


@given(st.integers(1, 2**20), st.floats(1e3, 1e6), st.floats(0.1, 20.0))
def test_dahl_from_rest_is_an_exponential(path, sigma, Fc):
    dr = path * 2.0**-30
    found = run(LAWS["DahlFeedforward"], [{"r": 0.0}, {"r": dr}, {"r": dr}], sigma=sigma, Fc=Fc)
    assert found[0]["F_hat"] == 0.0
    assert found[1]["F_hat"] == pytest.approx(-Fc * math.expm1(-sigma * dr / Fc), rel=1e-13)
    assert found[2]["F_hat"] == found[1]["F_hat"]


def test_dahls_steady_loop_has_the_amplitude_of_its_closed_form():
    """A triangle of +-X: F = Fc tanh(sigma X / Fc) at its tips."""
    sigma, Fc, X = 1e5, 1.0, 2.0**-17
    way = np.concatenate([np.linspace(-X, X, 65), np.linspace(X, -X, 65)[1:-1]])
    found = run(LAWS["DahlFeedforward"], [{"r": r} for r in np.tile(way, 40)], sigma=sigma, Fc=Fc)
    last = [sample["F_hat"] for sample in found[-way.size :]]
    assert [min(last), max(last)] == pytest.approx([-Fc * math.tanh(sigma * X / Fc), Fc * math.tanh(sigma * X / Fc)])


@pytest.mark.parametrize("law", ["LuGreFeedforward", "ElastoPlasticFeedforward", "GMSFeedforward"])
@pytest.mark.parametrize("v", some([2.0**-12, -(2.0**-9), 0.125], [-(2.0**-9)]))
def test_steady_sliding_is_the_stribeck_curve(law, v):
    found = run(LAWS[law], along([v] * 4000), Ts=TS)[-1]
    assert found["F_hat"] == pytest.approx(
        math.copysign(1.0 + 0.5 * math.exp(-((v / 1e-3) ** 2)), v) + 0.4 * v, rel=1e-9
    )


def test_an_element_that_arrives_within_a_sample_is_at_its_level():
    """Not far below it, where the attraction alone would leave it: C = 0 changes nothing."""
    found = run(LAWS["GMSFeedforward"], [{"r": 0.0}, {"r": 1.0}], C=0.0, sigma2=0.0)[-1]
    assert found["Fi"] == pytest.approx((0.1,) * 10)
    assert (found["F_hat"], found["slips"]) == (pytest.approx(1.0), 10.0)


def test_gms_is_maxwell_slip_in_presliding():
    """A triangle that shrinks and grows: masing branches, whose inner loops are forgotten."""
    k, W = (4e4, 2e4, 1e4, *[0.0] * 7), (0.3, 0.4, 0.3, *[0.0] * 7)
    tips = [0.0, 3e-5, -2e-5, 1e-5, -5e-6, 0.0, 1e-5, 3e-5]
    r = np.concatenate([np.linspace(a, b, 50, endpoint=False) for a, b in pairwise(tips)])
    found = run(LAWS["GMSFeedforward"], [{"r": x} for x in r], k=k, alpha=W, Fs=1.0, Fc=1.0, C=0.0, sigma2=0.0)
    force, expected = np.zeros(3), []
    for dr in np.diff(r, prepend=0.0):
        force = np.clip(force + np.array(k[:3]) * dr, -np.array(W[:3]), W[:3])
        expected.append(force.sum())
    assert [sample["F_hat"] for sample in found] == pytest.approx(expected, abs=1e-14)


def test_elasto_plastic_follows_its_differential_equation():
    sigma0, z_ba, S, dr = 1e5, 0.7e-5, 1.25, 2.0**-15

    def slope(_, z):
        alpha = 0.0 if z[0] <= z_ba else 1.0 if z[0] >= S / sigma0 else math.nan
        if math.isnan(alpha):
            middle, width = 0.5 * (S / sigma0 + z_ba), S / sigma0 - z_ba
            alpha = 0.5 + 0.5 * math.sin(math.pi * (z[0] - middle) / width)
        return [1.0 - alpha * sigma0 * z[0] / S]

    solved = solve_ivp(slope, (0.0, dr), [0.0], rtol=1e-10, atol=1e-15, max_step=dr / 500).y[0, -1]
    found = run(LAWS["ElastoPlasticFeedforward"], [{"r": 0.0}, {"r": dr}], Fc=S, Fs=S)
    assert found[1]["z_hat"] == pytest.approx(solved, abs=1e-5 * (S / sigma0 - z_ba))


@nightly
def test_elasto_plastic_does_not_drift_below_break_away():
    """A bias with vibration: LuGre creeps, elasto-plastic comes back to where it was."""
    r = 2.0**-18 + 2.0**-20 * (np.arange(2001) % 2)
    ends = {}
    for law in ("ElastoPlasticFeedforward", "LuGreFeedforward"):
        found = run(LAWS[law], [{"r": 0.0}, *[{"r": x} for x in r]])
        ends[law] = found[1]["z_hat"] - found[-1]["z_hat"]
    assert ends["ElastoPlasticFeedforward"] == 0.0
    assert ends["LuGreFeedforward"] > 0.1 * 2.0**-18


# ---- what all have in common


def random_reference(n: int, seed: int) -> list[dict[str, float]]:
    random = np.random.default_rng(seed)
    rd = random.choice([-1.0, 0.0, 1.0], n) * 10.0 ** random.uniform(-6, 0, n)
    return [
        {"r": a, "rd": b, "rdd": c} for a, b, c in zip(np.cumsum(rd) * 1e-3, rd, random.normal(size=n), strict=True)
    ]


@pytest.mark.parametrize("law", WITH_PATH)
def test_reset_is_a_first_sample(law):
    samples = random_reference(40, 1)
    samples[20] |= {"reset": 1.0}
    assert run(LAWS[law], samples)[20:] == run(LAWS[law], samples[20:])
    assert run(LAWS[law], samples)[20:] != run(LAWS[law], [sample | {"reset": 0.0} for sample in samples])[20:]


@pytest.mark.parametrize("law", [*STATIC, *WITH_PATH])
def test_disabled_it_is_silent_and_comes_back_fresh(law):
    samples = random_reference(60, 2)
    for sample in samples[20:40]:
        sample |= {"enable": 0.0}
    found = run(LAWS[law], samples)
    for sample in found[20:40]:
        assert set(np.concatenate([np.ravel(value) for value in sample.values()])) == {0.0}
    assert found[40:] == run(LAWS[law], samples[40:])


@pytest.mark.parametrize("law", WITH_PATH)
def test_it_comes_back_without_a_jump_wherever_the_axis_was_led(law):
    samples = [*along([0.125] * 20), {"r": 5.0, "enable": 0.0}, {"r": 7.0}]
    assert run(LAWS[law], samples)[-1]["u"] == 0.0


@pytest.mark.parametrize("law", [*STATIC, *WITH_PATH])
def test_gain_scales_the_friction_in_u_only(law):
    samples = random_reference(50, 3)
    full, half = (run(LAWS[law], samples, gain=gain, m=2.0) for gain in (1.0, 0.5))
    for sample, a, b in zip(samples, full, half, strict=True):
        assert b["F_hat"] == a["F_hat"]
        assert b["u"] == pytest.approx(2.0 * sample["rdd"] + 0.5 * b["F_hat"], rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("law", WITH_PATH)
def test_limits_of_u_do_not_touch_the_friction_state(law):
    samples = random_reference(50, 4)
    free, limited = run(LAWS[law], samples), run(LAWS[law], samples, u_min=-0.1, u_max=0.2)
    assert [sample["F_hat"] for sample in free] == [sample["F_hat"] for sample in limited]
    assert [sample["u"] for sample in limited] == [min(max(sample["u"], -0.1), 0.2) for sample in free]
    assert {sample["u_sat"] for sample in limited} == {-1.0, 0.0, 1.0}


@pytest.mark.parametrize("law", WITH_PATH)
def test_a_reference_at_rest_keeps_what_the_motion_left(law):
    found = run(LAWS[law], [*along([2.0**-10] * 10), *[{"r": 10 * 2.0**-20}] * 1000])
    rest = [sample["F_hat"] for sample in found[11:]]
    assert rest[0] > 0.0
    assert set(rest) == {rest[0]}


@pytest.mark.parametrize("law", [*STATIC, *WITH_PATH])
@pytest.mark.parametrize("size", [1e-300, 1e-12, 1.0, 1e6])
def test_extreme_references_give_numbers(law, size):
    """Displacements from the smallest to those that leave no trace of the history, forth and back."""
    samples = [{"r": size * a, "rd": size * b, "rdd": size} for a, b in [(0, 0), (1, 1), (1, 0), (-1, -1), (-1, 1)]]
    for sample in run(LAWS[law], samples):
        assert np.isfinite(np.concatenate([np.ravel(value) for value in sample.values()])).all()


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        ("DahlFeedforward", {"n": 0.0}),
        ("DahlFeedforward", {"n": 100.0, "Fc": 1e-9}),
        ("DahlFeedforward", {"sigma": 1e-9}),
        ("LuGreFeedforward", {"vs": 1e-12, "delta": 100.0, "v_d": 1e-12, "Fc": 1e-9, "Fs": 1e-9}),
        ("LuGreFeedforward", {"asymmetric": 1.0, "vs_neg": 1e-12, "delta_neg": 1e-3}),
        ("ElastoPlasticFeedforward", {"z_ba": 0.0}),
        ("ElastoPlasticFeedforward", {"z_ba": 1.0}),
        ("ElastoPlasticFeedforward", {"z_ba": 1e-5, "Fs": 1.0}),
        ("ElastoPlasticFeedforward", {"z_ba": 0.999999999e-5, "Fs": 1.0, "sigma1": 0.0}),
        ("GMSFeedforward", {"k": (0.0,) * 10, "alpha": (0.0,) * 10}),
        ("GMSFeedforward", {"C": 1e300, "Fc": 1e-9, "Fs": 1e-9}),
    ],
)
def test_extreme_parameters_give_numbers(law, parameters):
    for sample in run(LAWS[law], random_reference(50, 5), **parameters):
        assert np.isfinite(np.concatenate([np.ravel(value) for value in sample.values()])).all()


@pytest.mark.parametrize("law", [*STATIC, *WITH_PATH])
def test_the_fmus_sample_is_of_the_inputs_of_its_time(law, build_fmu):
    """What is set at t[k] is in F_hat after the step from t[k]: no sample of delay."""
    samples = random_reference(200, 6)
    expected = run(LAWS[law], samples, Ts=1e-3)
    names = [v.name for v in LAWS[law].select(Kind.OUTPUT)]
    used = {v.name for v in LAWS[law].given}
    with Instance(load(build_fmu(law))) as fmu:
        fmu.initialise(**WIDE)
        for k, sample in enumerate(samples):
            fmu.set({name: value for name, value in sample.items() if name in used})
            fmu.step(k * 1e-3, 1e-3)
            assert fmu.get(*names) == [expected[k][name] for name in names]
