"""Set-valued friction in every master and as one FMU, against closed forms: rest, break-away and the slips after it.

The cases are benchmarks with known answers. A run may be late by two steps for each change between rest and motion
so far; apart from that, it has the values of the reference, but for the force in some steps after a stop.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from math import atan, exp, pi, sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from accuracy.event_driven import Band, Contact, Phase, Pulled, two_in_series
from thorough import nightly, some

from friction_fmus import build, fmu
from harness import FmuPart, HarnessError, Result, SeriesPart, System, Wire

PULLED = {"mass.m": 1.0, "mass.k": 2.0, "mass.v_support": 0.1, "mass.F_drive": 0.0}
BELT = {"mass.m": 1.0, "mass.k": 1.0, "mass.v_belt": 0.2, "mass.v0": 0.2}
FREE = {"mass.m": 1.0, "mass.k": 4.0, "mass.x0": 1.0, "mass.F_drive": 0.0}
STATIC = {"Stiction": "Fs", "Karnopp": "Fs", "DeadZoneTorque": "T_dz", "Stribeck": "Fs", "Tustin": "Fs"}
SHARP = 1e-5  # m/s, of a Stribeck curve
RINGS = 8  # steps


def levels(name: str, Fc: float, Fs: float) -> dict[str, float]:
    """The parameters of a model with these levels of friction, without a band around v = 0 and viscous friction."""
    if name == "Coulomb":
        return {"Fc": Fc}
    more = {"Karnopp": {"DV": 0.0}, "DeadZoneTorque": {"DV": 0.0}, "Stribeck": {"vs": SHARP}, "Tustin": {"vs": SHARP}}
    return {"Fc": Fc, STATIC[name]: Fs, "Fv": 0.0, **more.get(name, {})}


def contact(name: str, Fc: float, Fs: float) -> Contact:
    """The same in the reference."""
    if Fc == Fs or name not in ("Stribeck", "Tustin"):
        return Contact(Fc, Fs)
    power = 2 if name == "Stribeck" else 1
    return Contact(Fc, Fs, curve=lambda v: Fc + (Fs - Fc) * exp(-((v / SHARP) ** power)))


LEINE = {"Fc": 0.0, "Fs": 1.0, "Fv": 0.0, "shape": 1.0, "delta": 1.0, "vs": 1.0 / 3.0}
Case = tuple[str, str]
CASES: Mapping[str, Sequence[str]] = {
    "pulled": ("Stiction", "Karnopp", "DeadZoneTorque", "Stribeck", "Tustin"),
    "belt": ("Stiction", "Karnopp", "DeadZoneTorque"),
    "leine": ("Stribeck",),
    "free": ("Coulomb", "Stiction", "Karnopp", "DeadZoneTorque", "Stribeck", "Tustin"),
}
STOPS = {"pulled": 24.0, "belt": 24.0, "leine": 36.0, "free": 14.0}


@cache
def reference(kind: str, name: str) -> tuple[np.ndarray, Mapping[str, np.ndarray]]:
    """Return a fine grid and the motion on it."""
    t = np.linspace(0.0, STOPS[kind], 200_001)
    if kind == "pulled":
        return t, Pulled(contact(name, 1.0, 1.5), 1.0, 2.0, phases=[Phase(0.0, support=0.1)]).run(t)
    if kind == "belt":
        return t, Pulled(contact(name, 0.6, 1.0), 1.0, 1.0, v0=0.2, belt=0.2).run(t)
    if kind == "leine":
        leine = Contact(0.0, 1.0, curve=lambda v: 1.0 / (1.0 + 3.0 * v))
        return t, Pulled(leine, 1.0, 1.0, v0=0.2, belt=0.2).run(t)
    return t, Pulled(contact(name, 0.3, 0.3), 1.0, 4.0, x0=1.0).run(t)


def coupled(kind: str, name: str, source: Any = fmu, through_sum: bool = False) -> System:
    """The mass and its friction."""
    belt = kind in ("belt", "leine")
    parts = [FmuPart("mass", source("Belt" if belt else "Mass")), FmuPart("friction", source(name))]
    wires = [f"mass.{'v_rel' if belt else 'v'} -> friction.v", "friction.F -> mass.F_friction"]
    if through_sum:
        parts.append(FmuPart("sum", source("Sum")))
        wires += ["mass.F_ext -> sum.u1", "sum.y -> friction.F_ext"]
    else:
        wires.append("mass.F_ext -> friction.F_ext")
    Fc, Fs = {"pulled": (1.0, 1.5), "belt": (0.6, 1.0), "free": (0.3, 0.3), "leine": (0.0, 1.0)}[kind]
    contact = LEINE if kind == "leine" else levels(name, Fc, Fs)
    start = {"pulled": PULLED, "belt": BELT, "leine": BELT, "free": FREE}[kind]
    return System(parts, wires, {**start, **{f"friction.{key}": value for key, value in contact.items()}})


class Warnings(logging.Handler):
    """What the harness warns of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())

    def __enter__(self) -> Warnings:
        logging.getLogger("harness").addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger("harness").removeHandler(self)


def misses(kind: str, name: str, result: Result, step: float, prefix: str = "") -> dict[str, float]:
    """Return for each variable how far it is off over its range, but for F in the eight steps after a stop."""
    fine, right = reference(kind, name)
    t = result["time"].to_numpy()
    late = 2.0 * step * (1.0 + np.searchsorted(right["changes"], t))
    found = {}
    for variable, part in (("x", "mass"), ("v", "mass"), ("F", "friction")):
        y = result[f"{prefix}{part}.{variable}"].to_numpy()
        off = Band(fine, right[variable]).outside(t, y, late) / np.ptp(right[variable])
        for stop in np.setdiff1d(right["changes"], right["away"]) if variable == "F" else ():
            reach = late[min(np.searchsorted(t, stop), len(t) - 1)]
            off[(t >= stop - reach) & (t <= stop + reach + RINGS * step)] = 0.0
        found[variable] = float(off.max())
    return found


NAMES = ["mass.x", "mass.v", "friction.F"]
BLOCKS = [(kind, name) for kind, names in CASES.items() for name in names]


@pytest.mark.parametrize(("kind", "name"), some(BLOCKS, BLOCKS[::3]))
@pytest.mark.parametrize(
    ("master", "step"),
    some(
        [(master, step) for master in ("newton", "adaptive") for step in (1e-2, 1e-3, 1e-4)],
        [("newton", 1e-2), ("adaptive", 1e-2)],
    ),
)
def test_implicit_masters(master: str, kind: str, name: str, step: float) -> None:
    with coupled(kind, name) as system, Warnings() as warned:
        result = system.run(stop=STOPS[kind], step=step, master=master, record=NAMES)
    assert misses(kind, name, result, step) == pytest.approx({"x": 0.0, "v": 0.0, "F": 0.0}, abs=max(2e-3, 0.3 * step))
    assert not warned.texts


def test_errors_of_the_first_motion_are_not_measured_by_none() -> None:
    """A mass that rests on the belt for 5 s: in the first 1e-9 s after it breaks away its velocity is 1e-10 m/s."""
    test_implicit_masters("newton", "belt", "Stiction", 1e-3)


@pytest.mark.parametrize("step", some([1e-2, 1e-3, 1e-4], [1e-2]))
@pytest.mark.parametrize(("kind", "name"), some(BLOCKS, BLOCKS[::3]))
@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_an_explicit_master_is_right_or_warns(master: str, kind: str, name: str, step: float) -> None:
    """It finds rest at the first instant only: a mass that stops in a step jumps about v = 0."""
    result = None
    with coupled(kind, name) as system, Warnings() as warned, suppress(HarnessError):
        result = system.run(stop=STOPS[kind], step=step, master=master, record=NAMES)
    assert result is None or warned.texts or max(misses(kind, name, result, step).values()) < 0.02


@nightly
@pytest.mark.parametrize(
    ("kind", "name", "fmi"),
    some([(*block, fmi) for block in BLOCKS for fmi in (2, 3)], [("belt", "Karnopp", 3)]),
)
def test_one_fmu(kind: str, name: str, fmi: Literal[2, 3], tmp_path: Path) -> None:
    """Also with communication steps that do not divide the inner step."""
    path = tmp_path / "Pair.fmu"
    with coupled(kind, name) as system:
        system.to_fmu(path, step=1e-2, fmi=fmi, inputs=[])
    with System([FmuPart("pair", path)]) as system:
        for step in (1e-2, 0.79e-2, 3.7e-2):
            stop = step * int(STOPS[kind] / step)
            with Warnings() as warned:
                result = system.run(stop=stop, step=step, record=[f"pair.{n}" for n in NAMES])
            assert not warned.texts
            found = misses(kind, name, result, max(step, 1e-2), "pair.")
            assert found == pytest.approx({"x": 0.0, "v": 0.0, "F": 0.0}, abs=3e-3)


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("form", some(["rotational", "FMI 3.0", "through a sum"], ["through a sum"]))
def test_other_forms(form: str, master: str, tmp_path: Path) -> None:
    def source(name: str) -> Path:
        if form == "FMI 3.0":
            return build(name, tmp_path, fmi=3)
        return fmu(name, domain="rotational" if form == "rotational" else "translational")

    with coupled("pulled", "Stiction", source, form == "through a sum") as system, Warnings() as warned:
        result = system.run(stop=24.0, step=1e-2, master=master, record=NAMES)
    assert misses("pulled", "Stiction", result, 1e-2) == pytest.approx({"x": 0.0, "v": 0.0, "F": 0.0}, abs=3e-3)
    assert not warned.texts


def side_by_side(wiring: str, models: Sequence[str]) -> System:
    """A mass on contacts whose friction is 1 N and 1.5 N at rest together, added by a sum."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Sum"))]
    wires: list[str | Wire] = ["friction.y -> mass.F_friction"]
    start = dict(PULLED)
    levels_of = {1: ((1.0, 1.5),), 2: ((0.6, 0.7), (0.4, 0.8)), 3: ((0.5, 0.7), (0.3, 0.6), (0.2, 0.2))}[len(models)]
    for i, (model, (Fc, Fs)) in enumerate(zip(models, levels_of, strict=True), 1):
        arm = -2.0 if wiring == "lever" and i == 2 else 1.0
        parts.append(FmuPart(f"c{i}", fmu(model)))
        wires += [Wire("mass.v", f"c{i}.v", gain=arm), f"c{i}.F -> friction.u{i}"]
        start[f"friction.gain[{i}]"] = arm
        start |= {f"c{i}.{key}": value for key, value in levels(model, Fc / abs(arm), Fs / abs(arm)).items()}
        if wiring == "others":  # each reads the sum of the other forces, friction of its neighbours included
            parts.append(FmuPart(f"s{i}", fmu("Sum")))
            wires += [f"mass.F_ext -> s{i}.u1", f"s{i}.y -> c{i}.F_ext"]
            for place, j in enumerate((j for j in range(1, len(models) + 1) if j != i), 2):
                wires.append(f"c{j}.F -> s{i}.u{place}")
                start[f"s{i}.gain[{place}]"] = -1.0
        else:
            wires.append(Wire("mass.F_ext", f"c{i}.F_ext", gain=1.0 if wiring == "whole" else Fs / 1.5 / arm))
    return System(parts, wires, start)


SIDE_BY_SIDE = [
    ("shares", ("Stiction",)),
    ("others", ("Stiction", "Karnopp")),
    ("lever", ("Stiction", "DeadZoneTorque")),
    ("shares", ("DeadZoneTorque", "Stiction")),
    ("whole", ("Stribeck", "Tustin")),
    ("whole", ("Stiction", "Karnopp", "Coulomb")),
]


@pytest.mark.parametrize(("wiring", "models"), some(SIDE_BY_SIDE, SIDE_BY_SIDE[:3]))
@pytest.mark.parametrize(
    ("master", "step"),
    some([(master, step) for master in ("newton", "adaptive") for step in (1e-2, 1e-3)], [("newton", 1e-2)]),
)
def test_contacts_side_by_side(master: str, step: float, wiring: str, models: Sequence[str]) -> None:
    """The mass moves as on one contact with the sum of the friction, however it is divided at rest."""
    names = ["mass.x", "mass.v", "friction.y"]
    with side_by_side(wiring, models) as system, Warnings() as warned:
        result = system.run(stop=24.0, step=step, master=master, record=names)
    found = misses("pulled", "Stiction", result.rename({"friction.y": "friction.F"}), step)
    assert found == pytest.approx({"x": 0.0, "v": 0.0, "F": 0.0}, abs=max(2e-3, 0.3 * step))
    assert not warned.texts


def test_contacts_side_by_side_in_one_fmu(tmp_path: Path) -> None:
    path = tmp_path / "Two.fmu"
    with side_by_side("others", ("Stiction", "Karnopp")) as system:
        system.to_fmu(path, step=1e-2, inputs=[])
    with System([FmuPart("two", path)]) as system, Warnings() as warned:
        result = system.run(stop=24.0, step=1e-2, record=["two.mass.x", "two.mass.v", "two.friction.y"])
    found = misses("pulled", "Stiction", result.rename({"two.friction.y": "two.friction.F"}), 1e-2, "two.")
    assert found == pytest.approx({"x": 0.0, "v": 0.0, "F": 0.0}, abs=3e-3)
    assert not warned.texts


@nightly
@pytest.mark.parametrize(
    ("master", "step"),
    some(
        [(master, step) for master in ("newton", "adaptive") for step in (1e-2, 1e-3)],
        [("newton", 1e-2)],
    ),
)
def test_two_contacts_in_series(master: str, step: float) -> None:
    """A motor and a load on a spring, each on its own contact, under a force that swings slowly."""
    grid = np.array([0.0, 2.0, 6.0, 10.0, 12.0])
    force = np.array([0.0, 5.0, -5.0, 5.0, 0.0])
    m, k, d = (1.0, 0.7), 20.0, 1.5
    parts = [FmuPart("axis", fmu("TwoMass")), SeriesPart("drive", grid, {"F": force})]
    parts += [FmuPart("front", fmu("Stiction")), FmuPart("back", fmu("Karnopp"))]
    wires: list[str | Wire] = ["drive.F -> axis.F_drive"]
    for one, i in (("front", 1), ("back", 2)):
        wires += [f"axis.v{i} -> {one}.v", f"{one}.F -> axis.F_friction{i}", f"axis.F_ext{i} -> {one}.F_ext"]
    start = {"axis.m1": m[0], "axis.m2": m[1], "axis.k": k, "axis.d": d, "back.DV": 0.0, "back.Fs": 2.0}
    names = ["axis.x1", "axis.v1", "axis.x2", "axis.v2"]
    with System(parts, wires, start) as system, Warnings() as warned:
        result = system.run(stop=12.0, step=step, master=master, record=names)
    fine = np.linspace(0.0, 12.0, 120_001)
    contacts = [Contact(1.0, 1.5, 0.4), Contact(1.0, 2.0, 0.4)]
    right = two_in_series(contacts, m, k, d, lambda t: np.interp(t, grid, force), fine)
    t = result["time"].to_numpy()
    for name in names:
        expected = right[name.partition(".")[2]]
        off = Band(fine, expected).outside(t, result[name].to_numpy(), 5.0 * step)
        assert off.max() < 2e-3 * np.ptp(expected), name
    assert not warned.texts


def test_a_stop_does_not_shorten_the_steps_that_follow() -> None:
    """Two contacts behind a gear and one load that swings: the mass comes to rest at 15.8 ms, where SciPy says, found
    from event to event. Steps of 4 ns, to which the stop was located, then took 24 000 of them for one."""
    gear = 0.25
    parts = {"mass": "Mass", "c1": "Stiction", "c2": "Stribeck", "friction": "Sum", "drive": "Sine", "force": "Sum"}
    wires: list[str | Wire] = ["drive.r -> force.u1", "force.y -> mass.F_drive", "friction.y -> mass.F_friction"]
    start = {"mass.m": 0.01762, "c1.Fc": 0.2198, "c1.Fs": 0.3177, "c1.Fv": 0.0, "friction.gain[2]": gear}
    start |= {"c2.Fc": 0.8739, "c2.Fs": 0.988, "c2.Fv": 0.731, "c2.vs": 0.0214}
    start |= {"drive.amplitude[1]": 0.4719, "drive.frequency[1]": 101.2}
    start |= {"drive.amplitude[2]": 0.5507, "drive.frequency[2]": 253.0}
    for one, other, arm, back in (("c1", "c2", 1.0, gear), ("c2", "c1", gear, 1.0)):
        wires += [
            Wire("mass.v", f"{one}.v", gain=arm),
            f"{one}.F -> friction.u{one[1]}",
            f"rest_{one}.y -> {one}.F_ext",
        ]
        wires += [f"mass.F_ext -> rest_{one}.u1", f"{other}.F -> rest_{one}.u2"]
        start |= {f"rest_{one}.gain[1]": 1.0 / arm, f"rest_{one}.gain[2]": -back / arm}
        parts[f"rest_{one}"] = "Sum"
    with System(parts, wires, start) as system, Warnings() as warned:
        result = system.run(stop=0.0175, step=1e-4, master="newton", record=["mass.x", "mass.v"])
    assert result["mass.v"].to_numpy()[-15:] == pytest.approx(0.0, abs=0.0)
    assert result["mass.x"].to_numpy()[-15:] == pytest.approx(2.7295e-5, abs=0.01 * 5.8585e-5)
    assert result.attrs["substeps"] < 20_000
    assert not warned.texts


@pytest.mark.parametrize("model", ["Stiction", "Karnopp"])
@pytest.mark.parametrize(("master", "step"), [("newton", 1e-2), ("newton", 1e-3), ("adaptive", 1e-2)])
def test_a_contact_between_two_masses(master: str, step: float, model: str) -> None:
    """A rising force pulls the upper mass. The sum of forces that the contact reads contains its own force twice, once
    by way of the lower mass, so that it cancels. In closed form: both masses move together until they need Fs."""
    rate, Fc, Fs, stop = 9.7, 1.0, 1.5, 0.6  # N/s, N, N, s
    upper, lower = 1.0, 3.0
    whole = upper + lower
    parts = [FmuPart(name, fmu("Mass")) for name in ("upper", "lower")]
    parts += [FmuPart("friction", fmu(model)), FmuPart("slip", fmu("Sum")), FmuPart("load", fmu("Sum"))]
    parts.append(SeriesPart("drive", [0.0, stop], {"F": [0.0, rate * stop]}, {"F": "N"}))
    wires = ["upper.v -> slip.u1", "lower.v -> slip.u2", "slip.y -> friction.v", "drive.F -> upper.F_drive"]
    wires += ["friction.F -> upper.F_friction", "friction.F -> lower.F_load", "load.y -> friction.F_ext"]
    wires += ["upper.F_ext -> load.u1", "lower.F_ext -> load.u2", "friction.F -> load.u3"]
    gains = {"slip.gain[2]": -1.0, "load.gain[1]": lower / whole}
    gains |= {"load.gain[2]": -upper / whole, "load.gain[3]": upper / whole}
    start = {"upper.m": upper, "lower.m": lower, "lower.F_drive": 0.0, "lower.F_friction": 0.0, **gains}
    start |= {f"friction.{name}": value for name, value in levels(model, Fc, Fs).items()}
    with System(parts, wires, start) as system, Warnings() as warned:
        result = system.run(stop=stop, step=step, master=master, record=["upper.v", "lower.v"])
    t = result["time"].to_numpy()
    away = Fs * whole / (lower * rate)
    late = np.maximum(t - away, 0.0)
    together = rate * np.minimum(t, away) ** 2 / (2.0 * whole)
    fast = together + (rate * (t**2 - np.minimum(t, away) ** 2) / 2.0 - Fc * late) / upper
    assert result["upper.v"].to_numpy() == pytest.approx(fast, abs=1e-3 * fast[-1])
    assert result["lower.v"].to_numpy() == pytest.approx(together + Fc * late / lower, abs=1e-3 * fast[-1])
    assert not warned.texts


@pytest.mark.parametrize("master", some(["gauss-seidel", "jacobi", "newton", "adaptive"], ["jacobi", "newton"]))
@pytest.mark.parametrize(
    ("n", "forces"), [(0.5, (0.75, 1.0)), (1.0, (0.632120559, 0.950212932)), (3.0, (0.42264973, 0.62203553))]
)
def test_a_dahl_contact_under_a_heavy_mass(n: float, forces: Sequence[float], master: str) -> None:
    """Friction cannot slow down 1e9 kg: F after 10 and 30 um as in the closed form."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Dahl"))]
    start = {"mass.m": 1e9, "mass.v0": 1e-3, "mass.F_drive": 0.0, "friction.sigma": 1e5, "friction.Fc": 1.0}
    with System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], {**start, "friction.n": n}) as system:
        for step in (1e-2, 1e-3, 1e-4):
            result = system.run(stop=0.03, step=step, master=master, record=["friction.F"])
            F = result["friction.F"].to_numpy()
            assert F[[round(0.01 / step), round(0.03 / step)]] == pytest.approx(forces, abs=2e-8)


@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_a_slip_within_one_step(master: str) -> None:
    """A load beyond static friction that is balanced again at the end of the step: the mass is at rest there only."""
    grid, force = np.array([0.0, 0.4048, 0.5711]), np.array([0.0, -0.1188, -0.5961])
    m, k, d, speed = 6.267e-6, 10.72, 0.002588, 0.02904
    start = {"mass.m": m, "mass.k": k, "mass.d": d, "mass.v_support": speed}
    start |= {"friction.Fc": 0.2504, "friction.Fs": 0.2973, "friction.DV": 0.0}
    drive = SeriesPart("drive", grid, {"F": force}, {"F": "N"}, interpolation="previous", beyond="hold")
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Karnopp")), drive]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    with System(parts, [*wires, "drive.F -> mass.F_drive"], {**start, "friction.Fv": 0.0}) as system:
        result = system.run(stop=0.8, step=1e-2, master=master, record=["mass.x"])
    t = np.linspace(0.0, 0.8, 80_001)
    phases = [Phase(begin, F, speed) for begin, F in zip(grid, force, strict=True)]
    right = Pulled(Contact(0.2504, 0.2973), m, k, d, phases=phases).run(t)["x"][-1]
    assert result["mass.x"].to_numpy()[-1] == pytest.approx(right, rel=0.05)


def sliding() -> System:
    """A mass on Stiction, which comes to rest."""
    parts, wires = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Stiction"))], ["mass.v -> friction.v"]
    wires += ["friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    return System(parts, wires, {"mass.F_drive": 0.0, "friction.Fv": 0.0})


@pytest.fixture(scope="module")
def sliding_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sliding") / "One.fmu"
    with sliding() as system:
        system.to_fmu(path, step=5e-3, inputs=[])
    return path


@pytest.mark.parametrize("master", ["newton", "adaptive", "composite"])
@pytest.mark.parametrize(("m", "v0", "ticks"), [(1.0, 0.0437, 8.74), (1e-3, 0.5, 0.1)])
def test_a_mass_stops_between_two_steps(
    m: float, v0: float, ticks: float, master: str, request: pytest.FixtureRequest
) -> None:
    """It slides m v0^2/(2 Fc), also if it stops within the first step."""
    step, Fc = 5e-3, m * v0 / (5e-3 * ticks)
    start = {"mass.m": m, "mass.v0": v0, "friction.Fc": Fc, "friction.Fs": 1.5 * Fc}
    names = ["mass.x", "mass.v"]
    with Warnings() as warned:
        if master != "composite":
            with sliding() as system:
                system.start |= start
                result = system.run(stop=20 * step, step=step, master=master, record=names)
        else:
            part = FmuPart("one", request.getfixturevalue("sliding_fmu"))
            with System([part], start={f"one.{name}": value for name, value in start.items()}) as system:
                result = system.run(stop=20 * step, step=step, record=[f"one.{name}" for name in names])
    x, v = (result[name].to_numpy() for name in result.data_vars)
    assert x[-1] == pytest.approx(0.5 * m * v0**2 / Fc, rel=1e-4)
    assert v[-1] == 0.0
    assert not warned.texts


def test_slips_faster_than_the_step() -> None:
    """A light mass slips within six steps and stops where the closed form says, so that later slips are in time."""
    m, k, speed, loads = 1.541e-4, 75.12, 3.545, [Phase(0.0, 0.0, 3.545), Phase(0.066, 2.0674, 3.545)]
    drive = SeriesPart("drive", [0.0, 0.066], {"F": [0.0, 2.0674]}, {"F": "N"}, interpolation="previous", beyond="hold")
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Stiction")), drive]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.m": m, "mass.k": k, "mass.v_support": speed, "friction.Fc": 5.75, "friction.Fs": 8.779}
    with System(parts, [*wires, "drive.F -> mass.F_drive"], {**start, "friction.Fv": 0.0}) as system:
        result = system.run(stop=0.16, step=1e-3, master="newton", record=["mass.x"])
    t = result["time"].to_numpy()
    fine = np.linspace(0.0, 0.16, 160_001)
    right = Pulled(Contact(5.75, 8.779), m, k, phases=loads).run(fine)["x"]
    off = Band(fine, right).outside(t, result["mass.x"].to_numpy(), 1e-4)
    assert off.max() < 5e-3 * np.ptp(right)


def test_the_reference_has_the_known_answers() -> None:
    """Benchmarks B10 to B13."""
    V, drop, w = 0.1, 0.5, sqrt(2.0)
    _, pulled = reference("pulled", "Stiction")
    assert pulled["away"][0] == pytest.approx(7.5, abs=1e-9)
    period = 2 * drop / (2 * V) + (2 * pi - 2 * atan(drop * w / (2 * V))) / w
    assert np.diff(pulled["away"]) == pytest.approx(period, rel=1e-12)
    V, drop = 0.2, 0.4
    _, belt = reference("belt", "Stiction")
    assert np.diff(belt["away"]) == pytest.approx(2 * drop / V + 2 * pi - 2 * atan(drop / V), rel=1e-12)
    assert np.diff(belt["away"]) == pytest.approx(8.068887872, abs=1e-9)
    _, leine = reference("leine", "Stribeck")
    assert np.diff(leine["away"]) == pytest.approx(12.0010313, abs=1e-7)
    assert leine["v"].min() == pytest.approx(-0.8399020, abs=1e-7)
    assert leine["x"].max() == pytest.approx(1.1339447, abs=1e-7)
    t, free = reference("free", "Coulomb")
    assert np.interp(pi, t, free["x"]) == pytest.approx(0.7, abs=1e-6)
    assert free["x"][-1] == pytest.approx(0.05, abs=1e-12)
    assert free["changes"][-1] == pytest.approx(7 * pi / 2, abs=1e-9)


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("name", ["Coulomb", "Stiction"])
def test_a_mass_that_rests_from_the_start(name: str, master: str) -> None:
    """The spring force k v t is held from the first step on, also where the mass would swing within the step."""
    start = {"mass.m": 6.7e-4, "mass.k": 1.2e5, "mass.v_support": 3e-3, "mass.F_drive": 0.0, "friction.Fc": 4.0}
    start |= {} if name == "Coulomb" else {"friction.Fs": 5.0}
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    with System([FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu(name))], wires, start) as system:
        result = system.run(stop=0.01, step=1e-4, master=master, record=NAMES)
    assert result["mass.x"].to_numpy() == pytest.approx(0.0, abs=1e-15)
    assert result["friction.F"].to_numpy() == pytest.approx(360.0 * result["time"].to_numpy(), rel=1e-9)


def test_a_mass_held_in_a_dead_band() -> None:
    """Its velocity is a rounding error, whose error does not matter."""
    start = {"mass.m": 1.0, "mass.F_drive": 0.7, "friction.Fc": 1.0, "friction.Fs": 1.5}
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    system = System([FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Karnopp"))], wires, start)
    with system, Warnings() as warned:
        result = system.run(stop=5e-3, step=1e-3, master="newton", record=NAMES)
    assert not warned.texts
    assert result.attrs["substeps"] == 5
    assert result["friction.F"].to_numpy() == pytest.approx(0.7, rel=1e-12)
