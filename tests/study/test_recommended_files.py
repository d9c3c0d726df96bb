"""The files of the recommendation move the axis as the study did, for every kind of compensator.

The rms tracking error of the study is compared with that of the SSP archive, run by the command line and read back, and
with that of the C code: it is compiled by gcc and called by a Python function in a system that is connected as the
README of the folder says, and in no other way.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.__main__ import main
from friction_fmus.axis.loop import Plant, Trace, Trajectory, block, run_loop
from friction_fmus.identification import LINEAR, identifiable
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.study import Servo
from friction_fmus.study.compensators import AxisKnowledge, Candidate, candidates, compensators
from friction_fmus.study.data import LUGRE, build_reference
from friction_fmus.study.evaluation import Scheme, evaluate
from friction_fmus.study.export import export_recommended
from friction_fmus.study.metrics import Bench, judge
from friction_fmus.study.wiring import Figures
from harness import CallablePart, Experiment, FmuPart, Part, Port, System, Wire

TS = 1e-3
SERVO = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 0.0}, TS, 20.0, quantum=1e-7)
PLANT = Plant("LuGre", LUGRE, 1.0, 0.2)
T = TS * np.arange(1001.0)
R = 4e-3 * (1.0 - np.cos(4.0 * np.pi * T))
KINDS = {  # with gains at which the gain matters
    "feedforward": "LuGreFeedforward",
    "model feedback": "LuGreObserver",
    "estimator": "DisturbanceObserver",
    "estimator within a controller": "ExtendedStateObserver",
    "dither": "Dither",
    "learning": "RepetitiveController",
}
GAIN = 0.8


@dataclass(frozen=True)
class Recommended:
    folder: Path
    bench: Bench
    candidate: Candidate
    rms: float


def start_values(name: str) -> dict[str, float]:
    return {parameter.name: parameter.start for parameter in contact_model(name, LINEAR).parameters.values()}


def recommended(name: str, out: Path) -> Recommended:
    """Export a compensator as a study does that recommends it."""
    reference = build_reference(T, R, out, "Reference")
    bench = Bench(SERVO, PLANT, Trajectory(reference, len(T), 0.0, 0.0, motion=True, offset=0.2), R)
    models = {model: start_values(model) for model in set(compensators()[name].models) & set(identifiable())}
    known = AxisKnowledge(SERVO, PLANT, {**models, "LuGre": LUGRE}, period=500, speed=0.05)
    (candidate,) = candidates([name], known)
    scheme = Scheme(SERVO, GAIN, compensator=candidate.compensator)
    found = evaluate(bench, [scheme], ())
    assert found.metrics is not None
    export_recommended(out, bench, scheme, "test", "", Figures(found.metrics.rms, "m"))
    return Recommended(out / "recommended", bench, candidate, found.metrics.rms)


@pytest.fixture(scope="module", params=KINDS.values(), ids=KINDS)
def files(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Recommended:
    return recommended(request.param, tmp_path_factory.mktemp("recommended"))


def rms_of(trace: Trace, files: Recommended) -> float:
    metrics, _, failure = judge(trace, files.bench)
    assert metrics is not None, failure
    return metrics.rms


def test_the_gain_changes_the_error(files: Recommended) -> None:
    """So that a run with another gain would not pass as the recommended one."""
    none = evaluate(files.bench, [Scheme(SERVO)], ()).metrics
    full = evaluate(files.bench, [Scheme(SERVO, compensator=files.candidate.compensator)], ()).metrics
    assert none is not None
    assert full is not None
    assert abs(full.rms / files.rms - 1.0) > 5e-4
    assert abs(none.rms / files.rms - 1.0) > 1e-3


def test_the_archive_repeats_the_run(files: Recommended, tmp_path: Path) -> None:
    with System.from_ssp(files.folder / "axis.ssp") as system:
        assert rms_of(run_loop(system), files) == pytest.approx(files.rms, rel=1e-9)
    assert main(["run", str(files.folder / "axis.ssp"), "-o", str(tmp_path / "run.csv")]) == 0
    head, *rows = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    names = [re.sub(r" ?\[.*", "", name).strip('"') for name in head.split(",")]
    table = dict(zip(names, np.array([row.split(",") for row in rows], dtype=float).T, strict=True))
    error = table["reference.r"] - table["axis.x"]
    assert table["tracking_error.y"] == pytest.approx(error, abs=1e-15)
    np.testing.assert_allclose(table["reference.r"][:-1], R, atol=1e-12)
    assert np.max(np.abs(error[-3:])) < 2.0 * np.max(np.abs(error[-30:-3]))
    trace = Trace(table["axis.x"][:-1], table["servo.u"][1:])
    assert rms_of(trace, files) == pytest.approx(files.rms, rel=1e-6)


def test_the_readme_names_the_figure(files: Recommended) -> None:
    text = (files.folder / "README.md").read_text(encoding="utf-8")
    assert f"{files.rms:.4g} m rms" in " ".join(text.split())
    if files.candidate.name == "ExtendedStateObserver":
        assert "Use the output `F_hat` of `compensator`" in text


def test_the_code_connected_as_the_readme_says(files: Recommended, tmp_path: Path) -> None:
    if not (files.folder / "c").is_dir():
        assert files.candidate.name == "RepetitiveController"
        law: Part = FmuPart("compensator", files.folder / "RepetitiveController.fmu", every=EVERY)
    else:
        law = compiled(files, tmp_path)
    with by_hand(files, law) as system:
        assert rms_of(run_loop(system), files) == pytest.approx(files.rms, rel=1e-6)


EVERY = 4  # steps of the plant in a sample: 0.25 ms


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


def by_hand(files: Recommended, law: Part) -> System:
    """Connect the FMUs of the library, with the parameters of servo and plant, as the README says."""
    wires, start = connections((files.folder / "README.md").read_text(encoding="utf-8"))
    parts: list[Part] = [FmuPart("reference", files.bench.trajectory.reference, every=EVERY), law]
    blocks = {"velocity": "Differentiator", "servo": "PID", "encoder": "Quantiser", "axis": "Mass", "friction": "LuGre"}
    parts += [
        FmuPart(name, block(model), every=1 if name in ("axis", "friction") else EVERY)
        for name, model in blocks.items()
    ]
    values: dict[str, Mapping[str, float | int]] = {
        "servo": {**SERVO.gains, "Ts": TS, "m": 1.0, "u_min": -20.0, "u_max": 20.0},
        "velocity": {"Ts": TS, "window": 2},
        "encoder": {"q": 1e-7},
        "axis": {"m": 1.0, "F_load": -0.2},
        "friction": LUGRE,
    }
    plant = ["axis.x -> encoder.x", "servo.u -> axis.F_drive", "axis.v -> friction.v", "friction.F -> axis.F_friction"]
    given = {f"{part}.{name}": value for part, own in values.items() for name, value in own.items()}
    experiment = Experiment(
        stop=len(T) * TS, step=TS / EVERY, master="gauss-seidel", record=("axis.x", "servo.u"), decimate=EVERY
    )
    return System(parts, [*wires, *plant], {**given, **start}, experiment)


def compiled(files: Recommended, tmp_path: Path) -> Part:
    """Compile the C code of the folder and return it as a part that computes `law_step` in every sample."""
    folder, library = files.folder / "c", tmp_path / "law.so"
    command = [
        "gcc",
        "-std=c99",
        "-O1",
        "-ffp-contract=off",
        "-fPIC",
        "-shared",
        "-o",
        library,
        folder / "law.c",
        "-lm",
    ]
    subprocess.run(list(map(str, command)), check=True)
    code = ctypes.CDLL(str(library))
    header = (folder / "law.h").read_text(encoding="utf-8")
    parameters, states, inputs, outputs = (structure(header, name)() for name in GROUPS)
    code.law_init(*map(ctypes.byref, (parameters, states, inputs, outputs)))
    assert code.law_check(ctypes.byref(parameters)) == 0

    def computed(u: np.ndarray, x: np.ndarray) -> None:
        if len(x):
            ctypes.memmove(ctypes.byref(states), np.ascontiguousarray(x).ctypes.data, 8 * len(x))
        for port, value in zip(ports, u, strict=True):
            setattr(inputs, port.name, value)
        code.law_step(*map(ctypes.byref, (parameters, states, inputs, outputs)))

    def output(t: float, u: np.ndarray, x: np.ndarray) -> list[float]:
        computed(u, x)
        return [getattr(outputs, name) for name in names]

    def advance(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        computed(u, x)
        return numbers(states)

    connected = files.folder / f"{files.candidate.name}.fmu"
    wired = {wire.target for wire in connections((files.folder / "README.md").read_text(encoding="utf-8"))[0]}
    ports = [port for port in FmuPart("law", connected).inputs if f"compensator.{port.name}" in wired]
    names = [name for name, kind in outputs._fields_ if kind is ctypes.c_double]
    return CallablePart(
        "compensator",
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
    found = re.search(rf"typedef struct \{{([^}}]*)\}} law_{group};", header)
    assert found is not None
    fields: list[tuple[str, type]] = []
    for kind, name, size in re.findall(r"^\s+(double|int) (\w+)(?:\[(\d+)\])?;", found[1], re.M):
        base = ctypes.c_double if kind == "double" else ctypes.c_int
        fields.append((name, base * int(size) if size else base))
    return type(group, (ctypes.Structure,), {"_fields_": fields})


def numbers(struct: ctypes.Structure) -> np.ndarray:
    """Return a struct of doubles as an array."""
    return np.frombuffer(bytes(struct), dtype=np.float64).copy()
