"""What the doctor finds in loops with other plants, drives, sensors and laws, and that it is true in the simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from thorough import some

from friction_fmus.__main__ import main
from friction_fmus.doctor import examine, unknown_parts
from harness import Experiment, FmuPart, Manipulator, Noise, System, Wire

BlockFmu = Callable[..., Path]
Make = Callable[..., System]
AT = 1e-3
"""The reference at rest [m]."""

SLOW = {"amplitude": 1e-3, "frequency": 0.1}
"""A reference at some 0.6 mm/s, below the Stribeck velocity."""

PLANT = {"mass.F_load": 0.0, "mass.v_support": 0.0}
CONTACT = ["mass.v -> fric.v", "fric.F -> mass.F_friction"]
GAINS = {"servo.Kp": 12e3, "servo.Kd": 600.0, "servo.Ki": 0.0}
MEASURED = ["mass.x -> servo.x", "mass.v -> servo.v"]
DRIVE = ["servo.u -> mass.F_drive"]


@pytest.fixture
def make(build_fmu: BlockFmu) -> Make:
    """A system of blocks by name; ``servo`` follows a reference at rest or a slow sinusoid."""

    def made(
        blocks: Mapping[str, str],
        wires: list[object],
        start: Mapping[str, float],
        stop: float = 1.0,
        slow: bool = False,
        step: float = 1e-4,
    ) -> System:
        names = ("r", "rd", "rdd")
        values = dict(start)
        if slow:
            blocks = {**blocks, "sine": "Sine"}
            wires = [*wires, *(f"sine.{name} -> servo.{name}" for name in names)]
            values |= {f"sine.{key}[1]": value for key, value in SLOW.items()}
        elif "servo" in blocks:
            at_rest = {f"servo.{name}": AT * (name == "r") for name in names}
            values = {key: value for key, value in at_rest.items() if key not in _targets(wires)} | values
        parts = [FmuPart(name, build_fmu(block)) for name, block in blocks.items()]
        record = tuple(f"mass.{name}" for name in ("x", "v") if blocks["mass"] != "TwoMass") or ("mass.x2",)
        return System(parts, wires, values, Experiment(stop=stop, step=step, master="newton", record=record))

    return made


def _targets(wires: list[object]) -> set[str]:
    return {(wire.target if isinstance(wire, Wire) else str(wire).split(" -> ")[1]) for wire in wires}


def names(system: System) -> list[str]:
    return [found.condition.name for found in examine(system) if not found.condition.ok]


def swing(system: System, signal: str = "mass.x") -> float:
    """Peak to peak in the last quarter of a run."""
    with system:
        values = system.run()[signal].to_numpy()
    return float(np.ptp(values[3 * len(values) // 4 :]))


def servo(model: str, wires: list[object], **start: float) -> tuple[dict[str, str], list[object], dict[str, float]]:
    """Blocks, wires and values of a complete law on a mass with LuGre friction."""
    blocks = {"servo": model, "mass": "Mass", "fric": "LuGre"}
    return blocks, [*DRIVE, *wires, *CONTACT], PLANT | {f"servo.{key}": value for key, value in start.items()}


def with_part(model: str, wires: list[object], **start: float) -> tuple[dict[str, str], list[object], dict[str, float]]:
    """The same of a PD loop with one more block, `more`."""
    blocks = {"servo": "PID", "mass": "Mass", "fric": "LuGre", "more": model}
    values = {(key if "." in key else f"more.{key}"): value for key, value in start.items()}
    return blocks, [*wires, *CONTACT], PLANT | GAINS | values


ACTUATOR = ["servo.u -> more.u", "more.F -> mass.F_drive", *MEASURED]
ESTIMATOR = [*DRIVE, *MEASURED, "more.u -> servo.f", "mass.v -> more.v", Wire("servo.u", "more.u_prev", delay=1)]
OBSERVED = ["mass.x -> servo.x", Wire("servo.u", "servo.u_prev", delay=1)]
BEHIND = ["servo.u -> more.f", "more.u -> mass.F_drive", *MEASURED]

SHAKEN = {
    "delay of the actuator": (with_part("Actuator", ACTUATOR, delay=4e-3), "sampled loop"),
    "mass of the observer": (with_part("DisturbanceObserver", ESTIMATOR, m=12.0), "disturbance observer"),
    "short fit": (
        with_part("LocalFunctionEstimator", ESTIMATOR, m=2.0, window=2, degree=1),
        "disturbance observer",
    ),
    "mass of a sliding mode": (servo("ImplicitSlidingMode", MEASURED, m=2.5, K=500.0), "sampled loop"),
    "gain of s": (servo("AdaptiveSlidingMode", MEASURED, Ks=2500.0), "sampled loop"),
    "velocity gain": (servo("ModelledOutputKarnopp", MEASURED, CV=2500.0), "sampled loop"),
    "stiffness of the model": (
        servo("AdaptiveLuGre", MEASURED, sigma0=2e5, sigma1=400.0, theta_max=1.0, Gamma=0.0),
        "fed-back stiffness",
    ),
    "dead zone": (
        with_part("DeadZoneFeedforward", BEHIND, rd=0.0, rdd=0.0, T_dz=5.0, **{"servo.Kd": 1200.0}),
        "sampled loop",
    ),
}
QUIET = {
    "a little delay": with_part("Actuator", ACTUATOR, delay=1e-3),
    "observer of a heavy mass": with_part("DisturbanceObserver", ESTIMATOR, m=5.0),
    "observer of second order": with_part("DisturbanceObserver", ESTIMATOR, fq=60.0, second_order=True),
    "fit": with_part("LocalFunctionEstimator", ESTIMATOR, window=2, degree=1),
    "predictive filter": with_part("PredictiveFilter", ESTIMATOR),
    "Kalman": with_part("KalmanFriction", [*ESTIMATOR[:3], "mass.x -> more.x", "more.u -> servo.f", ESTIMATOR[-1]]),
    "sliding mode": servo("ImplicitSlidingMode", MEASURED, m=1.8),
    "super-twisting": servo("ImplicitSuperTwisting", MEASURED),
    "adaptive sliding mode": servo("AdaptiveSlidingMode", MEASURED),
    "adaptive LuGre": servo("AdaptiveLuGre", MEASURED),
    "ANDFC": servo("ANDFC", OBSERVED),
    "extended state": servo("ExtendedStateObserver", OBSERVED, wc=400.0, wo=2000.0),
    "dead zone at gain 0": with_part("DeadZoneFeedforward", BEHIND, rd=0.0, rdd=0.0, gain=0.0, **{"servo.Kd": 1200.0}),
}


@pytest.mark.parametrize("case", some([*SHAKEN], [*SHAKEN][::3]))
def test_a_loop_that_is_found_unstable_does_not_come_to_rest(case: str, make: Make) -> None:
    parts, name = SHAKEN[case]
    system = make(*parts)
    assert name in names(system)
    assert swing(system) > 2e-6


@pytest.mark.parametrize("case", some([*QUIET], [*QUIET][::4]))
def test_a_loop_without_findings_comes_to_rest(case: str, make: Make) -> None:
    system = make(*QUIET[case], stop=2.0)
    assert names(system) == []
    assert swing(system) < 1e-6


def two_mass(measured: str, **start: float) -> tuple[dict[str, str], list[object], dict[str, float]]:
    wires = [*DRIVE, f"mass.x{measured} -> servo.x", f"mass.v{measured} -> servo.v"]
    friction = ["mass.v1 -> fric.v", "fric.F -> mass.F_friction1"]
    values = GAINS | {"mass.F_load": 0.0} | {f"mass.{key}": value for key, value in start.items()}
    return {"servo": "PID", "mass": "TwoMass", "fric": "LuGre"}, [*wires, *friction], values


@pytest.mark.parametrize(
    ("parts", "found"),
    [
        (two_mass("1"), []),
        (two_mass("2"), ["sampled loop"]),
        (two_mass("2", k=1e8, d=500.0), []),
    ],
    ids=["at the motor", "at the load", "at a load that is stiff"],
)
def test_a_resonance_in_the_loop(parts: tuple[object, ...], found: list[str], make: Make) -> None:
    system = make(*parts)
    assert names(system) == found
    assert (swing(system, "mass.x2") > 1e-3) == bool(found)


def moves(system: System, *disturbances: Manipulator) -> np.ndarray:
    """Velocity over that of the slow reference, where that is above half its largest."""
    with system:
        v = system.run(manipulators=disturbances)["mass.v"].to_numpy()
    w = 2.0 * np.pi * SLOW["frequency"]
    wanted = SLOW["amplitude"] * w * np.cos(w * 1e-4 * np.arange(len(v)))
    there = (np.abs(wanted) > 0.5 * SLOW["amplitude"] * w) & (np.arange(len(v)) > 30_000)
    return np.asarray((v / wanted)[there])


ENCODER = [*DRIVE, "mass.x -> more.x", "more.x_measured -> servo.x", "more.v_measured -> servo.v"]


@pytest.mark.parametrize(("wo", "found"), [(400.0, ["stick-slip"]), (2000.0, [])])
def test_slow_motion_with_an_extended_state_observer(wo: float, found: list[str], make: Make) -> None:
    """Noise of 0.1 mN disturbs it: an unstable loop shows it, and one that is solved exactly has no other start."""
    system = make(*servo("ExtendedStateObserver", OBSERVED, wo=wo), stop=6.0, slow=True)
    assert names(system) == found
    assert (float(np.std(moves(system, Noise("mass.F_friction", 1e-4, seed=1)))) > 1e-2) == bool(found)


@pytest.mark.parametrize(("q", "found"), [(4e-6, ["encoder"]), (2e-7, [])])
def test_slow_motion_on_the_counts_of_an_encoder(q: float, found: list[str], make: Make) -> None:
    system = make(*with_part("Encoder", ENCODER, q=q, v=0.0), stop=6.0, slow=True)
    assert names(system) == found
    assert (float((moves(system) < -0.1).mean()) > 0.1) == bool(found)


@pytest.mark.parametrize(("most", "found"), [(1.3, ["break-away"]), (1.6, [])])
def test_a_drive_that_cannot_break_away(most: float, found: list[str], make: Make) -> None:
    system = make(*with_part("Actuator", ACTUATOR, F_max=most, F_min=-most), stop=6.0, slow=True)
    assert names(system) == found
    assert (float(np.median(moves(system))) < 0.1) == bool(found)


@pytest.mark.parametrize(("v", "d", "found"), [(1e-3, 0.0, ["belt"]), (1e-3, 500.0, []), (2e-2, 1.0, [])])
def test_a_mass_on_a_belt(v: float, d: float, found: list[str], make: Make) -> None:
    """Started just beside steady sliding: it sticks and slips, or it does not."""
    start = {"mass.v_belt": v, "mass.a_belt": 0.0, "mass.F_load": 0.0, "mass.k": 100.0, "mass.d": d}
    g = 1.0 + 0.5 * np.exp(-((v / 1e-3) ** 2))
    blocks = {"mass": "Belt", "fric": "Stribeck"}
    wires = ["mass.v_rel -> fric.v", "mass.F_ext -> fric.F_ext", "fric.F -> mass.F_friction"]
    system = make(blocks, wires, start | {"mass.x0": (g + 0.4 * v) / 100.0 + 1e-6}, stop=4.0)
    assert names(system) == found
    assert (swing(system) > 1e-5) == bool(found)


@pytest.mark.parametrize(("A", "found"), [(3.0, ["cogging"]), (0.3, [])])
def test_cogging_that_is_stiffer_than_the_loop(A: float, found: list[str], make: Make) -> None:
    """Without friction, at a place where cogging pushes away: 3 kN/m against 2 pi A/1 mm."""
    blocks = {"servo": "PID", "mass": "Mass", "more": "Cogging"}
    wires = [*DRIVE, *MEASURED, "mass.x -> more.x", "more.F -> mass.F_load"]
    start = {"servo.Kp": 3e3, "servo.Kd": 200.0, "servo.Ki": 0.0, "servo.r": 0.0, "mass.x0": 1e-7}
    start |= {"mass.F_friction": 0.0, "mass.v_support": 0.0, "more.amplitude[1]": A, "more.pitch": 1e-3}
    system = make(blocks, wires, start, stop=0.5)
    assert names(system) == found
    with system:
        end = abs(float(system.run()["mass.x"][-1]))
    assert (end > 1e-4) == bool(found)


PULSES = [*BEHIND, "mass.x -> more.x", "mass.v -> more.v"]


@pytest.mark.parametrize(
    ("start", "found"), [({}, []), ({"m": 30.0, "tol": 1e-5}, ["pulses"]), ({"n_pulse": 20, "tol": 5e-6}, ["pulses"])]
)
def test_pulses_that_settle_and_that_do_not(start: dict[str, float], found: list[str], make: Make) -> None:
    system = make(*with_part("ImpulsiveControl", PULSES, r=AT, **start))
    assert names(system) == found
    assert (swing(system) > 1e-5) == bool(found)


@pytest.mark.parametrize(("Ad", "found"), [(50.0, []), (10.0, ["dither stroke"])])
def test_dither_that_slides_and_that_does_not(Ad: float, found: list[str], make: Make) -> None:
    """Under a constant force F the mean velocity is near A sin(pi F/(2 Fc)), which smooth friction gives, or half."""
    force, w = 0.3, 2.0 * np.pi * 200.0
    blocks = {"mass": "Mass", "fric": "LuGre", "more": "Dither"}
    start = PLANT | {"mass.F_load": force, "more.f": 0.0, "more.Ad": Ad}
    system = make(blocks, ["more.u -> mass.F_drive", *CONTACT], start)
    assert names(system) == found
    with system:
        x = system.run()["mass.x"].to_numpy()
    speed = float(x[-1] - x[-4001]) / 0.4
    assert (speed < 0.6 * Ad / w * np.sin(np.pi * force / 2.0)) == bool(found)


def test_a_prefilter_for_another_controller(make: Make) -> None:
    wires = [*DRIVE, *MEASURED, "more.r_out -> servo.r", "more.rd_out -> servo.rd"]

    def found(**gains: float) -> list[str]:
        own = {"Kp": 12e3, "Kd": 600.0, "Ki": 0.0} | gains
        start = {"r": AT, "rd": 0.0, "rdd": 0.0, **own, "servo.rdd": 0.0}
        return names(make(*with_part("Prefilter", wires, **start)))

    assert found() == []
    assert found(Kd=500.0) == ["prefilter gains"]
    assert found(Kd=5.0) == ["prefilter", "prefilter gains"]


def test_an_inverse_with_a_short_preview(make: Make) -> None:
    wires = [*DRIVE, *MEASURED, "more.u -> servo.f"]
    assert names(make(*with_part("DiscreteInverse", wires, r=0.0))) == []
    assert names(make(*with_part("DiscreteInverse", wires, r=0.0, preview=3.0))) == ["preview"]


def test_parts_that_are_not_known_are_named(
    make: Make, tmp_path: Path, build_fmu: BlockFmu, capsys: pytest.CaptureFixture[str]
) -> None:
    """A signal is none of the doctor's business, a chain of masses is; so is a system without a mass."""
    blocks = {"mass": "Mass", "fric": "RateAndState", "sine": "Sine"}
    system = make(blocks, list(CONTACT), PLANT | {"mass.F_drive": 0.0})
    assert unknown_parts(system) == ["fric"]
    signal = System([FmuPart("sine", build_fmu("Sine"))], [], {})
    for name, one in (("a.ssp", system), ("b.ssp", signal)):
        one.to_ssp(tmp_path / name)
        assert main(["doctor", str(tmp_path / name)]) == 0
    first, second = capsys.readouterr().out.split("a.ssp")
    assert "ignored, unknown blocks: fric" in first
    assert "no known mass found" in second


def test_friction_under_the_load_of_another_part_has_no_one_level(make: Make) -> None:
    """Friction of 50 N, fully compensated: the contact alone would have 1 N."""
    blocks = {"mass": "Mass", "fric": "Stribeck", "load": "TransmissionLoad", "comp": "CoulombFeedforward"}
    wires = [*CONTACT, "mass.F_ext -> fric.F_ext", "mass.v -> load.v", "load.Fn -> fric.Fn", "comp.u -> mass.F_drive"]
    start = {**PLANT, "fric.Fs": 1.0, "load.base": 50.0, "load.F_drive": 0.0, "load.F_external": 0.0}
    start |= {"comp.Fc": 50.0, "comp.rd": 0.0, "comp.rdd": 0.0}
    assert names(make(blocks, wires, start)) == []
    alone = make(blocks, [*wires[:3], wires[-1]], {**start, "fric.Fn": 1.0, "load.v": 0.0})
    assert "over-compensation" in names(alone)
