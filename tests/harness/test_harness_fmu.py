"""FmuPart on a small FMU made for this: types, start values, failures, state, and files that are no FMUs."""

from __future__ import annotations

import ctypes
import logging
import tempfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest

from harness import CallablePart, FmuError, FmuPart, PartError, Port, StartValueError, System, UnknownNameError

CONSTANTS = {"p.u": 3.0, "p.n": 4, "p.b": True}


def run_probe(path: Path, start: dict[str, float | int | bool | str] | None = None, **changes: float):
    with System([FmuPart("p", path)], start=CONSTANTS | (start or {})) as system:
        return system.run(**{"stop": 1.0, "step": 0.25} | changes)


def test_all_types_cross_the_interface(probe: Path) -> None:
    result = run_probe(probe, {"p.gain": 2.0})
    np.testing.assert_array_equal(result["p.y"], np.full(5, 6.0))
    np.testing.assert_array_equal(result["p.x"], 3.0 * np.arange(5) * 0.25)
    np.testing.assert_array_equal(result["p.twice_n"], np.full(5, 8))
    np.testing.assert_array_equal(result["p.not_b"], np.zeros(5, bool))
    assert result["p.twice_n"].dtype == np.int64
    assert result["p.not_b"].dtype == np.bool_
    assert result["p.y"].attrs == {"units": "N", "description": "gain times u"}


def test_description_becomes_ports_and_dependencies(probe: Path) -> None:
    part = FmuPart("p", probe)
    assert [port.name for port in part.inputs] == ["u", "n", "b"]
    assert [port.name for port in part.outputs] == ["y", "x", "twice_n", "not_b"]
    assert part.dependencies == {
        "y": frozenset({"u"}),
        "x": frozenset(),
        "twice_n": frozenset({"n"}),
        "not_b": frozenset({"b"}),
    }
    assert not part.sampled
    x = part.outputs[1]
    assert x.base is not None and x.base.factor == 201.168 and x.base.exponents == (0, 1, 0, 0, 0, 0, 0, 0)


def test_absent_dependencies_mean_all_inputs(make_fmu: Callable[..., Path]) -> None:
    part = FmuPart("p", make_fmu(('<Unknown index="3" dependencies=""/>', '<Unknown index="3"/>')))
    assert part.dependencies["x"] == {"u", "n", "b"}


def test_all_outputs_discrete_means_sampled(make_fmu: Callable[..., Path]) -> None:
    part = FmuPart(
        "p", make_fmu(('causality="output" variability="continuous"', 'causality="output" variability="discrete"'))
    )
    assert part.sampled


def test_wired_inputs_of_all_types(probe: Path) -> None:
    source = CallablePart(
        "s",
        lambda t, u, x: [t, round(8 * t), t > 0.3],
        outputs=[Port("r"), Port("i", type="Integer"), Port("b", type="Boolean")],
    )
    wires = ["s.r -> p.u", "s.i -> p.n", "s.b -> p.b"]
    with System([FmuPart("p", probe), source], wires) as system:
        result = system.run(stop=1.0, step=0.125, master="jacobi")
    times = np.arange(9) * 0.125
    # the outputs after a step belong to the inputs that were held during it
    np.testing.assert_array_equal(result["p.y"][1:], times[:-1])
    np.testing.assert_array_equal(result["p.twice_n"][1:], 16 * times[:-1])
    np.testing.assert_array_equal(result["p.not_b"][1:], times[:-1] <= 0.3)
    np.testing.assert_allclose(result["p.x"], 0.125 * np.concatenate([[0], np.cumsum(times[:-1])]), rtol=1e-15)


def test_two_instances_and_two_runs_do_not_mix(probe: Path) -> None:
    start = {"a.u": 1.0, "a.n": 1, "a.b": False, "b.u": -1.0, "b.n": 1, "b.b": False, "b.gain": 5.0}
    with System([FmuPart("a", probe), FmuPart("b", probe)], start=start) as system:
        first = system.run(stop=1.0, step=0.1)
        second = system.run(stop=1.0, step=0.1)
    assert first.identical(second)
    np.testing.assert_array_equal(first["a.x"], -first["b.x"])
    np.testing.assert_array_equal(first["b.y"], np.full(11, -5.0))


@pytest.mark.parametrize(("status", "label"), [(2, "Discard"), (3, "Error"), (4, "Fatal")])
def test_failing_step_names_part_time_function_and_log_and_keeps_the_result(
    probe: Path, status: int, label: str
) -> None:
    with pytest.raises(PartError) as caught:
        run_probe(probe, {"p.fail_time": 0.6, "p.fail_status": status, "p.label": "spindle 7"})
    error = caught.value
    assert (
        str(error) == f"part 'p' failed in fmi2DoStep at t = 0.5 s: it returned {label} and logged 'spindle 7 seized'"
    )
    assert error.result is not None
    np.testing.assert_array_equal(error.result["time"], [0.0, 0.25, 0.5])
    np.testing.assert_array_equal(error.result["p.x"], [0.0, 0.75, 1.5])


def test_log_messages_go_to_logging(probe: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, "harness"), pytest.raises(PartError):
        run_probe(probe, {"p.fail_time": 0.6, "p.label": "belt"})
    assert [(r.name, r.levelname, r.getMessage()) for r in caplog.records] == [
        ("harness.p", "ERROR", "belt seized [logStatusError]")
    ]


def test_a_message_belongs_to_the_part_that_logs_it(probe: Path, caplog: pytest.LogCaptureFixture) -> None:
    first, second = (FmuPart(name, probe) for name in ("first", "second"))
    first.enter_initialisation(0.0, 1.0, None, {})
    with pytest.raises(StartValueError, match="'gain = -1 is below 0'"):
        second.enter_initialisation(0.0, 1.0, None, {"gain": -1.0})
    caplog.clear()
    with pytest.raises(PartError, match="'gain = -2 is below 0'"):
        first._started().call("SetReal", *_gain(first, -2.0))
    assert [r.name for r in caplog.records] == ["harness.first"]
    for part in (first, second):
        part.close()


def _gain(part: FmuPart, value: float) -> tuple[object, ...]:
    reference = part.archive.variables["gain"].valueReference
    return (ctypes.c_uint32 * 1)(reference), ctypes.c_size_t(1), (ctypes.c_double * 1)(value)


def test_refused_start_value_gives_the_reason_of_the_fmu(probe: Path) -> None:
    with pytest.raises(StartValueError, match=r"p rejected the start value -1.0 of gain.*'gain = -1 is below 0'"):
        run_probe(probe, {"p.gain": -1.0})


@pytest.mark.parametrize(("name", "value"), [("p.gain", "much"), ("p.fail_status", 2.5), ("p.b", 2.5)])
def test_start_value_of_wrong_type(probe: Path, name: str, value: float | str) -> None:
    with pytest.raises(StartValueError, match=name):
        run_probe(probe, {name: value})


def test_unknown_start_value_suggests_the_nearest(probe: Path) -> None:
    with pytest.raises(UnknownNameError, match="'p' has no input or parameter 'gian': did you mean 'gain'"):
        run_probe(probe, {"p.gian": 1.0})


def test_start_value_of_an_output_that_is_computed(probe: Path) -> None:
    with pytest.raises(StartValueError, match=r"p\.y is computed"):
        run_probe(probe, {"p.y": 1.0})


def test_start_value_of_an_output_that_is_a_state(probe: Path) -> None:
    np.testing.assert_array_equal(run_probe(probe, {"p.x": 5.0, "p.u": 4.0})["p.x"], [5, 6, 7, 8, 9])


def test_malformed_start_value_in_the_description(make_fmu: Callable[..., Path]) -> None:
    assert "variable 'fail_status' of" in refused(make_fmu(('<Integer start="3"/>', '<Integer start="three"/>')))


def test_wrong_guid_is_reported_with_the_message_of_the_fmu(make_fmu: Callable[..., Path]) -> None:
    with pytest.raises(PartError, match=r"fmi2Instantiate.*no instance and logged 'wrong guid stolen'"):
        run_probe(make_fmu(('guid="probe"', 'guid="stolen"')))


def test_save_and_restore(probe: Path) -> None:
    part = FmuPart("p", probe)
    part.enter_initialisation(0.0, 1.0, None, {"u": 1.0})
    y = np.zeros(1)
    calls = part.bind([], ["x"], np.zeros(0), y)
    part.exit_initialisation()
    calls.step(0.0, 0.5)
    state = part.save()
    seen = []
    for _ in range(2):
        part.restore(state)
        calls.step(0.5, 0.25)
        calls.get()
        seen.append(y[0])
    assert seen == [0.75, 0.75]
    assert part.save(state) is state
    part.terminate()
    with pytest.raises(PartError, match="this state belongs to another run"):
        part.restore(state)
    part.close()


def test_fmu_that_cannot_save_says_so(make_fmu: Callable[..., Path]) -> None:
    part = FmuPart("p", make_fmu(('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"')))
    with pytest.raises(PartError, match="cannot save its state"):
        part.save()


def test_nothing_is_left_behind(probe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    here = Path.cwd()
    run_probe(probe)
    with pytest.raises(PartError):
        run_probe(probe, {"p.fail_time": 0.1})
    assert list(folder.iterdir()) == []
    assert Path.cwd() == here


def refused(path: Path) -> str:
    with pytest.raises(FmuError) as caught:
        FmuPart("p", path)
    return str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    assert "the file does not exist" in refused(tmp_path / "none.fmu")


def test_folder(tmp_path: Path) -> None:
    assert "it is a folder" in refused(tmp_path)


def test_no_zip(tmp_path: Path) -> None:
    path = tmp_path / "text.fmu"
    path.write_text("hello")
    assert "not a zip archive" in refused(path)


def test_zip_without_description(make_fmu: Callable[..., Path]) -> None:
    assert "no modelDescription.xml" in refused(make_fmu(members={"modelDescription.xml": None}))


@pytest.mark.parametrize("xml", [b"<broken", b"<fmiModelDescription/>", b'<fmiModelDescription fmiVersion="9"/>'])
def test_unreadable_description(make_fmu: Callable[..., Path], xml: bytes) -> None:
    assert "cannot read modelDescription.xml" in refused(make_fmu(members={"modelDescription.xml": xml}))


def test_other_fmi_version(make_fmu: Callable[..., Path]) -> None:
    xml = (
        b'<fmiModelDescription fmiVersion="1.0" modelName="P" modelIdentifier="probe" guid="p" '
        b'numberOfContinuousStates="0" numberOfEventIndicators="0"><ModelVariables/></fmiModelDescription>'
    )
    assert "is an FMI 1.0 FMU" in refused(make_fmu(members={"modelDescription.xml": xml}))


def test_neither_interface(make_fmu: Callable[..., Path]) -> None:
    path = make_fmu(("<CoSimulation", "<Simulation"))
    assert "declares neither co-simulation nor model exchange" in refused(path)


def test_library_without_the_functions_of_model_exchange(make_fmu: Callable[..., Path]) -> None:
    path = make_fmu(("<CoSimulation", "<ModelExchange"), (' canHandleVariableCommunicationStepSize="true"', ""))
    with (
        System([FmuPart("p", path)], start=CONSTANTS) as system,
        pytest.raises(FmuError, match="undefined symbol: fmi2"),
    ):
        system.run(stop=1.0, step=0.25)


def test_no_binary_for_this_platform(make_fmu: Callable[..., Path]) -> None:
    binary = f"binaries/{fmpy.platform}/probe{fmpy.sharedLibraryExtension}"
    path = make_fmu(members={binary: None, "binaries/beos64/probe.so": b"", "sources/probe.c": b""})
    message = refused(path)
    assert f"has no binary {binary}, only beos64" in message
    assert "sources" in message


@pytest.mark.parametrize("member", ["../evil.txt", "a/../../evil.txt", "/evil.txt", "C:/evil.txt", "..\\evil.txt"])
def test_member_outside_of_the_archive(make_fmu: Callable[..., Path], tmp_path: Path, member: str) -> None:
    assert "points outside" in refused(make_fmu(members={member: b"evil"}))
    assert not list(tmp_path.parent.rglob("evil.txt"))


@pytest.mark.parametrize("number", ['factor="0"', 'factor="INF"', 'factor="NaN"', 'offset="-INF"', 'm="1000"'])
def test_a_unit_that_is_none(make_fmu: Callable[..., Path], number: str) -> None:
    message = refused(make_fmu(('<BaseUnit m="1" factor="201.168"/>', f"<BaseUnit {number}/>")))
    assert "is malformed" in message
    assert "\n" not in message


def test_library_that_cannot_be_loaded(make_fmu: Callable[..., Path]) -> None:
    binary = f"binaries/{fmpy.platform}/probe{fmpy.sharedLibraryExtension}"
    here = Path.cwd()
    with pytest.raises(FmuError, match="cannot load"):
        run_probe(make_fmu(members={binary: b"no library"}))
    assert Path.cwd() == here
