"""The doctor on a good loop and on loops that are bad in one way each, and its tables against the blocks."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from scipy.signal import butter, freqz
from stand_ins import stand_in
from thorough import nightly, some

from friction_fmus import build
from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import catalogue, laws_folder
from friction_fmus.blocks.contact import AxisFriction, Level
from friction_fmus.doctor import examine
from friction_fmus.doctor.examined_axis import ActiveLaw, Axis, LawProperties
from friction_fmus.doctor.find import axes
from friction_fmus.doctor.roles import known_blocks, law_of
from friction_fmus.doctor.rules import butterworth_there_and_back, examine_axis, windowed_sinc
from friction_fmus.lawkit.law_files import discover_laws
from harness import CallablePart, Experiment, FmuPart, System, Wire
from harness.errors import StartValueError

ROOT = Path(__file__).parent.parent.parent
BlockFmu = Callable[..., Path]

WIRES = ["pid.u -> mass.F_drive", "mass.x -> pid.x", "mass.v -> pid.v", "mass.v -> fric.v", "fric.F -> mass.F_friction"]
START = {
    "pid.r": 0.0,
    "pid.rd": 0.0,
    "pid.rdd": 0.0,
    "pid.Kp": 12e3,
    "pid.Kd": 600.0,
    "pid.Ki": 0.0,
    "mass.F_load": 0.0,
    "mass.v_support": 0.0,
}
STEPS = Experiment(stop=1.0, step=1e-3)


def named(name: str) -> LawProperties:
    """A law of the catalogue, which the doctor knows."""
    law = law_of(name)
    assert law is not None
    return law


@pytest.fixture
def loop(build_fmu: BlockFmu) -> Callable[..., System]:
    """A good loop, PID on a mass on a LuGre contact, and what is to be different."""

    def make(
        start: dict[str, float] | None = None,
        wires: list[object] | None = None,
        parts: tuple[FmuPart, ...] = (),
        experiment: Experiment = STEPS,
    ) -> System:
        own = (
            FmuPart("pid", build_fmu("PID")),
            FmuPart("mass", build_fmu("Mass")),
            FmuPart("fric", build_fmu("LuGre")),
        )
        return System((*own, *parts), [*WIRES, *(wires or [])], START | (start or {}), experiment)

    return make


def wrong(system: System, experiment: Experiment | None = None) -> list[tuple[str, tuple[str, ...]]]:
    """Names and parts of what the doctor finds."""
    return [(found.condition.name, found.parts) for found in examine(system, experiment) if not found.condition.ok]


def test_a_good_loop_has_no_findings_and_all_conditions_were_looked_at(loop: Callable[..., System]) -> None:
    found = examine(loop())
    assert [finding for finding in found if not finding.condition.ok] == []
    linear = ["Routh", "sampled loop", "presliding loop"]
    names = ["stick-slip", "hunting", "break-away", "sample time", "stepping order", "contact stiffness"]
    assert [finding.condition.name for finding in found] == [*linear, *names]


@pytest.mark.parametrize(
    ("start", "names"),
    [
        ({"pid.Ki": 1e7, "fric.Fs": 1.0}, ["Routh", "sampled loop"]),
        ({"pid.Ts": 4e-3}, ["sampled loop"]),
        ({"pid.Kd": 190.0}, ["stick-slip"]),
        ({"pid.Ki": 1e5}, ["hunting"]),
        ({"pid.Kp": 0.0}, ["Routh", "sampled loop"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_gains(loop: Callable[..., System], start: dict[str, float], names: list[str]) -> None:
    assert [name for name, _ in wrong(loop(start))] == names


def test_options_of_the_integral_at_reversals_are_named(loop: Callable[..., System]) -> None:
    """Swings of the LuGre paper's loop: smaller with friction turned, larger with more of it than there is."""

    def found(**pid: float) -> dict[str, str]:
        system = loop({"pid.Kp": 3.0, "pid.Kd": 6.0, "pid.Ki": 4.0} | {f"pid.{key}": each for key, each in pid.items()})
        return {f.condition.name: f.condition.why for f in examine(system) if not f.condition.ok}

    assert "far smaller" not in found(reversal=0.0)["hunting"]
    for options in ({"reversal": -1.0}, {"Fc_turned": 1.0}):
        assert "far smaller" in found(**options)["hunting"]
        assert "turned friction" not in found(**options)
    assert "drives the axis" in found(Fc_turned=1.2)["turned friction"]
    assert "turned friction" not in found(Fc_turned=1.2, Ki=0.0)


def test_hunting_that_is_found_hunts_and_without_the_finding_it_rests(loop: Callable[..., System]) -> None:
    """Position of the loop of the LuGre paper (Kp 3, Kd 6, Ki 4, 1 kg) between 60 and 120 s, in the co-simulation."""

    def ptp(**values: float) -> float:
        gains = {"pid.Kp": 3.0, "pid.Kd": 6.0, "pid.Ki": 4.0, "pid.r": 1.0}
        system = loop(gains | {name.replace("_", ".", 1): value for name, value in values.items()})
        x = system.run(stop=120.0, record=["mass.x"])["mass.x"].to_numpy()
        assert ("hunting" in dict(wrong(system))) == (not values)
        return float(np.ptp(x[60_000:]))

    assert ptp() > 0.1
    assert ptp(pid_Ki=0.0) < 1e-4


def test_a_wire_with_the_wrong_sign_is_found(loop: Callable[..., System]) -> None:
    system = loop()
    flipped = WIRES[1:]
    bad = System(system.parts.values(), [*flipped, Wire("pid.u", "mass.F_drive", gain=-1.0)], START, STEPS)
    assert wrong(bad)[0] == ("Routh", ("pid", "mass"))
    assert "wrong sign" in examine(bad)[0].condition.change


def with_feedforward(build_fmu: BlockFmu, gain: float = 1.0, **start: float) -> dict[str, object]:
    values = {"ff.rd": 0.0, "ff.rdd": 0.0, "pid.m": 0.0} | {
        key.replace("_", ".", 1): value for key, value in start.items()
    }
    wires = [Wire("ff.u", "pid.f", gain=gain)]
    return {"start": values, "wires": wires, "parts": (FmuPart("ff", build_fmu("StaticFeedforward")),)}


@pytest.mark.parametrize(
    ("gain", "start", "names"),
    [
        (1.0, {}, []),
        (1.5, {}, ["over-compensation"]),
        (1.0, {"ff_Fc": 1.2}, ["over-compensation"]),
        (1.0, {"ff_Fc": 1.2, "ff_gain": 0.8}, []),
        (1.0, {"ff_vs": 5e-3}, ["over-compensation"]),
        (1.0, {"ff_delta": 100.0}, ["over-compensation"]),
        (1.0, {"pid_m": 1.0}, ["inertia"]),
        (1.0, {"pid_m": 1.0, "ff_m": 0.0}, []),
    ],
)
def test_feedforward(
    loop: Callable[..., System], build_fmu: BlockFmu, gain: float, start: dict[str, float], names: list[str]
) -> None:
    assert [name for name, _ in wrong(loop(**with_feedforward(build_fmu, gain, **start)))] == names


def test_two_compensators_together_are_too_much(build_fmu: BlockFmu, loop: Callable[..., System]) -> None:
    observer = ActiveLaw("observer", named("LuGreObserver"), {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "gain": 0.5, "k": 0.0})
    forward = ActiveLaw("ff", named("StaticFeedforward"), {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "gain": 0.7, "m": 0.0})
    level = Level(1.0, 1.5, 0.4, 1e-3)
    axis = Axis(
        "mass", 1.0, friction="fric", contact=AxisFriction((level, level), 1e5, 316.0), laws=(observer, forward)
    )
    (found,) = examine_axis(axis)
    assert found.parts == ("observer", "ff", "fric")
    assert found.condition.value == pytest.approx(1.2)


OBSERVER = {"gain": 1.0, "k": 1.0, "sigma0": 1e5, "sigma1": 316.23, "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3}


@nightly
def test_injection_into_a_lugre_observer(tmp_path: Path, loop: Callable[..., System]) -> None:
    fmu = stand_in("LuGreObserver", tmp_path, **OBSERVER, delta=2.0)
    wires = ["observer.u -> pid.f", "mass.v -> observer.v"]
    system = loop({"pid.Kd": 190.0}, wires, (FmuPart("observer", fmu),))
    # an exact observer leaves no friction that could stick and slip
    assert wrong(system) == [("observer injection", ("observer", "pid", "mass"))]
    assert wrong(loop({"pid.Kd": 190.0, "observer.k": 0.0}, wires, (FmuPart("observer", fmu),))) == []
    assert wrong(loop({"pid.Kd": 320.0}, wires, (FmuPart("observer", fmu),))) == []
    weak = loop({"pid.Kd": 320.0, "observer.gain": 0.2}, wires, (FmuPart("observer", fmu),))
    assert [name for name, _ in wrong(weak)] == ["stick-slip"]


def test_disturbance_observer_with_a_wrong_mass(tmp_path: Path, loop: Callable[..., System]) -> None:
    fmu = stand_in("DisturbanceObserver", tmp_path, m=1.0, fq=30.0, gain=1.0)
    wires = ["dob.u -> pid.f", "mass.v -> dob.v"]
    assert wrong(loop({}, wires, (FmuPart("dob", fmu),))) == []
    heavy = loop({"dob.m": 12.0}, wires, (FmuPart("dob", fmu),))
    assert {name for name, _ in wrong(heavy)} == {"disturbance observer"}


LEARNING = {"gain": 1.0, "rate": 0.5, "fq": 50.0, "m": 1.0, "Kp": 12e3, "Kd": 600.0, "Ki": 0.0, "N": 1000.0, "M": 16.0}


@pytest.mark.parametrize("name", some(["IterativeLearning", "RepetitiveController"], ["IterativeLearning"]))
def test_learning_with_a_wrong_model(name: str, tmp_path: Path, loop: Callable[..., System]) -> None:
    fmu = stand_in(name, tmp_path, **LEARNING)
    wires = ["learn.u -> pid.f", "mass.v -> learn.v"]

    def names(**values: float) -> list[str]:
        start = {f"learn.{key}": value for key, value in values.items()}
        return [name for name, _ in wrong(loop(start, wires, (FmuPart("learn", fmu),)))]

    assert names() == []
    # far above the loop L S is 5 and 1 - 0.5 x 5 is -1.5; a low-pass far below helps
    assert names(m=5.0, Kd=3000.0, Kp=60e3, fq=400.0) == ["learning"]
    assert names(Kd=60.0, rate=0.1, fq=5.0) == []


def test_low_passes_of_learning_are_those_of_their_recursions() -> None:
    """The Butterworth filter by scipy, there and back; the sum of the weights at a sinusoid by hand."""
    p = {"fq": 50.0, "Ts": 1e-3, "M": 16.0}
    f = np.array([5.0, 50.0, 120.0, 400.0])
    _, H = freqz(*butter(2, 50.0, fs=1e3), worN=f, fs=1e3)
    assert butterworth_there_and_back(f, p) == pytest.approx(np.abs(H) ** 2, rel=1e-9)
    weights = [
        (0.1 if i == 0 else math.sin(2 * math.pi * 0.05 * i) / (math.pi * i)) * math.cos(math.pi * i / 34.0) ** 2
        for i in range(-16, 17)
    ]
    for one in f:
        wave = [math.cos(2.0 * math.pi * one * 1e-3 * i) for i in range(-16, 17)]
        expected = sum(a * b for a, b in zip(weights, wave, strict=True)) / sum(weights)
        assert windowed_sinc(np.array([one]), p)[0] == pytest.approx(expected, abs=1e-12)
    for off in ({"fq": 0.0}, {"fq": 600.0}):
        assert (butterworth_there_and_back(f, p | off) == 1.0).all()
        assert (windowed_sinc(f, p | off) == 1.0).all()


def test_an_adaptive_law_closes_the_position_loop_and_leaves_no_stick_slip() -> None:
    """u = m (rdd + lam ed) + Ks s + F_hat with s = ed + lam e is a PD controller: Kp = Ks lam, Kd = m lam + Ks."""
    values = {
        "m": 1.0,
        "lam": 63.0,
        "Ks": 127.0,
        "gain": 1.0,
        "Fc": 1.0,
        "Fs": 1.5,
        "vs": 1e-3,
        "sigma0": 1e5,
        "sigma2": 0.4,
        "Gamma": 2000.0,
        "Ts": 1e-3,
    }
    level = Level(1.0, 1.5, 0.4, 1e-3)

    def examined(**other: float) -> tuple[ActiveLaw, list[str]]:
        used = ActiveLaw("law", named("AdaptiveLuGre"), values | other)
        axis = Axis("mass", 1.0, friction="fric", contact=AxisFriction((level, level), 1e5, 316.0, 0.4), laws=(used,))
        return used, [found.condition.name for found in examine_axis(axis) if not found.condition.ok]

    used, names = examined()
    assert names == []
    assert used.gains is not None
    assert (used.gains.Kp, used.gains.Kd, used.gains.Ki) == (127.0 * 63.0, 63.0 + 127.0, 0.0)
    assert examined(gain=0.1)[1] == ["stick-slip"]


def test_a_dead_band_narrower_than_a_slip() -> None:
    """At the level of the axis, as it does not matter which law has the dead-band."""
    level = Level(1.0, 1.5, 0.4, 1e-3)
    contact = AxisFriction((level, level), 1e5, 316.0)

    def names(db: float) -> list[str]:
        values = {"Kp": 3.0, "Kd": 600.0, "Ki": 4.0, "m": 0.0, "db": db}
        axis = Axis("mass", 1.0, friction="fric", contact=contact, laws=(ActiveLaw("pid", named("PID"), values),))
        return [found.condition.name for found in examine_axis(axis) if not found.condition.ok]

    slip = 0.5 / 3.0  # overdamped: (Fs - Fc)/Kp
    assert names(0.0) == ["hunting"]
    assert names(0.49 * slip) == ["dead-band"]
    assert names(0.51 * slip) == []


def test_cascade_is_examined_as_the_pid_that_it_is(build_fmu: BlockFmu, loop: Callable[..., System]) -> None:
    other = FmuPart("pid", build_fmu("CascadePPI"))
    kept = {key: value for key, value in START.items() if key not in ("pid.Kp", "pid.Kd", "pid.Ki")}
    parts = (other, *(part for name, part in loop().parts.items() if name != "pid"))

    def examined(**gains: float) -> ActiveLaw:
        system = System(parts, WIRES, kept | {f"pid.{key}": value for key, value in gains.items()}, STEPS)
        (axis,) = axes(system)
        assert axis.servo is not None
        return axis.servo

    gains = examined(kp=30.0, kv=190.0, ki=6e3).gains
    assert gains is not None
    assert (gains.Kp, gains.Kd, gains.Ki) == (30.0 * 190.0 + 6e3, 190.0, 6e3 * 30.0)


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"step": 2e-3}, ["sample time"]),
        ({"step": 1e-3 / 3.0}, []),
        ({"step": 4e-4}, ["sample time"]),
        ({"step": 1e-3, "order": ("mass", "fric", "pid")}, ["stepping order"]),
        ({"step": 1e-3, "master": "jacobi"}, ["stepping order"]),
        ({"step": 5e-5, "master": "jacobi"}, []),
        ({"step": 1e-3, "master": "newton"}, []),
    ],
)
def test_steps(loop: Callable[..., System], changes: dict[str, object], names: list[str]) -> None:
    experiment = Experiment(stop=changes["step"], **changes)  # type: ignore[arg-type]
    assert [name for name, _ in wrong(loop(), experiment)] == names


@pytest.mark.parametrize("late", [{"master": "jacobi"}, {"order": ("plant", "law")}])
def test_a_late_value_is_late(late: dict[str, object]) -> None:
    """A sampled part gives the time; the plant that integrates it lags by a whole step where the doctor says so."""
    law = CallablePart("law", lambda t, u, x: t, outputs=["u"], sampled=True)
    plant = CallablePart(
        "plant", lambda t, u, x: x[0], inputs=["u"], outputs=["y"], state=[0.0], advance=lambda t, h, u, x: x + h * u,
        dependencies={"y": []},
    )  # fmt: skip
    system = System([law, plant], ["law.u -> plant.u"])
    fine, behind = Experiment(stop=1.0, step=0.1), Experiment(stop=1.0, step=0.1, **late)  # type: ignore[arg-type]
    ends = [float(system.run(**vars(experiment))["plant.y"][-1]) for experiment in (fine, behind)]
    # sum of h t_k, and the same with the value of the step before
    assert ends == pytest.approx([0.01 * sum(range(10)), 0.01 * sum(range(9))])
    assert wrong(system, fine) == []
    assert wrong(system, behind) == [("stepping order", ("law", "plant"))]


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("share", [0.9, 1.1])
def test_the_step_at_which_a_contact_becomes_unstable(build_fmu: BlockFmu, master: str, share: float) -> None:
    """A nudge of 1 nm/s on the LuGre contact of the paper, co-simulated: it dies or it grows."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("fric", build_fmu("LuGre"))]
    start = {"mass.F_drive": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0, "mass.v0": 1e-9}
    step = share * {"gauss-seidel": 3.9066e-3, "jacobi": 1.58114e-3}[master]
    experiment = Experiment(stop=400 * step, step=step, master=master, record=("mass.v",))
    with System(parts, ["mass.v -> fric.v", "fric.F -> mass.F_friction"], start, experiment) as system:
        end = float(abs(system.run()["mass.v"][-50:]).max())
        assert (end < 1e-9) == (share < 1.0)
        names = [name for name, _ in wrong(system)]
    assert names == ([] if share < 1.0 else ["contact stiffness"])


@nightly
def test_renamed_fmus_are_known_by_their_description(tmp_path: Path, loop: Callable[..., System]) -> None:
    parts = {
        "pid": FmuPart("pid", build("PID", tmp_path, {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, name="MyServo")),
        "mass": loop().parts["mass"],
        "fric": FmuPart("fric", build("LuGre", tmp_path, name="MyContact")),
    }
    start = {key: value for key, value in START.items() if key not in ("pid.Kp", "pid.Kd", "pid.Ki")}
    assert wrong(System(parts.values(), WIRES, start, STEPS)) == [("stick-slip", ("pid", "mass", "fric"))]


def test_archives_are_examined_like_system_files(
    tmp_path: Path, loop: Callable[..., System], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "axis.ssp"
    with loop({"pid.Kd": 190.0}) as system:
        system.to_ssp(path)
    assert main(["doctor", str(path), "--json"]) == 1
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["name"], found["parts"]) == ("stick-slip", ["pid", "mass", "fric"])
    assert found["bound"] == pytest.approx(428.88, abs=0.01)
    assert {"wrong", "why", "change", "source", "value", "ok"} <= set(found)


def test_command_on_the_example(capsys: pytest.CaptureFixture[str]) -> None:
    example = str(ROOT / "examples" / "stick_slip.toml")
    assert main(["doctor", example]) == 0  # a note
    out = capsys.readouterr().out
    assert "stick-slip cycle (mass, friction), may be intended" in out
    assert "2 conditions evaluated, no problem, 1 note" in out
    fast = ["--set", "mass.v_support=0.3"]  # above the critical speed
    assert main(["doctor", example, *fast]) == 0
    assert "2 conditions evaluated, no problem" in capsys.readouterr().out
    assert main(["doctor", example, *fast, "--step", "5e-3"]) == 1
    out = capsys.readouterr().out
    assert "contact stiffness (mass, friction)" in out
    assert "use the master newton" in out
    assert main(["doctor", example, *fast, "--step", "5e-3", "--master", "newton", "--all", "--json"]) == 0
    _, held = json.loads(capsys.readouterr().out)
    assert (held["ok"], held["bound"]) == (True, None)
    assert main(["doctor", example, "--set", "friction.sigma0=1e7", "--set", "friction.sigma1=3162.3"]) == 1
    assert "gauss-seidel is stable below 0.0003909 s" in capsys.readouterr().out


def test_command_that_could_not_be_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", str(tmp_path / "none.toml")]) == 2
    assert main(["doctor", str(ROOT / "examples" / "stick_slip.toml"), "--step", "-1"]) == 2
    err = capsys.readouterr().err
    assert "there is no" in err or "cannot be read" in err
    assert "give a positive number" in err


@pytest.mark.parametrize(
    "value",
    ["mass.m=0", "mass.m=-1", "mass.m=nan", "pid.Ts=0", "pid.Ts=inf", "pid.Kp=nan", "fric.vs=0", "fric.delta=101"],
)
def test_values_that_a_run_refuses_are_refused(
    value: str, loop: Callable[..., System], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "axis.ssp"
    with loop() as system:
        system.to_ssp(path)
    assert main(["run", str(path), "-o", str(tmp_path / "o.csv"), "--set", value]) == 2
    assert main(["doctor", str(path), "--set", value]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert value.split("=")[0] in said
    assert "is not a number from" in said


def test_a_start_value_that_is_a_text_is_refused(loop: Callable[..., System]) -> None:
    system = loop()
    with pytest.raises(StartValueError, match=r"start value '' of fric\.sigma0 is not a number from 1e-09 to inf"):
        examine(System(system.parts.values(), WIRES, START | {"fric.sigma0": ""}, STEPS))


def test_sample_times_of_any_size_are_judged(loop: Callable[..., System]) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        for Ts in (1e-9, 1e9, 1e300, 1e308):
            assert wrong(loop({"pid.Ts": Ts}))


KNOWN = catalogue()


CONTACTS = [name for name, block in known_blocks().items() if block.friction and not block.plant]


@pytest.mark.parametrize("name", some(CONTACTS, CONTACTS[::4]))
def test_rows_of_friction_are_what_the_blocks_do(name: str, build_fmu: BlockFmu) -> None:
    """Stiffness from two small steps at rest, level and viscous friction from fast sliding."""
    path = build_fmu(name)
    start = {v.name: float(v.start) for v in fmpy.read_model_description(str(path)).modelVariables if _number(v.start)}
    friction = known_blocks()[name].friction
    assert friction is not None
    contact = friction.contact(start)
    level = contact.levels[0]

    def force(v: float, step: float, steps: int) -> np.ndarray:
        found = fmpy.simulate_fmu(
            str(path), start_values={"v": v}, stop_time=steps * step, step_size=step, output_interval=step, output=["F"]
        )
        return np.asarray(found["F"])

    if contact.stiffness:
        tiny = force(1e-7, 1e-4, 3)  # 0.03 nm
        assert (tiny[-1] - tiny[-2]) / 1e-11 == pytest.approx(contact.stiffness, rel=1e-3)
        rest = tiny[-1] - 3.0 * (tiny[-1] - tiny[-2])
        assert rest / 1e-7 == pytest.approx(contact.damping + contact.viscous, rel=1e-3, abs=0.02)
    fast = [force(v, 0.1, 20)[-1] for v in (1.0, 2.0)]
    assert fast[1] - fast[0] == pytest.approx(level.viscous, rel=1e-6, abs=1e-9)
    assert fast[0] - level.viscous == pytest.approx(level.Fc, rel=1e-4, abs=1e-9)


def _number(text: str | None) -> bool:
    try:
        float(text or "")
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(
    "law", [law for law in discover_laws(laws_folder()) if law_of(law.name)], ids=lambda law: law.name
)
def test_rows_of_laws_name_their_parameters(law) -> None:  # type: ignore[no-untyped-def]
    """A row reads nothing but what the law has; with the start values its rules can be evaluated."""
    values = {variable.name: float(variable.start) for variable in law.variables if np.isscalar(variable.start)}
    vectors = [variable for variable in law.variables if not np.isscalar(variable.start)]
    values |= {f"{vector.name}[{i + 1}]": value for vector in vectors for i, value in enumerate(vector.start)}
    servo = ActiveLaw("pid", named("PID"), {"Kp": 12e3, "Kd": 600.0, "Ki": 0.0, "m": 0.0, "Ts": 1e-3})
    level = Level(1.0, 1.5, 0.4, 1e-3)
    used = ActiveLaw("law", named(law.name), values)
    axis = Axis("mass", 1.0, friction="fric", contact=AxisFriction((level, level), 1e5, 316.0), laws=(servo, used))
    assert list(examine_axis(axis))
    if used.law.gains is not None:
        assert used.gains is not None
