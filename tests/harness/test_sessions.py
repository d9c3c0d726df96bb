"""Runs that share a layout and their FMU instances give what a system made anew gives, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from thorough import some

from harness import CallablePart, DropOut, Experiment, FmuPart, HarnessError, Noise, PartError, SeriesPart, System, Wire
from harness.errors import StartValueError
from harness.run import Session
from harness.sweeps import sweep

BuildFmu = Callable[..., Path]
Loop = Callable[..., System]

WITH_MEMORY = (
    *("Bristle", "Dahl", "ElastoPlastic", "GMS", "GenericAsperity", "Leuven", "LuGre", "MaxwellSlip"),
    *("ModifiedLeuven", "RateAndState"),
)
SAMPLES: tuple[Mapping[str, float], ...] = (
    {"mass.m": 1.0, "pid.Kp": 1e4},
    {"mass.m": 1.4, "pid.Kp": 2e4},
    {"mass.m": 1.0, "pid.Kp": 1e4},
)
MASTERS = [
    {"master": "gauss-seidel"},
    {"master": "jacobi"},
    {"master": "jacobi", "extrapolation": 2},
    {"master": "newton"},
    {"master": "adaptive"},
]


def follow(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
    return x + h * (u[0] + u[1] - x)


@pytest.fixture
def loop(build_fmu: BuildFmu) -> Loop:
    """A sampled controller, a mass and friction; beside them a part in Python, a record and a slower part."""

    def make(friction: str = "LuGre", *, reuse: bool = False) -> System:
        models = {"profile": "Profile", "pid": "PID", "mass": "Mass", "friction": friction}
        fmus = [FmuPart(name, build_fmu(model)) for name, model in models.items()]
        fmus.append(FmuPart("slow", build_fmu("Differentiator"), every=3))
        for part in fmus:
            part.reuse = reuse
        others = [
            CallablePart("lag", lambda t, u, x: x, ["u", "w"], ["y"], advance=follow, state=[0.0]),
            SeriesPart("record", [0.0, 1.0], {"w": [0.0, 2.0]}),
        ]
        wires = [f"profile.{name} -> pid.{name}" for name in ("r", "rd", "rdd")]
        wires += ["mass.x -> pid.x", "mass.v -> pid.v", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
        wires += ["mass.v -> lag.u", "record.w -> lag.w"]
        delayed = [Wire("pid.u", "mass.F_drive", gain=0.9, delay=2), Wire("mass.x", "slow.x", gain=2.0)]
        return System([*fmus, *others], [*wires, *delayed], {"slow.Ts": 3e-4, "pid.Ts": 1e-4}, name="loop")

    return make


def bytes_of(system: System, experiment: Experiment, values: Mapping[str, float]) -> dict[str, bytes]:
    """The result of a run of a system of its own."""
    with system:
        result = Session(system.with_start(values), experiment).run(system.start | dict(values)).result()
        return {str(name): column.to_numpy().tobytes() for name, column in result.data_vars.items()}


def assert_runs_are_those_of_new_systems(make: Callable[[bool], System], experiment: Experiment) -> None:
    with make(True) as system:
        session = Session(system.with_start(SAMPLES[0]), experiment)
        for values in SAMPLES:
            result = session.run({**system.start, **values}).result()
            new = bytes_of(make(False), experiment, values)
            assert {str(name): column.to_numpy().tobytes() for name, column in result.data_vars.items()} == new
            assert result.attrs["master"] == experiment.master


@pytest.mark.parametrize("friction", some(WITH_MEMORY, WITH_MEMORY[::4]))
def test_blocks_with_memory(loop: Loop, friction: str) -> None:
    experiment = Experiment(stop=0.03, step=1e-4)
    assert_runs_are_those_of_new_systems(lambda reuse: loop(friction, reuse=reuse), experiment)


@pytest.mark.parametrize("master", MASTERS, ids=lambda master: "-".join(map(str, master.values())))
def test_masters_and_manipulators(loop: Loop, master: Mapping[str, object]) -> None:
    manipulators = (Noise("pid.x", 1e-7, seed=3, start=0.002), DropOut("pid.v", 0.3, seed=5))
    names = ("*", "mass.F_ext", "friction.v", "pid.Kp")
    experiment = Experiment(stop=0.02, step=1e-4, record=names, manipulators=manipulators, decimate=3, **master)  # type: ignore[arg-type]
    assert_runs_are_those_of_new_systems(lambda reuse: loop(reuse=reuse), experiment)


@pytest.mark.parametrize(("master", "measure"), [("newton", "evaluations"), ("jacobi", "coupling_error")])
def test_attributes_of_a_run_are_its_own(loop: Loop, master: str, measure: str) -> None:
    """What the engine measures begins at 0 in every run."""
    with loop(reuse=True) as system:
        session = Session(system, Experiment(stop=0.02, step=1e-4, master=master))
        first, second = (session.run(system.start).attributes for _ in range(2))
    assert first == second
    assert float(first[measure]) > 0.0


def test_instances_are_bound_once(loop: Loop, monkeypatch: pytest.MonkeyPatch) -> None:
    bound: list[str] = []
    bind = FmuPart.bind

    def count(self: FmuPart, *arguments: object) -> object:
        bound.append(self.name)
        return bind(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(FmuPart, "bind", count)
    with loop(reuse=True) as system:
        session = Session(system, Experiment(stop=1e-3, step=1e-4))
        for _ in range(3):
            session.run(system.start)
    assert sorted(bound) == ["friction", "mass", "pid", "profile", "slow"]


@pytest.mark.parametrize("master", ["gauss-seidel", "newton"])
def test_a_failed_run_leaves_nothing_behind(loop: Loop, master: str) -> None:
    """Nor does one whose parts were not all started."""
    experiment = Experiment(stop=0.01, step=1e-4, master=master)
    expected = bytes_of(loop(), experiment, {})
    with loop(reuse=True) as system:
        session = Session(system, experiment)
        session.run(system.start)
        for broken in ({"mass.m": -1.0}, {"mass.m": float("nan")}):
            with pytest.raises(StartValueError):
                session.run({**system.start, **broken})
        result = session.run(system.start).result()
        assert {str(name): column.to_numpy().tobytes() for name, column in result.data_vars.items()} == expected


def test_a_failed_instance_is_replaced_and_bound_again(probe: Path) -> None:
    start = {"p.n": 4, "p.b": True, "p.u": 1.0}
    with System([FmuPart("p", probe)], start=start) as system:
        part = system.parts["p"]
        assert isinstance(part, FmuPart)
        part.reuse = True
        session = Session(system.with_start({"p.fail_time": 9.0}), Experiment(stop=1.0, step=0.25))
        good = session.run({**start, "p.fail_time": 9.0})
        for _ in range(2):
            with pytest.raises(PartError, match=r"fmi2DoStep at t = 0\.5 s") as failure:
                session.run({**start, "p.fail_time": 0.6})
            assert failure.value.result is not None
            assert failure.value.result.sizes["time"] == 3
            again = session.run({**start, "p.fail_time": 9.0})
            np.testing.assert_array_equal(again.rows, good.rows)


def test_a_result_keeps_its_values_when_the_session_runs_again(loop: Loop) -> None:
    with loop(reuse=True) as system:
        session = Session(system, Experiment(stop=0.01, step=1e-4, record=("mass.x",)))
        first = session.run(system.start).result()
        before = first["mass.x"].to_numpy().copy()
        session.run({**system.start, "mass.m": 3.0})
        np.testing.assert_array_equal(first["mass.x"], before)


def test_a_sweep_over_settings_and_start_values(loop: Loop) -> None:
    """Whatever changes from run to run: values, names, settings; and a run that fails in between."""
    samples = [
        {"mass.m": 1.0},
        {"mass.m": 2.0},
        {"mass.m": 2.0, "stop": 0.02},
        {"mass.m": -1.0, "stop": 0.02},
        {"mass.m": 1.5, "stop": 0.02},
        {"pid.Kp": 9e3, "master": "newton"},
        {"pid.Kp": 8e3, "master": "newton"},
        {"mass.m": 1.0},
    ]
    experiment = Experiment(stop=0.01, step=1e-4)
    measures = ["final(mass.x)", "rms(friction.F)"]
    with loop() as system:
        result = sweep(system, samples, measure=measures, executor="serial", experiment=experiment)
        for run, values in enumerate(samples):
            start = {name: value for name, value in values.items() if "." in name}
            settings = {name: value for name, value in values.items() if "." not in name}
            if result["error"][run]:
                with pytest.raises(HarnessError, match=r"start value -1\.0 of m: "):
                    system.with_start(start).run(stop=0.01, step=1e-4)
                continue
            alone = system.with_start(start).run(**{"stop": 0.01, "step": 1e-4, **settings})  # type: ignore[arg-type]
            assert result["final(mass.x)"][run] == alone["mass.x"][-1]
            assert result["rms(friction.F)"][run] == np.sqrt(np.mean(np.square(alone["friction.F"].to_numpy())))
    assert [bool(error) for error in result["error"].to_numpy()] == [False] * 3 + [True] + [False] * 4
