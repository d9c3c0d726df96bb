"""FMUs of FMI 3.0 as parts: those of another tool with all types, and ours, equal to FMI 2.0 bit for bit."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from thorough import some
from types3 import types3

from friction_fmus import build, fmu
from harness import (
    Experiment,
    FmuError,
    FmuPart,
    HarnessError,
    PartError,
    StartValueError,
    System,
    UnknownNameError,
    sweep,
)

MASTERS = ["gauss-seidel", "jacobi", "newton", "adaptive"]
WHOLE = {"i8": -100, "u8": 200, "i16": -30000, "u16": 60000, "i32": -(2**31), "u32": 2**32 - 2, "i64": -(2**53) + 2}


@cache
def three(name: str) -> Path:
    """The FMU of a block in FMI 3.0, with arrays and clocks."""
    return build(name, mkdtemp(prefix="fmi3-"), fmi=3, arrays=True, clocks=True)


@cache
def plain(name: str) -> Path:
    """The FMU of a block in FMI 3.0 as it is by default."""
    return build(name, mkdtemp(prefix="fmi3-"), fmi=3)


def servo(kinds: Sequence[Callable[[str], Path]]) -> System:
    """A mass with LuGre friction under sampled feedback: three FMUs, each of the version that its function gives."""
    mass, friction, controller = kinds
    parts = [
        FmuPart("mass", mass("Mass")),
        FmuPart("friction", friction("LuGre")),
        FmuPart("pid", controller("PID")),
    ]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction", "mass.x -> pid.x", "mass.v -> pid.v"]
    start = {"pid.r": 1e-3, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.Kp": 1e4, "pid.Kd": 100.0, "pid.Ts": 2e-3}
    return System(parts, [*wires, "pid.u -> mass.F_drive"], start)


def values(system: System, master: str, stop: float = 0.3) -> dict[str, bytes]:
    """All signals of a run as bytes."""
    with system:
        result = system.run(stop=stop, step=1e-3, master=master)
    return {str(name): np.asarray(result[name]).tobytes() for name in result.data_vars}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize(
    "mixed",
    some(
        [(three, three, three), (plain, plain, plain), (fmu, three, fmu), (plain, fmu, three)],
        [(three, three, three), (plain, fmu, three)],
    ),
)
def test_versions_mix_bit_for_bit(master: str, mixed: Sequence[Callable[[str], Path]]) -> None:
    assert values(servo(mixed), master) == values(servo((fmu, fmu, fmu)), master)


def test_a_run_continues_from_a_checkpoint(tmp_path: Path) -> None:
    whole = values(servo((three, three, three)), "newton", 0.3)
    with servo((three, three, three)) as system:
        system.run(stop=0.1, step=1e-3, master="newton", checkpoint=tmp_path / "state")
        result = system.run(stop=0.3, step=1e-3, master="newton", resume=tmp_path / "state")
    for name in result.data_vars:
        assert whole[str(name)].endswith(np.asarray(result[name])[-100:].tobytes())


def test_a_size_changes_the_arrays() -> None:
    def run(path: Path, start: dict[str, float]) -> np.ndarray:
        with System([FmuPart("gms", path)], [], {"gms.v": 1e-3, **{f"gms.{k}": v for k, v in start.items()}}) as system:
            return np.asarray(system.run(stop=0.05, step=1e-3, master="jacobi")["gms.F"])

    for start in ({"N": 4}, {"N": 4, "k[2]": 1e4}, {"k[3]": 2e4}):
        assert run(three("GMS"), start).tobytes() == run(fmu("GMS"), start).tobytes()
    part = FmuPart("gms", three("GMS"))
    part.resize({"N": 4})
    names = {port.name for port in part.parameters}
    assert "k[4]" in names and "k[5]" not in names
    part.close()


def sized(path: Path, **start: float) -> System:
    """A GMS block that moves at constant velocity."""
    experiment = Experiment(stop=0.05, step=1e-3, master="jacobi", record=("gms.F", "gms.Fi[1]", "gms.Fi[4]"))
    return System([FmuPart("gms", path)], [], {"gms.v": 1e-3} | {f"gms.{k}": v for k, v in start.items()}, experiment)


def test_systems_that_share_a_part_have_arrays_of_their_own_size(tmp_path: Path) -> None:
    def rows(system: System) -> bytes:
        return system.run().to_array().values.tobytes()

    starts: list[dict[str, float]] = [{}, {"N": 4}, {"N": 7}, {"k[3]": 2e4}]
    expected = [rows(sized(fmu("GMS"), **start)) for start in starts]
    with sized(three("GMS")) as system:
        systems = [system.with_start({f"gms.{name}": value for name, value in start.items()}) for start in starts]
        for _ in range(2):
            assert [rows(other) for other in systems] == expected
        systems[1].to_ssp(tmp_path / "s.ssp")
    with System.from_ssp(tmp_path / "s.ssp") as system:
        assert rows(system) == expected[1]


def test_a_sweep_over_a_size() -> None:
    samples = [{"gms.N": size, "gms.Fc": level} for size in (4, 8, 6, 10) for level in (1.0, 2.0)]
    found = []
    for path in (fmu("GMS"), three("GMS")):
        with sized(path) as system:
            found.append(sweep(system, samples, measure=["max(gms.F)", "final(gms.Fi[4])"], executor="serial"))
    assert found[0]["max(gms.F)"].values.tolist() == found[1]["max(gms.F)"].values.tolist()
    assert found[0]["final(gms.Fi[4])"].values.tolist() == found[1]["final(gms.Fi[4])"].values.tolist()
    assert not any(found[1]["error"].values) and np.isfinite(found[1]["max(gms.F)"]).all()


# ---- another tool's FMU


def foreign(tmp_path: Path, **start: object) -> System:
    part = FmuPart("p", types3(tmp_path / "types.fmu"))
    return System([part], [], {f"p.{name}": value for name, value in start.items()})  # type: ignore[misc]


INPUTS = {
    "u": 0.0,
    **{f"matrix[{i},{j}]": 0.0 for i in (1, 2) for j in (1, 2, 3)},
    **dict.fromkeys(("single", "u64", *WHOLE), 0),
    "gear": 1,
    "flags[1]": False,
    "flags[2]": False,
}


def run(tmp_path: Path, stop: float = 0.1, step: float = 0.01, **start: object) -> dict[str, float]:
    """The last values of a run."""
    with foreign(tmp_path, **{**INPUTS, **start}) as system:
        result = system.run(stop=stop, step=step, master="gauss-seidel")
    return {str(name).removeprefix("p."): float(result[name][-1]) for name in result.data_vars}


def test_integers_of_all_widths_are_exact(tmp_path: Path) -> None:
    found = run(tmp_path, **WHOLE, u64=2**53 - 2, single=0.5)
    assert {name: found[f"{name}_y"] for name in WHOLE} == {name: value + 1 for name, value in WHOLE.items()}
    assert (found["u64_y"], found["single_y"]) == (2**53 - 1, 1.5)


def test_arrays_enumerations_and_booleans(tmp_path: Path) -> None:
    matrix = {f"matrix[{i},{j}]": 10.0 * i + j for i in (1, 2) for j in (1, 2, 3)}
    found = run(tmp_path, **matrix, gear=2, **{"flags[2]": True})
    assert found["sum"] == sum((k + 1) * value for k, value in enumerate(matrix.values()))
    assert (found["gear_y"], found["any"]) == (2, 1)


def test_an_enumeration_has_one_of_its_items(tmp_path: Path) -> None:
    with pytest.raises(StartValueError, match=r"value 7 of p\.gear is no item: give 1 \(first\), 2 \(second\)"):
        run(tmp_path, gear=7)


@pytest.mark.parametrize(
    ("items", "said"),
    [
        ('<Item name="first" value="1"/><Item name="second" value="2"/><Item name="third" value="3"/>', ""),
        (
            '<Item name="first" value="1"/><Item name="other" value="2"/>',
            "2, which is 'second' of the output and 'other'",
        ),
        ('<Item name="first" value="1"/>', "2, which is 'second' of the output and no item of the input"),
    ],
)
def test_a_connection_of_enumerations_with_other_items_is_reported(
    tmp_path: Path, items: str, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    change = ('<Item name="first" value="1"/><Item name="second" value="2"/>', items)
    parts = [FmuPart("p", types3(tmp_path / "p.fmu")), FmuPart("q", types3(tmp_path / "q.fmu", change))]
    start = {f"{part}.{name}": value for part in "pq" for name, value in INPUTS.items() if f"{part}.{name}" != "q.gear"}
    with System(parts, ["p.gear_y -> q.gear"], start):  # type: ignore[arg-type]
        pass
    assert said in caplog.text and bool(said) == bool(caplog.text)


def test_one_element_of_an_array_can_be_connected(tmp_path: Path) -> None:
    part = FmuPart("p", types3(tmp_path / "types.fmu"))
    free = {f"p.{name}": value for name, value in INPUTS.items() if name != "matrix[2,1]"}
    with System([part], ["p.y -> p.matrix[2,1]"], {**free, "p.u": 1.0, "p.matrix[1,1]": 3.0}) as system:  # type: ignore[dict-item]
        result = system.run(stop=0.1, step=0.01, master="gauss-seidel")
    assert float(result["p.sum"][-1]) == pytest.approx(3.0 + 4 * 0.09)  # y of the step before


def test_sizes_and_texts_are_set(tmp_path: Path) -> None:
    assert run(tmp_path, n=5, text="b")["weighted"] == 1 + 2 + 3 + 4 + 5
    assert run(tmp_path, n=2, **{"vector[2]": 20.0})["weighted"] == 21
    assert run(tmp_path, n=5, **{"vector[4]": 40.0, "vector[5]": 50.0})["weighted"] == 96
    with pytest.raises(StartValueError, match="give a start value for each"):
        run(tmp_path, n=5, **{"vector[5]": 50.0})


@pytest.mark.parametrize("step", [0.001, 0.01, 0.05])
def test_clocks_tick_and_events_happen_at_their_times(tmp_path: Path, step: float) -> None:
    """Ticks at 3 ms + k 10 ms before the end of the run, events of the FMU at multiples of 25 ms."""
    found = run(tmp_path, stop=0.1, step=step, u=1.0)
    assert (found["ticks"], found["events"]) == (10, 3)
    assert found["y"] == pytest.approx(0.1)


@pytest.mark.parametrize("master", ["gauss-seidel", "newton"])
def test_events_show_the_values_before_and_after(tmp_path: Path, master: str) -> None:
    """Ticks at 3 ms + k 10 ms and an event at 25 ms, each with two rows; nothing else changes."""
    settings = {"stop": 0.03, "step": 0.001, "record": ["p.ticks", "p.events", "p.y"], "master": master}
    with foreign(tmp_path, **{**INPUTS, "u": 1.0}) as system:
        plain, shown = system.run(**settings), system.run(**settings, events=True)  # type: ignore[arg-type]
    t = shown["time"].to_numpy()
    second = np.append(False, np.diff(t) == 0.0)
    assert all(np.array_equal(shown[name].to_numpy()[~second], plain[name]) for name in plain)
    assert t[second] == pytest.approx([0.003, 0.013, 0.023, 0.025])
    assert shown["p.ticks"].to_numpy()[second].tolist() == [1, 2, 3, 3]
    assert shown["p.events"].to_numpy()[second].tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        ({"fault": 1}, "the value of i64_y is too large"),
        ({"fault": 2}, "do not settle"),
        ({"fault": 4}, "ended the step early"),
        ({"fault": 6}, "ended the step early"),
        ({"fault": 7}, "ended the step early"),
        ({"fault": 5}, "the step fails on request"),
    ],
)
def test_failures_have_a_reason(tmp_path: Path, start: dict[str, int], reason: str) -> None:
    with pytest.raises(PartError, match=reason):
        run(tmp_path, **start)


@pytest.mark.parametrize(("fault", "end"), [(3, 0.003), (8, 0.0015)])
def test_an_fmu_that_ends_the_simulation(tmp_path: Path, fault: int, end: float) -> None:
    """A normal end (FMI 3.0.2, section 4.2): the result ends with the step, here to a tick, or earlier."""
    with foreign(tmp_path, **{**INPUTS, "u": 2.0, "fault": fault}) as system:
        found = system.run(stop=0.1, step=0.01)
    assert found.attrs["ended"] == "part 'p' ended the simulation in the step from t = 0 s"
    assert found["time"].to_numpy().tolist() == [0.0, end]
    np.testing.assert_allclose(found["p.y"], [0.0, 2.0 * end], rtol=1e-12)


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        ({"u8": 256}, "u8"),
        ({"u64": 0.5}, "u64"),
        ({"i8": -129}, "i8"),
        ({"text": "bad"}, "the text is bad"),
        ({"blob": 1.0}, "'blob': it is of the type Binary, which cannot be connected, set or recorded"),
    ],
)
def test_unsuitable_start_values_are_refused(tmp_path: Path, start: dict[str, float], reason: str) -> None:
    with pytest.raises(HarnessError, match=reason):
        run(tmp_path, **start)


def test_binary_values_are_neither_connected_nor_recorded(tmp_path: Path) -> None:
    path = types3(tmp_path / "types.fmu")
    with pytest.raises(UnknownNameError, match="of the type Binary"):
        System([FmuPart("p", path), FmuPart("q", fmu("Quantiser"))], ["q.y -> p.blob"], {})
    with foreign(tmp_path, **INPUTS) as system, pytest.raises(UnknownNameError, match="of the type Binary"):
        system.run(stop=0.1, step=0.01, master="gauss-seidel", record=["p.blob"])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (('intervalVariability="fixed"', 'intervalVariability="countdown"'), "only periodic clocks"),
        ((' hasEventMode="true"', ""), "no event mode"),
        (("<CoSimulation", "<ModelExchange"), "without co-simulation"),
        (('<Dimension start="3"/>', '<Dimension start="3000000"/>'), "choose smaller arrays"),
        (('start="0 0 0 0 0 0"', 'start="0 0 0 0"'), "4 start values"),
    ],
)
def test_what_cannot_run_is_refused(tmp_path: Path, change: tuple[str, str], reason: str) -> None:
    with pytest.raises(FmuError, match=reason):
        FmuPart("p", types3(tmp_path / "types.fmu", change))


def test_states_keep_the_next_event(tmp_path: Path) -> None:
    part = FmuPart("p", types3(tmp_path / "types.fmu"))
    part.enter_initialisation(0.0, 1.0, None, {"u": 1.0})
    u, y = np.zeros(0), np.zeros(2)
    calls = part.bind([], ["ticks", "events"], u, y)
    part.exit_initialisation()
    for k in range(6):
        calls.step(0.01 * k, 0.01)
    state = pickle.loads(pickle.dumps(part.serialise()))
    calls.step(0.06, 0.01)
    calls.get()
    after = y.copy()
    part.deserialise(state)
    calls.step(0.06, 0.01)
    calls.get()
    assert y.tolist() == after.tolist() == [7, 2]
    part.close()


# ---- other tools


@pytest.fixture(scope="module")
def powers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU that pythonfmu3 makes of foreign/powers.py."""
    pytest.importorskip("pythonfmu3")
    folder = tmp_path_factory.mktemp("pythonfmu3")
    source = Path(__file__).parent / "foreign" / "powers.py"
    command = [sys.executable, "-m", "pythonfmu3", "build", "-f", str(source), "-d", str(folder)]
    subprocess.run(command, check=True, timeout=100, capture_output=True)
    return folder / "Powers.fmu"


@pytest.mark.filterwarnings("ignore")
def test_an_fmu_of_pythonfmu3_runs(powers: Path) -> None:
    """Beside a block of FMI 2.0 that drives it: arrays, integers of 64 bits, Booleans."""
    parts = [FmuPart("one", powers), FmuPart("ramp", fmu("Sine"))]
    start = {"ramp.offset": 1.0, **{f"ramp.amplitude[{k}]": 0.0 for k in (1, 2, 3, 4)}}
    with System(parts, ["ramp.r -> one.rate"], start) as system:
        result = system.run(stop=1.0, step=0.1, master="gauss-seidel")
    t = np.asarray(result["time"])
    for k in (1, 2, 3):
        assert np.asarray(result[f"one.powers[{k}]"])[1:] == pytest.approx(t[1:] ** k, rel=1e-12)
    assert list(np.asarray(result["one.steps"])) == list(range(11))
    assert list(np.asarray(result["one.late"])) == [bool(x > 0.45) for x in t]
    assert np.asarray(result["one.decay"])[1:] == pytest.approx(0.9 ** np.arange(1, 11), rel=1e-12)
