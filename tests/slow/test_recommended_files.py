"""The files of the recommendation move the axis as the study did, for every kind of compensator.

The rms tracking error of the study is compared with that of the SSP archive, run by the command line and read back, and
with that of the C code: it is compiled by gcc and called by a Python function in a system that is connected as the
README of the folder says, and in no other way.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from thorough import nightly, some

from friction_fmus.__main__ import main
from friction_fmus.axis.loop_assembly import block
from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.axis.servo import AxisPlant, Compensator, Trajectory
from friction_fmus.axis.servo_loop import LoopTrace, run_loop
from friction_fmus.identification import LINEAR, identifiable
from friction_fmus.identification.fit.contact_model import contact_model
from friction_fmus.study import Servo
from friction_fmus.study.compensators import AxisKnowledge, candidates, compensators
from friction_fmus.study.data import LUGRE, build_reference
from friction_fmus.study.evaluation import AxisBench, Scheme, evaluate, judge
from friction_fmus.study.study_files import Figures, export_recommended
from harness import CallablePart, Experiment, FmuPart, Part, Port, System, Wire

TS = 1e-3
SERVO = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, TS, 20.0, quantum=1e-7)
CONTACT = {**LUGRE, "sigma0": 4e4}  # soft enough for the explicit master, which repeats a run to the last bits
PLANT = AxisPlant("LuGre", CONTACT, 1.0, 0.2)
T = TS * np.arange(1001.0)
R = 4e-3 * (1.0 - np.cos(4.0 * np.pi * T))
KINDS = {  # with gains at which the gain matters
    "feedforward": "LuGreFeedforward",
    "model feedback": "LuGreObserver",
    "estimator": "DisturbanceObserver",
    "estimator within a controller": "ExtendedStateObserver",
    "dither": "Dither",
    "learning": "RepetitiveController",
    "feedforward with estimator": "LuGreFeedforward + DisturbanceObserver",
    "feedforward with an output of a controller": "StaticFeedforward + ExtendedStateObserver",
}
GAIN = 0.8
CHOSEN = some([*KINDS], [*KINDS][:1])
FEEDFORWARD = Compensator("StaticFeedforward", "u", {"Fc": 1.0, "m": 0.0})


@dataclass(frozen=True)
class Recommended:
    folder: Path
    bench: AxisBench
    scheme: Scheme
    rms: float


def start_values(name: str) -> dict[str, float]:
    return {parameter.name: parameter.start for parameter in contact_model(name, LINEAR).parameters.values()}


def recommended(name: str, out: Path) -> Recommended:
    """Export a compensator as a study does that recommends it."""
    reference = build_reference(T, R, out, "Reference")
    bench = AxisBench(SERVO, PLANT, Trajectory(reference, len(T), 0.0, 0.0, motion=True, offset=0.2), R)
    names = name.split(" + ")
    wanted = {model for law in names for model in compensators()[law].models} & set(identifiable())
    models = {model: start_values(model) for model in wanted}
    known = AxisKnowledge(SERVO, PLANT, {**models, "LuGre": CONTACT}, period=500, speed=0.05)
    laws = [candidate.compensator for candidate in candidates(names, known)]
    scheme = Scheme(SERVO, GAIN, compensator=laws[-1], feedforward=laws[0] if len(laws) > 1 else None)
    found = evaluate(bench, [scheme], ())
    assert found.metrics is not None
    export_recommended(out, bench, scheme, "test", "", Figures(found.metrics.rms, "m"))
    return Recommended(out / "recommended", bench, scheme, found.metrics.rms)


@pytest.fixture(scope="module", params=[KINDS[kind] for kind in CHOSEN], ids=CHOSEN)
def files(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Recommended:
    return recommended(request.param, tmp_path_factory.mktemp("recommended"))


def tolerance(files: Recommended, explicit: float) -> float:
    """With dither, the iterations of the master end at a residual of 3e-8 that counts."""
    assert files.scheme.compensator is not None
    return 1e-5 if files.scheme.compensator.model == "Dither" else explicit


def rms_of(trace: LoopTrace, files: Recommended) -> float:
    metrics, _, failure = judge(trace, files.bench)
    assert metrics is not None, failure
    return metrics.rms


@nightly
def test_the_gain_changes_the_error(files: Recommended) -> None:
    """So that a run with another gain would not pass as the recommended one."""
    none = evaluate(files.bench, [Scheme(SERVO)], ()).metrics
    full = evaluate(files.bench, [replace(files.scheme, gain=1.0)], ()).metrics
    assert none is not None
    assert full is not None
    assert abs(full.rms / files.rms - 1.0) > 5e-4
    assert abs(none.rms / files.rms - 1.0) > 1e-3


def test_the_archive_repeats_the_run(files: Recommended, tmp_path: Path) -> None:
    with System.from_ssp(files.folder / "axis.ssp") as system:
        assert rms_of(run_loop(system), files) == pytest.approx(files.rms, rel=tolerance(files, 1e-9))
    assert main(["run", str(files.folder / "axis.ssp"), "-o", str(tmp_path / "run.csv")]) == 0
    head, *rows = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    names = [re.sub(r" ?\[.*", "", name).strip('"') for name in head.split(",")]
    table = dict(zip(names, np.array([row.split(",") for row in rows], dtype=float).T, strict=True))
    error = table["reference.r"] - table["axis.x"]
    assert table["tracking_error.y"] == pytest.approx(error, abs=1e-15)
    np.testing.assert_allclose(table["reference.r"][:-1], R, atol=1e-12)
    assert np.max(np.abs(error[-3:])) < 2.0 * np.max(np.abs(error[-30:-3]))
    trace = LoopTrace(table["axis.x"][:-1], table["servo.u"][1:])
    assert rms_of(trace, files) == pytest.approx(files.rms, rel=tolerance(files, 1e-6))


def test_one_fmu_moves_as_the_archive(files: Recommended) -> None:
    """`servo_axis.fmu` reads the reference of the archive once a sample; `axis.fmu` has the drive force only."""
    with System.from_ssp(files.folder / "axis.ssp") as system:
        experiment, reference = system.experiment, system.parts["reference"]
        assert experiment is not None
        assert isinstance(reference, FmuPart)
        expected = system.run(master="newton", record=["axis.x"], decimate=EVERY)["axis.x"].to_numpy()
        one = FmuPart("one", files.folder / "servo_axis.fmu")
        wires = [f"{port.name} -> one.{port.name}" for port in one.inputs]
        start = {name: value for name, value in system.start.items() if name.startswith("reference.")}
        again = FmuPart("reference", reference.path)
        with System([again, one], wires, start) as alone:
            order = ["one", "reference"]  # laws take their samples at the beginning of a step
            result = alone.run(stop=experiment.stop, step=EVERY * experiment.step, record=["one.axis.x"], order=order)
    found = result["one.axis.x"].to_numpy()
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()
    assert [port.name for port in FmuPart("one", files.folder / "axis.fmu").inputs] == ["axis.F_drive"]


@nightly
def test_the_archive_records_the_error_with_a_rigid_contact(tmp_path: Path) -> None:
    """It needs the implicit master, under which other parts are stepped after the contact."""
    plant = AxisPlant("Coulomb", {"Fc": 1.0}, 1.0, 0.2)
    reference = build_reference(T, R, tmp_path, "Reference")
    bench = AxisBench(SERVO, plant, Trajectory(reference, len(T), 0.0, 0.0, motion=True, offset=0.2), R)
    export_recommended(tmp_path, bench, Scheme(SERVO), "test", "", None)
    with System.from_ssp(tmp_path / "recommended" / "axis.ssp") as system:
        assert system.experiment is not None
        assert system.experiment.master == "newton"
        result = system.run()
    error = result["reference.r"].values - result["axis.x"].values
    np.testing.assert_allclose(result["tracking_error.y"].values, error, atol=1e-15)
    np.testing.assert_allclose(result["reference.r"].values[:-1], R, atol=1e-12)


def test_the_readme_names_the_figure(files: Recommended) -> None:
    text = (files.folder / "README.md").read_text(encoding="utf-8")
    assert f"{files.rms:.4g} m rms" in " ".join(text.split())
    assert files.scheme.compensator is not None
    if files.scheme.compensator.model == "ExtendedStateObserver":
        assert "Use the output `F_hat` of `compensator`" in text


def test_fmus_connected_as_the_readme_says(files: Recommended) -> None:
    given = {"compensator": files.scheme.compensator, "feedforward": files.scheme.feedforward}
    laws = [
        FmuPart(name, files.folder / f"{law.model}.fmu", every=EVERY) for name, law in given.items() if law is not None
    ]
    with by_hand(files, laws) as system:
        assert rms_of(run_loop(system), files) == pytest.approx(files.rms, rel=tolerance(files, 1e-6))


CODED = {kind: name for kind, name in KINDS.items() if name != "RepetitiveController"}


@pytest.mark.parametrize("files", some([*CODED.values()], [*CODED.values()][:1]), indirect=True)
def test_the_code_is_the_whole_controller(files: Recommended, tmp_path: Path) -> None:
    """One call a sample, with the bits of the separate FMUs; with dither, the axis moves within `tolerance`."""
    with System.from_ssp(files.folder / "axis.ssp") as system:
        expected, experiment = run_loop(system), system.experiment
    assert experiment is not None
    with in_one(files, compiled("servo", files.folder / "c", "loop", tmp_path), experiment) as system:
        found = run_loop(system)
    assert rms_of(found, files) == pytest.approx(files.rms, rel=tolerance(files, 1e-9))
    if tolerance(files, 0.0) == 0.0:
        np.testing.assert_array_equal(found.force, expected.force)
        np.testing.assert_array_equal(found.q, expected.q)
    np.testing.assert_array_equal(*replayed(files.folder, tmp_path))


def replayed(folder: Path, tmp_path: Path, f_known: str = "") -> tuple[np.ndarray, np.ndarray]:
    """The force of the separate FMUs, and that of the code with the recorded inputs of the servo."""
    with System.from_ssp(folder / "axis.ssp") as system:
        assert system.experiment is not None
        inputs = {name: f"servo.{name}" for name in ("r", "rd", "rdd", "x")} | ({"f_known": f_known} if f_known else {})
        experiment = replace(system.experiment, record=("servo.u", *inputs.values()))
        result = System(system.parts.values(), system.wires, system.start, experiment).run()
    unit = compiled("servo", folder / "c", "loop", tmp_path)
    place = [port.name for port in unit.outputs].index("u")
    columns = [result[inputs[port.name]].values[1:] for port in unit.inputs]  # in the sample that ends at a row
    state, found = unit.initial_state, []
    for row in np.array(columns).T:
        found.append(unit.function(0.0, row, state)[place])
        state = unit.advance(0.0, 0.0, row, state)
    return result["servo.u"].values[1:], np.array(found)


@nightly
def test_a_table_over_position_is_an_input_of_the_code(tmp_path: Path) -> None:
    nodes = 33
    ripple = tuple(0.5 * np.sin(2.0 * np.pi * np.linspace(0.0, 4.0, nodes)))
    table = PositionMap(Grid(-2e-3, 12e-3 / (nodes - 1), nodes), ripple, (0.1,) * nodes, 1e-3)
    reference = build_reference(T, R, tmp_path, "Reference")
    bench = AxisBench(SERVO, replace(PLANT, position=table), Trajectory(reference, len(T), 0.0, 0.0, motion=True), R)
    both = {"compensator": Compensator("DisturbanceObserver", "u", {"m": 1.0}), "feedforward": FEEDFORWARD}
    export_recommended(tmp_path, bench, Scheme(SERVO, 0.8, table=True, **both), "test", "", None)
    folder = tmp_path / "recommended"
    text = " ".join((folder / "README.md").read_text(encoding="utf-8").split())
    assert "assign reference and measured position to `loop_inputs`, `loop_table(r, rd)` to `f_known`" in text
    expected, found = replayed(folder, tmp_path, "force.u3")
    np.testing.assert_array_equal(found, expected)
    with System.from_ssp(folder / "axis.ssp") as system:
        assert system.experiment is not None
        names = ("force.u3", "servo.r", "servo.rd")
        experiment = replace(system.experiment, record=names)
        result = System(system.parts.values(), system.wires, system.start, experiment).run()
    force, r, rd = (result[name].values[1:] for name in names)
    np.testing.assert_allclose(force, -table.force(r, rd), atol=1e-12)  # without a delay
    np.testing.assert_array_equal(force, in_c(folder / "c", r, rd, tmp_path))
    assert np.ptp(force) > 0.5


@nightly
def test_a_controller_in_c_has_no_code(tmp_path: Path) -> None:
    files = recommended("RepetitiveController", tmp_path)
    assert not (files.folder / "c").exists()
    assert not (files.folder / "loop.toml").exists()
    text = (files.folder / "README.md").read_text(encoding="utf-8")
    assert "no C code of the loop, because RepetitiveController is a block in C" in " ".join(text.split())


@nightly
def test_integral_action_is_recommended_with_code(tmp_path: Path) -> None:
    """The servo without a law beside it; its integral is part of the unit."""
    reference = build_reference(T, R, tmp_path, "Reference")
    bench = AxisBench(SERVO, PLANT, Trajectory(reference, len(T), 0.0, 0.0, motion=True, offset=0.2), R)
    servo = replace(SERVO, gains={**SERVO.gains, "Ki": 1e5})
    found = evaluate(bench, [Scheme(servo)], ())
    assert found.metrics is not None
    export_recommended(tmp_path, bench, Scheme(servo), "test", "", Figures(found.metrics.rms, "m"))
    files = Recommended(tmp_path / "recommended", bench, Scheme(servo), found.metrics.rms)
    with System.from_ssp(files.folder / "axis.ssp") as system:
        expected, experiment = run_loop(system), system.experiment
    assert experiment is not None
    with in_one(files, compiled("servo", files.folder / "c", "loop", tmp_path), experiment) as system:
        np.testing.assert_array_equal(run_loop(system).force, expected.force)


@nightly
def test_nothing_recommended_has_no_code(tmp_path: Path) -> None:
    reference = build_reference(T, R, tmp_path, "Reference")
    bench = AxisBench(SERVO, PLANT, Trajectory(reference, len(T), 0.0, 0.0, motion=True, offset=0.2), R)
    export_recommended(tmp_path, bench, Scheme(SERVO), "test", "", None)
    assert {path.name for path in (tmp_path / "recommended").iterdir()} == {
        *("README.md", "axis.ssp", "axis.fmu", "servo_axis.fmu")
    }
    text = (tmp_path / "recommended" / "README.md").read_text(encoding="utf-8")
    assert "No compensator is recommended" in text


def in_c(code: Path, r: np.ndarray, rd: np.ndarray, tmp_path: Path) -> np.ndarray:
    """The force over position by the C code."""
    library = tmp_path / "table.so"
    options = [
        "-std=c99",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Werror",
        "-ffp-contract=off",
        "-fPIC",
        "-shared",
    ]
    subprocess.run(["gcc", *options, "-o", str(library), str(code / "loop_table.c"), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).loop_table
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double, ctypes.c_double]
    return np.array([function(*pair) for pair in zip(r, rd, strict=True)])


EVERY = 2  # steps of the plant in a sample: 0.5 ms


def connections(readme: str) -> tuple[list[Wire], dict[str, float]]:
    """Read the table: connections, and constant inputs."""
    wires, constants = [], {}
    number = r"[-+]?[\d.]+(?:e[-+]?\d+)?"
    for target, value, delay in re.findall(r"^\| `(.+?)` \| (.+?) \| (\d+) \|$", readme, re.M):
        found = re.fullmatch(rf"(?:({number}) × )?`(.+?)`(?: ([-+]) ({number}))?", value)
        if found is None:
            constants[target] = float(value)
            continue
        offset = float(f"{found[3]}{found[4]}") if found[3] else 0.0
        wires.append(Wire(found[2], target, float(found[1] or 1.0), offset, EVERY * int(delay)))
    return wires, constants


def by_hand(files: Recommended, laws: Sequence[Part]) -> System:
    """Connect the FMUs of the library, with the parameters of servo and plant, as the README says."""
    wires, start = connections((files.folder / "README.md").read_text(encoding="utf-8"))
    parts: list[Part] = [FmuPart("reference", files.bench.trajectory.reference, every=EVERY), *laws]
    blocks = {"velocity": "Differentiator", "servo": "PID", "encoder": "Quantiser", "axis": "Mass", "friction": "LuGre"}
    sums = {wire.target.split(".")[0] for wire in wires} & {"force", "unexplained"}
    blocks |= dict.fromkeys(sums, "SampledSum")
    parts += [
        FmuPart(name, block(model), every=1 if name in ("axis", "friction") else EVERY)
        for name, model in blocks.items()
    ]
    values: dict[str, Mapping[str, float | int]] = {
        "servo": {**SERVO.gains, "Ts": TS, "m": 1.0, "u_min": -20.0, "u_max": 20.0},
        "velocity": {"Ts": TS, "window": 2},
        "encoder": {"q": 1e-7},
        "axis": {"m": 1.0, "F_load": -0.2},
        "friction": CONTACT,
    }
    plant = ["axis.x -> encoder.x", "servo.u -> axis.F_drive", "axis.v -> friction.v", "friction.F -> axis.F_friction"]
    given = {f"{part}.{name}": value for part, own in values.items() for name, value in own.items()}
    experiment = Experiment(
        stop=len(T) * TS, step=TS / EVERY, master="newton", record=("axis.x", "servo.u"), decimate=EVERY
    )
    return System(parts, [*wires, *plant], {**given, **start}, experiment)


def in_one(files: Recommended, controller: Part, experiment: Experiment) -> System:
    """The axis with a controller that has the reference and the measured position as inputs."""
    parts: list[Part] = [FmuPart("reference", files.bench.trajectory.reference, every=EVERY), controller]
    parts.append(FmuPart("encoder", block("Quantiser"), every=EVERY))
    parts += [FmuPart(name, block(model)) for name, model in (("axis", "Mass"), ("friction", "LuGre"))]
    wires = [f"reference.{name} -> servo.{name}" for name in ("r", "rd", "rdd")]
    wires += ["axis.x -> encoder.x", "encoder.y -> servo.x", "servo.u -> axis.F_drive"]
    wires += ["axis.v -> friction.v", "friction.F -> axis.F_friction"]
    trajectory = files.bench.trajectory
    start = {"encoder.q": 1e-7, "axis.m": 1.0, "axis.F_load": -0.2, "axis.x0": trajectory.x0, "axis.v0": trajectory.v0}
    start |= {f"friction.{name}": value for name, value in CONTACT.items()}
    return System(parts, wires, start, replace(experiment, record=("axis.x", "servo.u")))


def compiled(name: str, code: Path, prefix: str, tmp_path: Path) -> CallablePart:
    """Compile C code and return it as a part that calls its function `step` in every sample."""
    library = tmp_path / f"{name}.so"
    options = ["-std=c99", "-O1", "-ffp-contract=off", "-fPIC", "-shared"]
    subprocess.run(["gcc", *options, "-o", str(library), str(code / f"{prefix}.c"), "-lm"], check=True)
    init, check, step = (getattr(ctypes.CDLL(str(library)), f"{prefix}_{what}") for what in ("init", "check", "step"))
    header = (code / f"{prefix}.h").read_text(encoding="utf-8")
    parameters, states, inputs, outputs = (structure(header, f"{prefix}_{group}")() for group in GROUPS)
    init(*map(ctypes.byref, (parameters, states, inputs, outputs)))
    assert check(ctypes.byref(parameters)) == 0

    def computed(u: np.ndarray, x: np.ndarray) -> None:
        if len(x):
            ctypes.memmove(ctypes.byref(states), np.ascontiguousarray(x).ctypes.data, 8 * len(x))
        for port, value in zip(ports, u, strict=True):
            setattr(inputs, port.name, value)
        step(*map(ctypes.byref, (parameters, states, inputs, outputs)))

    def output(t: float, u: np.ndarray, x: np.ndarray) -> list[float]:
        computed(u, x)
        return [getattr(outputs, name) for name in names]

    def advance(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        computed(u, x)
        return numbers(states)

    fields = [name for name, _ in inputs._fields_]
    ports = [Port(name) for name in ("r", "rd", "rdd", "x", "f_known") if name in fields]
    names = [name for name, kind in outputs._fields_ if kind is ctypes.c_double]
    return CallablePart(
        name,
        output,
        ports,
        [Port(name) for name in names],
        advance=advance,
        state=numbers(states),
        sampled=True,
        every=EVERY,
    )


GROUPS = ("parameters", "states", "inputs", "outputs")


def structure(header: str, group: str) -> type[ctypes.Structure]:
    """Return a struct of the header."""
    found = re.search(rf"typedef struct \{{([^}}]*)\}} {group};", header)
    assert found is not None
    fields: list[tuple[str, type]] = []
    for kind, field, size in re.findall(r"^\s+(double|bool) (\w+)(?:\[(\d+)\])?;", found[1], re.M):
        base = ctypes.c_double if kind == "double" else ctypes.c_bool
        fields.append((field, base * int(size) if size else base))
    return type(group, (ctypes.Structure,), {"_fields_": fields})


def numbers(struct: ctypes.Structure) -> np.ndarray:
    """Return a struct of doubles as an array."""
    return np.frombuffer(bytes(struct), dtype=np.float64).copy()
