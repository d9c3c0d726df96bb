"""The implicit masters with a mass on every friction model, from rest through break-away."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from thorough import some

from friction_fmus.blocks.catalogue import catalogue
from harness import FmuPart, Result, SeriesPart, System, Wire

BuildFmu = Callable[..., Path]
LOADED = ("KarnoppMass", "SwitchMass", "FrenkelKontorova")  # have no velocity input
RIGID = ("Coulomb", "Stiction", "Stribeck", "Tustin", "Karnopp", "DeadZoneTorque")
FRICTION = [block.name for block in catalogue().values() if block.kind == "friction" and block.name not in LOADED]


def pulled(build_fmu: BuildFmu, name: str, stop: float = 1.5, **settings: object) -> Result:
    """A mass of 1 kg, pulled over a contact by a spring of 20 N/m whose end moves at 0.1 m/s."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu(name))]
    start = {"mass.k": 20.0, "mass.v_support": 0.1, "mass.F_drive": 0.0}
    inputs = {port.name for port in parts[1].inputs}
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    if "F_ext" in inputs:
        wires.append("mass.F_ext -> friction.F_ext")
    with System(parts, wires, start) as system:
        return system.run(stop=stop, record=["mass.x", "mass.v"], **settings)


@pytest.mark.parametrize("name", some([name for name in FRICTION if name not in RIGID], ["LuGre", "GMS"]))
@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_models_with_a_state_move_as_with_tiny_explicit_steps(build_fmu: BuildFmu, name: str, master: str) -> None:
    """Gauss-Seidel at 20 us is near what all converge to; less so with asperities, whose tips are faster still."""
    # adaptive follows every tip of the asperities
    stop = 0.3 if (name, master) == ("GenericAsperity", "adaptive") else 1.5
    fine = pulled(build_fmu, name, stop=stop, step=2e-5, master="gauss-seidel", decimate=50)
    result = pulled(build_fmu, name, stop=stop, step=1e-3, master=master)
    size = float(np.abs(fine["mass.x"]).max())
    np.testing.assert_allclose(
        result["mass.x"], fine["mass.x"], atol=(2e-2 if name == "GenericAsperity" else 5e-3) * size
    )


@pytest.mark.parametrize("name", RIGID)
@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_rigid_models_stick_and_break_away(build_fmu: BuildFmu, name: str, master: str, step: float) -> None:
    """At rest up to the static friction, 1 N at least and reached at 0.5 s; then in motion."""
    result = pulled(build_fmu, name, step=step, master=master)
    time = result["time"].values
    assert np.abs(result["mass.x"].values[time < 0.49]).max() < 1e-5
    assert result["mass.x"].values[-1] > 0.01
    assert result["mass.v"].values.max() < 1.0


LOOPS = {
    "a": ("Stiction", {"k": 20.0, "v_support": 0.1}),
    "b": ("LuGre", {"k": 50.0, "v_support": 0.2}),
    "c": ("Stiction", {"k": 35.0, "v_support": -0.2, "m": 0.7}),
}


@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_loops_beside_each_other_move_as_each_alone(build_fmu: BuildFmu, master: str) -> None:
    def run(*names: str) -> Result:
        parts, wires, start = [], [], {}
        for i in names:
            friction, values = LOOPS[i]
            parts += [FmuPart(f"mass_{i}", build_fmu("Mass")), FmuPart(f"friction_{i}", build_fmu(friction))]
            wires += [f"mass_{i}.v -> friction_{i}.v", f"friction_{i}.F -> mass_{i}.F_friction"]
            wires += [f"mass_{i}.F_ext -> friction_{i}.F_ext"] if friction == "Stiction" else []
            start |= {f"mass_{i}.{name}": value for name, value in {"F_drive": 0.0, **values}.items()}
        with System(parts, wires, start) as system:
            return system.run(stop=1.0, step=2e-3, master=master, record=["*"])

    together = run(*LOOPS)
    for i in LOOPS:
        alone = run(i)
        assert len(alone.data_vars) >= 3
        assert [name for name in alone.data_vars if not np.array_equal(alone[name], together[name])] == []
    assert together["mass_a.v"].values[-1] != 0.0


@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_a_force_that_jumps_at_samples_moves_a_sliding_mass_exactly(build_fmu: BuildFmu, master: str) -> None:
    """1 kg on Coulomb friction of 1 N, driven by a force held for 10 ms; it moves with piecewise constant acceleration.

    It sticks at 0.5 N and -0.9 N, accelerates by 0.5 m/s2 at 1.5 N, stops in 10 ms at 0 N, and accelerates by -1 m/s2
    at -2 N. Friction opposes the motion, or balances the force as soon as that has jumped.
    """
    force = np.array([0.5, -0.9, 1.5, 1.5, 0.0, 0.8, -2.0, -0.9, -2.0, -2.0])
    acceleration = np.array([0.0, 0.0, 0.5, 0.5, -1.0, 0.0, -1.0, 0.1, -1.0, -1.0])
    friction = np.array([0.5, -0.9, 1.0, 1.0, 1.0, 0.8, -1.0, -1.0, -1.0, -1.0])
    T, n = 0.01, 10
    drive = SeriesPart("drive", T * np.arange(10.0), {"F": force}, {"F": "N"}, interpolation="previous", beyond="hold")
    parts = [drive, FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Coulomb"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    record = ["mass.x", "mass.v", "friction.F"]
    with System(parts, [Wire("drive.F", "mass.F_drive"), *wires], {"friction.Fc": 1.0}) as system:
        result = system.run(stop=10 * T, step=T / n, master=master, record=record)
    v = np.concatenate([[0.0], np.cumsum(T * acceleration)])
    x = np.concatenate([[0.0], np.cumsum(T * v[:-1] + 0.5 * T**2 * acceleration)])
    np.testing.assert_allclose(result["mass.v"].values[::n], v, atol=1e-7)
    np.testing.assert_allclose(result["mass.x"].values[::n], x, atol=1e-8)
    for sample in range(10):
        inside = result["friction.F"].values[sample * n + 1 : (sample + 1) * n]
        atol = 0.02 if sample == 5 else 1e-6  # after the stop, the friction rings about its mean
        np.testing.assert_allclose(inside, friction[sample], atol=atol, err_msg=f"sample {sample}")
    assert result.attrs["unresolved_error"] < 1e-3


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize(("Fn", "Fc"), [(1.0, 1.0), (2.0, 1.0), (1.0, 0.8)])
def test_a_mass_stops_whatever_its_normal_force(build_fmu: BuildFmu, master: str, Fn: float, Fc: float) -> None:
    """x = v0^2 m/(2 Fc Fn/Fn0): the normal force, which may be as large as friction, is not the load at rest."""
    normal = SeriesPart("normal", [0.0, 1.0], {"Fn": [Fn, Fn]}, {"Fn": "N"})
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Coulomb")), normal]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.F_drive": 0.0, "mass.v0": 0.2, "mass.m": 1.0, "friction.Fc": Fc}
    with System(parts, [*wires, "normal.Fn -> friction.Fn"], start) as system:
        result = system.run(stop=1.0, step=0.125, master=master, record=["mass.x"])
    assert float(result["mass.x"][-1]) == pytest.approx(0.02 / (Fc * Fn), rel=1e-9)


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("name", some(["Coulomb", "Stiction"], ["Coulomb"]))
@pytest.mark.parametrize("step", [0.1, 2.0])
@pytest.mark.parametrize("drive", [-0.9, -0.5, 0.5])
def test_a_mass_under_a_constant_force_stops_in_closed_form(
    build_fmu: BuildFmu, master: str, name: str, step: float, drive: float
) -> None:
    """Friction of 1 N and the force stop 1 kg within a step; then friction, which is larger, holds it for good."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu(name))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    for v0 in (0.31, 0.62):
        start = {"mass.v0": v0, "mass.F_drive": drive} | ({"friction.Fv": 0.0} if name == "Stiction" else {})
        with System(parts, wires, start) as system:
            result = system.run(stop=2.0, step=step, master=master, record=["mass.x", "mass.v", "friction.F"])
        assert result["mass.x"].values[-1] == pytest.approx(v0**2 / (2.0 * (1.0 - drive)), rel=1e-12)
        assert result["mass.v"].values[-1] == 0.0
        assert result["friction.F"].values[-1] == pytest.approx(drive, rel=1e-12)


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("name", some(["Coulomb", "Stiction"], ["Stiction"]))
@pytest.mark.parametrize("wiring", ["mass", "drive", "sum", "sum without it"])
@pytest.mark.parametrize(("v0", "step"), some([(0.0, 1e-3), (0.0, 1e-2), (0.31, 1e-3)], [(0.0, 1e-2), (0.31, 1e-3)]))
def test_static_friction_breaks_away_at_its_force_however_it_is_connected(
    build_fmu: BuildFmu, caplog: pytest.LogCaptureFixture, master: str, name: str, wiring: str, v0: float, step: float
) -> None:
    """A force of 0.5 N/s stops 1 kg later than friction alone and, when it exceeds static friction, moves it again.

    F_ext comes from the mass or directly from the drive; the drive may act on the mass beside its friction, by a sum,
    where the mass does not know that it is a load, which is said.
    """
    a, Fc, Fs = 0.5, 1.0, 1.5 if name == "Stiction" else 1.0
    drive = SeriesPart("drive", [0.0, 10.0], {"F": [0.0, 10.0 * a]}, {"F": "N"})
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu(name)), drive]
    start = {"mass.v0": v0} | ({"friction.Fv": 0.0} if name == "Stiction" else {})
    wires = ["mass.v -> friction.v", f"{'drive.F' if wiring in ('drive', 'sum') else 'mass.F_ext'} -> friction.F_ext"]
    if wiring in ("mass", "drive"):
        wires += ["friction.F -> mass.F_friction", "drive.F -> mass.F_drive"]
    else:
        parts.append(FmuPart("sum", build_fmu("Sum")))
        wires += ["friction.F -> sum.u1", "drive.F -> sum.u2", "sum.y -> mass.F_friction"]
        start |= {"sum.gain[2]": -1.0, "mass.F_drive": 0.0}
    with System(parts, wires, start) as system:
        result = system.run(stop=4.0, step=step, master=master, record=["mass.x", "mass.v"])
    stops = (Fc - math.sqrt(Fc**2 - 2.0 * a * v0)) / a
    rest = v0 * stops + a * stops**3 / 6.0 - Fc * stops**2 / 2.0
    t, begins = result["time"].values, Fs / a
    late = np.maximum(t - begins, 0.0)
    x = rest + a * (begins * late**2 / 2.0 + late**3 / 6.0) - Fc * late**2 / 2.0
    held = (t > stops + step) & (t < begins - step)
    assert (result["mass.v"].values[held] == 0.0).all()
    np.testing.assert_allclose(result["mass.x"].values[t > stops + step], x[t > stops + step], atol=1e-6)
    assert ("friction.F_ext is not the sum of the other forces" in caplog.text) == (wiring == "sum without it")


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("wiring", ["alone", "side by side", "drive", "none"])
@pytest.mark.parametrize("force", [1.5, -1.3])
def test_a_jump_swings_a_light_mass_within_a_step(
    build_fmu: BuildFmu, caplog: pytest.LogCaptureFixture, master: str, wiring: str, force: float
) -> None:
    """0.1 g on 0.1 N/um, held by 1 N, swings by 2 (F - 1 N)/k in 0.1 ms and stays there; the step is 10 ms.

    Two contacts of 0.5 N side by side do the same, and one that reads no load. One whose F_ext lacks the force of the
    spring stays where it stops, but may stop too early, which is said.
    """
    k, drive = (
        1e5,
        SeriesPart("drive", [0.0, 0.05], {"F": [0.0, force]}, {"F": "N"}, interpolation="previous", beyond="hold"),
    )
    names = ("one", "other") if wiring == "side by side" else ("one",)
    parts = [FmuPart("mass", build_fmu("Mass")), drive, *(FmuPart(name, build_fmu("Coulomb")) for name in names)]
    start = {"mass.m": 1e-4, "mass.k": k, "mass.v_support": 0.0} | {f"{name}.Fc": 1.0 / len(names) for name in names}
    wires = ["drive.F -> mass.F_drive", *(f"mass.v -> {name}.v" for name in names)]
    if wiring == "none":
        start["one.F_ext"] = 0.0
    else:
        wires += [f"{'drive.F' if wiring == 'drive' else 'mass.F_ext'} -> {name}.F_ext" for name in names]
    if wiring == "side by side":
        parts.append(FmuPart("sum", build_fmu("Sum")))
        wires += ["one.F -> sum.u1", "other.F -> sum.u2", "sum.y -> mass.F_friction"]
    else:
        wires.append("one.F -> mass.F_friction")
    with System(parts, wires, start) as system:
        result = system.run(stop=0.1, step=0.01, master=master, record=["mass.x", "mass.v"])
    expected = math.copysign(2.0 * (abs(force) - 1.0) / k, force)
    x = result["mass.x"].values[6:]
    np.testing.assert_allclose(x, expected, rtol=0.06 if wiring == "drive" else 2e-5)
    np.testing.assert_allclose(x, x[0], rtol=1e-8)
    assert (result["mass.v"].values[6:] == 0.0).all()
    assert ("one.F_ext is not the sum of the other forces" in caplog.text) == (wiring == "drive")


def test_a_mass_stops_early_in_a_step(build_fmu: BuildFmu) -> None:
    """After 0.1 ms of 50 ms, x = m v0^2/(2 (Fc + 24 N)); Fs holds it under all later loads, but Fc would not."""
    m, v0, Fc = 0.07, 0.05, 8.0
    drive = SeriesPart("drive", [0.0, 0.1], {"F": [-24.0, 18.0]}, {"F": "N"})
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Stribeck")), drive]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.m": m, "mass.k": 0.0, "mass.v0": v0, "friction.Fc": Fc, "friction.Fs": 80.0}
    start |= {"friction.vs": 1e-5, "friction.Fv": 0.0}
    with System(parts, [*wires, "drive.F -> mass.F_drive"], start) as system:
        result = system.run(stop=0.1, step=0.05, master="newton")
    np.testing.assert_allclose(result["mass.x"][1:], 0.5 * m * v0**2 / (Fc + 24.0), rtol=0.01)
    assert (result["mass.v"][1:] == 0.0).all()


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_a_light_mass_stops_between_a_damper_and_friction(build_fmu: BuildFmu, step: float, master: str) -> None:
    """m v' = -d v - Fc: 1 g at 50 mm/s stops after m/d (v0 - Fc/d ln(1 + d v0/Fc)), within some thousandths of a step.

    Friction is small at first, and negligible in what a part of a step shows; without it, the mass moves on by 9 %.
    """
    m, d, v0, Fc = 1e-3, 1e3, 0.05, 1.0
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Coulomb"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.m": m, "mass.k": 0.0, "mass.d": d, "mass.v0": v0, "mass.F_drive": 0.0, "mass.v_support": 0.0}
    with System(parts, wires, {**start, "friction.Fc": Fc}) as system:
        result = system.run(stop=5 * step, step=step, master=master)
    expected = m / d * (v0 - Fc / d * math.log(1.0 + d * v0 / Fc))
    np.testing.assert_allclose(result["mass.x"][1:], expected, rtol=1e-5)
    assert (result["mass.v"][1:] == 0.0).all()
    assert result.attrs["unresolved_error"] < 1e-2


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("Fs", [1.5, 2.0, 10.0, 30.0])
def test_the_distance_to_a_stop_is_that_of_the_stribeck_curve(build_fmu: BuildFmu, Fs: float, master: str) -> None:
    """m v dv = -F dx, so x is the integral of m v/F(v) over v; 1 kg at 10 mm/s stops in the second or first step."""
    vs, v0 = 1e-3, 0.01

    def rate(v: float) -> float:
        return v / (1.0 + (Fs - 1.0) * math.exp(-((v / vs) ** 2)))

    expected, _ = quad(rate, 0.0, v0, points=[vs, 3.0 * vs])
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("Stribeck"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.F_ext -> friction.F_ext"]
    start = {"mass.m": 1.0, "mass.k": 0.0, "mass.v0": v0, "mass.F_drive": 0.0, "friction.Fc": 1.0, "friction.Fs": Fs}
    with System(parts, wires, {**start, "friction.vs": vs, "friction.Fv": 0.0}) as system:
        for step in (5e-3, 5e-2):
            result = system.run(stop=0.1, step=step, master=master)
            assert float(result["mass.x"][-1]) == pytest.approx(expected, rel=2.5e-3)


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("pull", [0.0, 0.5])
def test_contacts_side_by_side_stop_where_their_friction_curves_say(
    build_fmu: BuildFmu, pull: float, master: str
) -> None:
    """As above, where F(v) is the friction of both contacts less a constant pull."""
    vs, v0, Fc, Fs, Fv, other = 1.35e-3, 0.01, 0.6, 3.0, 280.0, 0.5

    def rate(v: float) -> float:
        return v / (Fc + (Fs - Fc) * math.exp(-((v / vs) ** 2)) + Fv * v + other - pull)

    expected, _ = quad(rate, 0.0, v0, points=[vs, 3.0 * vs])
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("sum", build_fmu("Sum"))]
    wires: list[str | Wire] = ["sum.y -> mass.F_friction"]
    start = {"mass.m": 1.0, "mass.k": 0.0, "mass.v0": v0, "mass.F_drive": pull}
    start |= {"c1.Fc": Fc, "c1.Fs": Fs, "c1.vs": vs, "c1.Fv": Fv, "c2.Fc": other}
    for number, model, most in (1, "Stribeck", Fs), (2, "Coulomb", other):
        parts.append(FmuPart(f"c{number}", build_fmu(model)))
        wires += [f"mass.v -> c{number}.v", f"c{number}.F -> sum.u{number}"]
        wires.append(Wire("mass.F_ext", f"c{number}.F_ext", gain=most / (Fs + other)))
    with System(parts, wires, start) as system:
        for step in (5e-3, 5e-2):
            result = system.run(stop=0.2, step=step, master=master)
            assert float(result["mass.x"][-1]) == pytest.approx(expected, rel=2.5e-3)


def test_masses_may_start_anywhere(build_fmu: BuildFmu) -> None:
    """Two of 1 kg at 4 m and 5 m slow down as one at 0, without a warning."""
    for places in ([0.0], [4.0, 5.0]):
        parts, wires, start = [], [], {}
        for i, x0 in enumerate(places):
            parts += [FmuPart(f"m{i}", build_fmu("Mass")), FmuPart(f"f{i}", build_fmu("Coulomb"))]
            wires += [f"m{i}.v -> f{i}.v", f"f{i}.F -> m{i}.F_friction", f"m{i}.F_ext -> f{i}.F_ext"]
            start |= {f"m{i}.F_drive": 0.0, f"m{i}.v0": 0.2, f"m{i}.m": 1.0, f"m{i}.x0": x0}
        with System(parts, wires, start) as system:
            result = system.run(stop=0.1, step=0.01, master="newton")
        np.testing.assert_allclose(result["m0.v"], 0.2 - result["time"], atol=1e-12)
        assert result.attrs["substeps"] == 10 * len(places)
        assert result.attrs["unresolved_error"] < 1e-3


@pytest.mark.parametrize("master", ["newton", "gauss-seidel"])
def test_what_follows_a_line_has_its_end_value(master: str, build_fmu: BuildFmu) -> None:
    """Begin + slope h differs from the end by rounding: most often where the value halves in a step."""
    times = np.arange(0.0, 0.2, 1e-3)
    source = SeriesPart("source", times, {"y": np.cos(700.0 * times) * np.exp(-20.0 * times)})
    system = System([source, FmuPart("sum", build_fmu("Sum"))], ["source.y -> sum.u1"])
    with system:
        result = system.run(stop=0.19, step=1e-3, master=master)
    np.testing.assert_array_equal(result["sum.y"], result["source.y"])


@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_a_motor_that_jumps_moves_nothing_at_rest(build_fmu: BuildFmu, master: str) -> None:
    """Voltages of up to 5 V, 5 N, over 6 N of static friction; the motor brakes, so that it is solved with the mass."""
    t = 5e-3 * np.arange(100)
    voltage = 5.0 * np.sin(40.0 * t)
    series = SeriesPart("log", t, {"U": voltage}, {"U": "V"}, interpolation="previous", beyond="hold")
    parts = [series, *(FmuPart(n, build_fmu(b)) for n, b in (("motor", "DCMotor"), ("m", "Mass"), ("f", "Stiction")))]
    wires = ["log.U -> motor.U", "m.v -> motor.v", "motor.F -> m.F_drive", "m.v -> f.v", "m.F_ext -> f.F_ext"]
    start = {"motor.duty": 1.0, "f.Fc": 4.0, "f.Fs": 6.0}
    with System(parts, [*wires, "f.F -> m.F_friction"], start) as system:
        result = system.run(stop=0.49, step=1e-3, master=master)
    assert np.abs(result["m.x"].values).max() < 1e-20  # 3e-14 where the friction of before a jump acted after it
    # the values at a time that is recorded are those before the jump
    np.testing.assert_allclose(result["f.F"].values[1:], np.repeat(voltage, 5)[:490], rtol=0, atol=1e-12)
    assert result.attrs["substeps"] < 2 * 490
    assert result.attrs["unresolved_error"] == 0.0


@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("angle", [1.0, 3.0])
def test_the_load_of_a_held_motor_oscillates_as_in_closed_form(build_fmu: BuildFmu, master: str, angle: float) -> None:
    """Friction holds the motor, not the load: x2 = x0 cos(w t); `angle`: w times the step."""
    w, x0 = 200.0, 1e-3
    parts = [FmuPart("drive", build_fmu("TwoMass")), FmuPart("friction", build_fmu("Stiction"))]
    wires = ["drive.v1 -> friction.v", "drive.F_ext1 -> friction.F_ext", "friction.F -> drive.F_friction1"]
    start = {"drive.m1": 2.0, "drive.m2": 1.0, "drive.k": w**2, "drive.d": 0.0, "drive.x2_0": x0}
    start |= {"drive.F_drive": 0.0, "drive.F_load": 0.0, "drive.F_friction2": 0.0, "friction.Fc": 50.0}
    with System(parts, wires, {**start, "friction.Fs": 50.0}) as system:
        result = system.run(stop=40 * angle / w, step=angle / w, master=master)
    np.testing.assert_allclose(result["drive.x2"].values, x0 * np.cos(w * result.time.values), atol=1e-3 * x0)
    assert np.abs(result["drive.x1"].values).max() < 1e-4 * x0


@pytest.mark.parametrize("turn", some([*np.arange(44.05, 56.0, 0.45)], [48.1, 49.0, 52.6]))
def test_a_mass_turns_back_as_in_closed_form(build_fmu: BuildFmu, turn: float) -> None:
    """Over three steps, a thrown mass turns its contact from +W to -W, whenever the last scheduled check was.

    1 kg under -1000 N on a spring of 1e5 N/m that slips at 1 N; tolerated are 1 % of the friction over these steps.
    """
    m, k, W, P, h = 1.0, 1e5, 1.0, 1000.0, 1e-4
    start = {"mass.m": m, "mass.k": 0.0, "mass.d": 0.0, "mass.F_drive": -P, "mass.v0": (P + W) / m * turn * h}
    start |= {"friction.N": 1.0, "friction.k[1]": k, "friction.W[1]": W}
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("MaxwellSlip"))]
    with System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], start) as system:
        v = system.run(stop=70 * h, step=h, master="newton")["mass.v"].to_numpy()
    rate, sliding = math.sqrt(k / m), math.sqrt(4.0 * P * W / k / m)  # the spring has taken and returned its energy
    lasts = math.acos((P - W) / (P + W)) / rate
    turns = 35 * h + v[35] * m / (P + W)
    assert v[70] == pytest.approx(-sliding - (P - W) / m * (70 * h - turns - lasts), abs=0.01 * W / m * 3 * h)


def test_a_ringing_within_the_step_decays(build_fmu: BuildFmu) -> None:
    """m x'' + sigma1 x' + (k + sigma0) x = k V t, as the contact stays far below its limit: x rings 30 times in a step
    and decays by exp(-sigma1 t/(2 m)). The errors of the hundreds of loops in a step must not keep it ringing."""
    m, k, V, sigma0, sigma1 = 8.7e-5, 16e3, 8e-6, 15e3, 5e-4
    start = {"mass.m": m, "mass.k": k, "mass.v_support": V, "mass.F_drive": 0.0, "friction.sigma0": sigma0}
    start |= {"friction.sigma1": sigma1, "friction.sigma2": 0.0, "friction.Fc": 1e3, "friction.Fs": 1e3}
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre"))]
    with System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], start) as system:
        v = system.run(stop=2.0, step=1e-2, master="newton", record=["mass.v"])["mass.v"].to_numpy()
    steady = k * V / (k + sigma0)
    np.testing.assert_allclose(v[170:], steady, atol=(math.exp(-0.5 * sigma1 / m * 1.7) + 1e-2) * steady)
