"""The loop compiled for one system, against the loop for all systems: the same values, measures, errors, to the bit."""

from __future__ import annotations

import logging
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import landing

import harness
from friction_fmus import build
from harness import CallablePart, ExperimentError, FmuPart, HarnessError, PartError, Result, System, Tap
from harness.compiling.toolchain import source_folder
from harness.engine import compiled

BuildFmu = Callable[..., Path]
PARTS = {"profile": "Profile", "pid": "PID", "mass": "Mass", "friction": "LuGre"}
WIRES = (
    *("profile.r -> pid.r", "profile.rd -> pid.rd", "profile.rdd -> pid.rdd"),
    *("mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive"),
    *("mass.v -> friction.v", "friction.F -> mass.F_friction"),
)
START = {"profile.cyclic": 1.0, "pid.Kp": 12e3, "pid.Kd": 190.0, "pid.Ts": 1e-3}
SETTINGS = {"stop": 0.8, "step": 1e-3}
MADE = "the engine is compiled for this system"


@pytest.fixture
def servo(build_fmu: BuildFmu) -> Iterator[System]:
    with System([FmuPart(name, build_fmu(model)) for name, model in PARTS.items()], WIRES, START, SETTINGS) as system:
        yield system


def same(one: Result, other: Result) -> bool:
    return one.equals(other) and one.attrs == other.attrs


def test_values_and_measures_are_those_of_the_general_loop(servo: System, caplog: pytest.LogCaptureFixture) -> None:
    for settings in ({}, {"record": ["mass.x", "friction.F"], "decimate": 7}, {"step": 5e-3}):  # the last one is warned
        seen: dict[str, list[tuple[float, float]]] = {}
        results = {}
        for engine in ("general", "compiled"):
            rows = seen[engine] = []

            def read(t: float, u: np.ndarray, rows: list[tuple[float, float]] = rows) -> None:
                rows.append((t, float(u[0])))

            results[engine] = servo.run(engine=engine, taps=[Tap(read, ("mass.v",), every=13)], **settings)
        assert same(results["general"], results["compiled"])
        assert seen["general"] == seen["compiled"]
        assert len(seen["general"]) > 3
    assert results["general"].attrs["coupling_error"] > 0.0
    with caplog.at_level(logging.INFO, "harness"):
        servo.run(engine="general")
        assert MADE not in caplog.text
        servo.run(engine="compiled")
        assert MADE in caplog.text


@landing
@pytest.mark.parametrize("friction", ["Coulomb", "GMS"])
def test_contacts_that_stick_and_flags(build_fmu: BuildFmu, friction: str) -> None:
    """A controller with Boolean inputs, and a contact that passes v = 0, whose rest the engine looks for."""
    parts = [FmuPart(name, build_fmu(friction if name == "friction" else model)) for name, model in PARTS.items()]
    load = ["mass.F_ext -> friction.F_ext"] if friction == "Coulomb" else []
    with System(parts, [*WIRES, *load], {**START, "pid.enable": 1.0}) as system:
        general, compiled_ = (system.run(stop=2.0, step=1e-3, engine=engine) for engine in ("general", "compiled"))
        assert same(general, compiled_)


def test_a_run_goes_on_from_the_checkpoint_of_the_other_loop(servo: System, tmp_path: Path) -> None:
    whole = servo.run(engine="general")
    for first, second in (("general", "compiled"), ("compiled", "general")):
        servo.run(stop=0.4, engine=first, checkpoint=tmp_path / "half")
        rest = servo.run(engine=second, resume=tmp_path / "half")
        assert rest.equals(whole.isel(time=slice(-rest.sizes["time"], None)))
        assert rest.attrs == whole.attrs


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        ({"friction.sigma2": 1e300, "mass.m": 1e-12}, "mass"),  # its velocity overflows
        ({"pid.Kp": 1e306, "mass.m": 1e-12}, "friction"),  # later
    ],
)
def test_a_part_that_fails_fails_in_the_same_step(servo: System, start: dict[str, float], reason: str) -> None:
    errors = []
    for engine in ("general", "compiled"):
        with servo.with_start(start) as system, pytest.raises(PartError) as caught:
            system.run(engine=engine)
        errors.append(caught.value)
    first, second = errors
    assert (str(first), first.part, first.time) == (str(second), second.part, second.time)
    assert first.part == reason
    assert (first.result is None) == (second.result is None)
    assert first.result is None or first.result.equals(second.result)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"master": "newton"}, "its master does not step one part after the other, as gauss-seidel does"),
        ({"master": "jacobi"}, "its master does not step one part after the other"),
        ({"gain": 2.0}, "it has manipulators, connections with a factor"),
        ({"other": True}, "'probe' is not a block or a law of this project as an FMI 2.0 FMU"),
        ({"every": 2}, "parts with a sample time of their own"),
    ],
)
def test_what_cannot_be_compiled_is_refused_and_runs_by_itself(
    build_fmu: BuildFmu, monkeypatch: pytest.MonkeyPatch, change: dict[str, Any], reason: str
) -> None:
    parts: list[harness.Part] = [
        FmuPart(name, build_fmu(model), every=change.get("every", 1) if name == "profile" else 1)
        for name, model in PARTS.items()
    ]
    wires: list[Any] = [*WIRES]
    if "gain" in change:
        wires[0] = harness.Wire("profile.r", "pid.r", gain=2.0)
    if "other" in change:
        parts.append(CallablePart("probe", lambda t, u, x: u[0], ["u"], ["y"]))
        wires.append("mass.x -> probe.u")
    master = change.get("master", "gauss-seidel")
    with System(parts, wires, START, {**SETTINGS, "master": master}) as system:
        with pytest.raises(HarnessError, match="the engine cannot be compiled for this system") as caught:
            system.run(engine="compiled")
        assert reason in str(caught.value)
        if master == "newton":
            with pytest.raises(HarnessError, match=reason):
                system.batch(2, engine="compiled")
        monkeypatch.setattr(compiled, "WORTH", 1)
        assert same(system.run(), system.run(engine="general"))


def test_a_long_run_is_compiled_by_itself(
    servo: System, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "harness"):
        servo.run()
        assert MADE not in caplog.text
        monkeypatch.setattr(compiled, "WORTH", 4 * 800)
        servo.run(stop=0.799)
        assert MADE not in caplog.text
        servo.run()
        assert MADE in caplog.text


def test_an_unknown_engine_is_named(servo: System) -> None:
    for call in (servo.run, lambda engine: servo.batch(2, engine=engine), lambda engine: sweep(servo, engine)):
        with pytest.raises(ExperimentError, match=r"there is no engine 'compild'; did you mean 'compiled'\?"):
            call(engine="compild")


def sweep(system: System, engine: str, **settings: Any) -> Any:
    samples = [{"mass.m": m} for m in (0.5, 1.0, -1.0, 2.0)]
    return harness.sweep(system, samples, measure=["final(mass.x)", "rms(friction.F)"], engine=engine, **settings)


@pytest.mark.parametrize("executor", ["serial", pytest.param("processes", marks=landing)])
def test_a_sweep_has_the_same_table(servo: System, executor: str) -> None:
    general, made = (sweep(servo, engine, executor=executor, workers=2) for engine in ("general", "compiled"))
    same_columns = [name for name in general if name != "wall_time"]
    assert general[same_columns].equals(made[same_columns])
    assert (general["error"].to_numpy() != "").tolist() == [False, False, True, False]


@landing
def test_copies_of_a_batch_are_the_same_and_fail_alike(build_fmu: BuildFmu, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = [FmuPart(name, build_fmu(model)) for name, model in PARTS.items() if name != "profile"]
    start = {**START, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.r": 0.0, "friction.sigma2": 1e150}
    del start["profile.cyclic"]
    actions = np.random.default_rng(1).uniform(-1e-3, 1e-3, (5, 40, 1))
    actions[2, 17] = np.nan
    masses = np.linspace(0.5, 2.0, 40)
    masses[5] = 1e-12
    found = []
    for engine in ("general", "compiled", "auto"):
        monkeypatch.setattr(compiled, "WORTH", 3 * 40 * 20)  # by itself after two calls
        with (
            System(parts, WIRES[3:], start, SETTINGS) as system,
            system.batch(
                40, inputs=["pid.r"], outputs=["mass.x", "friction.F"], start={"mass.m": masses}, engine=engine
            ) as batch,
        ):
            for action in actions:
                batch.step(action, 10)
                found.append((batch.values.copy(), {number: str(error) for number, error in batch.failures.items()}))
    for general, *others in zip(found[:5], found[5:10], found[10:], strict=True):
        for other in others:
            assert np.array_equal(general[0], other[0])
            assert general[1] == other[1]
    assert {*found[2][1]} >= {5, 17}


FOREIGN = "the library of 'friction' was not made from the sources in its FMU"


@pytest.mark.parametrize(
    ("line", "other"),
    [
        (b"    STATE    (z,", b'    LOCAL(more, FORCE, "added") \\\n    STATE    (z,'),
        (b"m->F = ", b"m->F = 2.0 * "),  # the layout is the same
        (b"#define IDENTITY", b"#define OTHER"),
    ],
)
def test_a_library_that_is_not_of_its_sources_is_not_compiled(
    build_fmu: BuildFmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: bytes, other: bytes
) -> None:
    changed = tmp_path / "LuGre.fmu"
    with zipfile.ZipFile(build_fmu("LuGre")) as source, zipfile.ZipFile(changed, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "sources/LuGre.c":
                assert line in data
                data = data.replace(line, other, 1)
            target.writestr(name, data)
    paths = {name: changed if name == "friction" else build_fmu(model) for name, model in PARTS.items()}
    with System([FmuPart(name, path) for name, path in paths.items()], WIRES, START, SETTINGS) as system:
        monkeypatch.setattr(compiled, "_LOADED", {})
        with pytest.raises(HarnessError, match=FOREIGN):
            system.run(engine="compiled")


@landing
def test_an_fmu_that_is_built_again_while_its_library_is_loaded_is_not_compiled(
    build_fmu: BuildFmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file has other sources, of a library with the same layout; its first content is compiled afterwards."""
    monkeypatch.setattr(compiled, "_LOADED", {})
    friction = tmp_path / "LuGre.fmu"
    friction.write_bytes(build_fmu("LuGre").read_bytes())
    paths = {name: friction if name == "friction" else build_fmu(model) for name, model in PARTS.items()}
    with System([FmuPart(name, path) for name, path in paths.items()], WIRES, START, SETTINGS) as system:
        general = system.run()
        friction.write_bytes(build_fmu("LuGre", Fc=2.0).read_bytes())
        with pytest.raises(HarnessError, match=FOREIGN):
            system.run(engine="compiled")
        friction.write_bytes(build_fmu("LuGre").read_bytes())
        assert same(system.run(engine="compiled"), general)


@landing
@pytest.mark.skipif(sys.platform != "linux", reason="not known elsewhere")
def test_a_model_with_static_variables_is_not_compiled(
    build_fmu: BuildFmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library has set them at the start, to a friction of 1 N; the loop would take 0."""
    code = (source_folder() / "friction" / "Viscous.c").read_text(encoding="utf-8")
    code = code.replace("static void equations", "static double level;\n\nstatic void equations")
    code = code.replace("    m->F = ", "    if (m->run.mode == INITIALIZING)\n    level = 1.0;\n    m->F = level + ")
    (tmp_path / "Viscous.c").write_text(code, encoding="utf-8")
    paths = {name: build_fmu(model) for name, model in PARTS.items()}
    paths["friction"] = build(tmp_path / "Viscous.c", tmp_path / "fmus")
    monkeypatch.setattr(compiled, "_LOADED", {})
    with System([FmuPart(name, path) for name, path in paths.items()], WIRES, START, SETTINGS) as system:
        assert system.run()["friction.F"].min() > 0.9
        with pytest.raises(HarnessError, match="a part has static variables"):
            system.run(engine="compiled")


def test_without_a_compiler_it_is_refused_and_runs_by_itself(servo: System, monkeypatch: pytest.MonkeyPatch) -> None:
    general = servo.run(engine="general")
    monkeypatch.setattr(compiled, "_LOADED", {})
    monkeypatch.setenv("CC", "/no/such/compiler")
    with pytest.raises(HarnessError, match=r"the engine cannot be compiled for this system: .*/no/such/compiler"):
        servo.run(engine="compiled")
    monkeypatch.setattr(compiled, "WORTH", 1)
    assert same(servo.run(), general)


@pytest.mark.parametrize("lacking", ["room", "file", "archive"])
def test_without_files_it_is_refused_and_runs_by_itself(
    build_fmu: BuildFmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lacking: str
) -> None:
    """A long run must not end because a temporary folder is full, or the file of an FMU is gone."""
    friction = tmp_path / "LuGre.fmu"
    friction.write_bytes(build_fmu("LuGre").read_bytes())
    paths = {name: friction if name == "friction" else build_fmu(model) for name, model in PARTS.items()}
    with System([FmuPart(name, path) for name, path in paths.items()], WIRES, START, SETTINGS) as system:
        general = system.run(engine="general")
        monkeypatch.setattr(compiled, "_LOADED", {})
        if lacking == "room":
            monkeypatch.setenv("FRICTION_FMUS_CACHE", str(tmp_path / "cache"))
            monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
        elif lacking == "file":
            friction.unlink()
        else:
            friction.write_bytes(b"no archive")
        with pytest.raises(HarnessError, match="the engine cannot be compiled for this system"):
            system.run(engine="compiled")
        monkeypatch.setattr(compiled, "WORTH", 1)
        assert same(system.run(), general)
