"""An axis whose load is behind a spring, with friction on both sides, against the independent axis."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from independent_axes import AXES, SimulatedAxis, belt
from independent_axis import resting, simulate, typical_moves
from thorough import landing, some

from friction_fmus.axis.loop_assembly import block, start_of
from friction_fmus.axis.servo import AxisPlant, FlexibleLoad, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.identification import read_records
from friction_fmus.identification.plant_candidates import plant_findings
from friction_fmus.study.data import build_reference
from friction_fmus.study.evaluation import off_by
from friction_fmus.study.margins import operating_points
from harness import Experiment, FmuPart, SeriesPart, System

HELD = 4  # ms, for which a force of the drive is constant


def drawn(seed: int) -> tuple[dict[str, float], np.ndarray]:
    """Masses, spring and friction of an axis, and a force that moves it now and then, in samples of 1 ms."""
    rng = np.random.default_rng(seed)
    m1, m2 = rng.uniform(0.5, 10.0, 2)
    frequency, reduced = rng.uniform(2.0, 60.0), m1 * m2 / (m1 + m2)
    k = reduced * (2.0 * pi * frequency) ** 2
    axis = {"m1": m1, "m2": m2, "k": k, "c": 2.0 * rng.uniform(0.005, 0.2) * np.sqrt(k * reduced)}
    for side in (1, 2):
        axis[f"Fc{side}"] = rng.uniform(2.0, 15.0)
        axis |= {f"Fs{side}": axis[f"Fc{side}"] * rng.uniform(1.0, 1.5), f"Fv{side}": rng.uniform(0.0, 10.0)}
        axis |= {f"vs{side}": 0.01, f"kind{side}": 1.0}
    t = 1e-3 * HELD * np.arange(750.0)
    sizes, phases = rng.uniform(0.0, 1.0, 4) * (axis["Fc1"] + axis["Fc2"]), rng.uniform(0.0, 6.0, 4)
    frequencies = np.geomspace(0.1, 3.0, 4)
    waves = [a * np.sin(2.0 * pi * f * t + p) for a, f, p in zip(sizes, frequencies, phases, strict=True)]
    return axis, np.repeat(np.sum(waves, axis=0), HELD)


@landing
@pytest.mark.parametrize("seed", some([1, 4, 12, 21, 26, 38, 85, 126], [4, 126]))
def test_two_masses_stick_and_slip_on_both_sides(seed: int) -> None:
    """Neither contact need stop together with the other: a motor comes to rest while the load goes on."""
    axis, force = drawn(seed)
    n = len(force)
    run = simulate(axis, {"Ts": 1e-3}, resting(n), extra=force, step=2e-6)
    t = 1e-3 * np.arange(float(n))
    drive = SeriesPart("drive", t, {"u": force}, {"u": "N"}, interpolation="previous", beyond="hold")
    contacts = [FmuPart(f"f{side}", block("Stribeck")) for side in (1, 2)]
    wires = ["drive.u -> axis.F_drive"]
    for side in (1, 2):
        wires += [f"axis.v{side} -> f{side}.v", f"f{side}.F -> axis.F_friction{side}"]
        wires.append(f"axis.F_ext{side} -> f{side}.F_ext")
    start = {"axis.m1": axis["m1"], "axis.m2": axis["m2"], "axis.k": axis["k"], "axis.d": axis["c"]}
    start |= {f"f{side}.{name}": axis[f"{name}{side}"] for side in (1, 2) for name in ("Fc", "Fs", "Fv", "vs")}
    experiment = Experiment(1e-3 * n, 2.5e-4, master="newton", record=("axis.x1", "axis.x2"))
    with System([drive, FmuPart("axis", block("TwoMass")), *contacts], wires, start, experiment) as system:
        result = system.run()
    moved = max(np.ptp(run.x1), np.ptp(run.x2))
    assert moved > 1e-4
    for name, expected in (("axis.x1", run.x1), ("axis.x2", run.x2)):
        found = result[name].to_numpy()[:-1:4]
        assert np.max(np.abs(found - expected)) < 1e-3 * moved


@landing
@pytest.mark.parametrize("name", ["belt_8_Hz", "belt_25_Hz"])
def test_the_simulated_loop_follows_an_axis_with_a_flexible_load(name: str, tmp_path: Path) -> None:
    axis = AXES[name]
    p, s, reference = axis.axis, axis.servo, axis.reference
    run = axis.run(quantum=0.0)
    n = 2000
    w, m2 = (p["k"] / p["m2"]) ** 0.5, p["m2"]
    load = FlexibleLoad(m2 / (p["m1"] + m2), w, p["c"] / (2.0 * m2 * w), p["Fc2"] / (p["Fc1"] + p["Fc2"]))
    assert 2.0 * pi * load.resonance == pytest.approx((p["k"] * (1.0 / p["m1"] + 1.0 / m2)) ** 0.5)
    level = p["Fc1"] + p["Fc2"]
    values = {"Fc": level, "Fs": level, "Fv": p["Fv1"] + p["Fv2"]}
    gains = {"kp": s["kp"], "kv": s["kv"], "ki": s.get("ki", 0.0)}
    window, delay = round(s.get("window", 2.0)), round(s.get("delay", 0.0))
    servo = Servo("CascadePPI", gains, axis.Ts, s["limit"], window=window, delay=delay)
    fmu = build_reference(axis.Ts * np.arange(float(n)), reference.r[:n], tmp_path, "Reference")
    plant = AxisPlant("Stribeck", values, p["m1"] + m2, load=load)
    with closed_loop(servo, plant, Trajectory(fmu, n, 0.0, 0.0)) as system:
        trace = run_loop(system)
        changed = off_by(system, 1.1, 0.9)
    # the viscous friction is divided like the Coulomb friction, which on these axes is 10 instead of 5 N.s/m
    assert np.sqrt(np.mean((trace.q - run.x1[:n]) ** 2)) < 0.02 * np.sqrt(np.mean((reference.r - run.x1)[:n] ** 2))
    assert changed["axis.m1"] + changed["axis.m2"] == pytest.approx(0.9 * (p["m1"] + m2))
    assert changed["friction.Fc"] + changed["load_friction.Fc"] == pytest.approx(1.1 * level)


@landing
@pytest.mark.parametrize("rotary", [False, True])
def test_a_spring_holds_the_weight_of_the_load_from_the_start(rotary: bool, tmp_path: Path) -> None:
    """Without friction that holds it, a load on a spring without stretch would begin to swing."""
    p, n, weight = belt(8.0) | {"Fv1": 6.0, "Fv2": 10.0}, 2000, 40.0  # viscous friction shared like the Coulomb one
    reference, w = typical_moves(2.0, 1e-3, 0.3, 0.6, 3.0), (p["k"] / p["m2"]) ** 0.5
    gains = {"kp": 20.0, "kv": 300.0, "ki": 3000.0}
    run = simulate(p | {"weight": weight, "x2": -weight / p["k"]}, gains | {"limit": 400.0}, reference)
    load = FlexibleLoad(p["m2"] / 13.0, w, p["c"] / (2.0 * p["m2"] * w), 10.0 / 16.0)
    plant = AxisPlant("Stribeck", {"Fc": 16.0, "Fs": 16.0, "Fv": 16.0}, 13.0, offset=weight, load=load)
    fmu = build_reference(1e-3 * np.arange(float(n)), reference.r, tmp_path, "Reference", rotary)
    with closed_loop(
        Servo("CascadePPI", gains, 1e-3, 400.0), plant, Trajectory(fmu, n, 0.0, 0.0, rotary=rotary)
    ) as system:
        trace = run_loop(system)
    assert np.sqrt(np.mean((trace.q - run.x1) ** 2)) < 1e-3 * np.sqrt(np.mean((reference.r - run.x1) ** 2))


@landing
def test_parts_of_mass_and_friction_of_an_axis_that_swings(tmp_path: Path) -> None:
    """A rigid mass has less Coulomb friction: the motor reverses more often than the load."""
    servo = {"kp": 10.0, "kv": 120.0, "ki": 600.0, "limit": 400.0, "quantum": 1e-7}
    SimulatedAxis(belt(8.0), servo).write(tmp_path, "swings")
    _, load = plant_findings(read_records(tmp_path / "axis.toml"), 400.0)
    assert load is not None
    assert (load.share, load.friction) == pytest.approx((10.0 / 13.0, 10.0 / 16.0), rel=0.03)


def test_margins_of_a_stiff_load_are_those_of_a_rigid_mass() -> None:
    """On bristles at rest, and where friction falls with the speed, by 2 e exp(-1)/0.1 N.s/m at 0.1 m/s."""
    lugre = {"sigma0": 1e5, "sigma1": 300.0, "sigma2": 4.0, "Fc": 1.0, "Fs": 1.5, "vs": 0.01}
    for name, values, slowest in (
        ("LuGre", lugre, np.roots([13.0, 304.0, 1e5])),
        ("Stribeck", {"Fc": 1.0, "Fs": 1.0 + np.e, "vs": 0.1, "Fv": 4.0}, [0.0, (20.0 - 4.0) / 13.0]),
    ):
        plant = AxisPlant(name, values, 13.0, load=FlexibleLoad(10.0 / 13.0, 1e5, 0.02, 0.625))
        _, driven = operating_points(plant, 0.1)[-1]
        poles = sorted(np.linalg.eigvals(driven.A), key=abs)[:2]
        assert sorted(poles, key=abs) == pytest.approx(sorted(slowest, key=abs), rel=1e-3, abs=1e-6)


def test_a_load_whose_friction_holds_a_small_constant_force_begins_at_rest() -> None:
    """A spring that carries all of it leaves forces of the size of rounding errors, whose sign is not defined."""
    load = FlexibleLoad(0.77, 24.0, 0.03, 0.6)
    for offset, stretched in ((1e-3, False), (40.0, True)):
        plant = AxisPlant("Stribeck", {"Fc": 16.0, "Fs": 16.0, "Fv": 15.0}, 13.0, offset, load=load)
        starts = start_of(plant, {"friction": FmuPart("friction", block("Stribeck"))}, 0.1)
        assert starts["axis.x2_0"] == pytest.approx(0.1 - stretched * offset / (0.77 * 13.0 * 24.0**2), rel=1e-12)
