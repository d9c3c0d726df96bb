"""One FMU over sampled inputs in compiled code, against the same run part by part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from harness import Drive, Experiment, FmuPart, PartError, SeriesPart, StartValueError, System
from harness.errors import ExperimentError, UnknownNameError

BuildFmu = Callable[..., Path]
STEP = 1e-3
TIMES = STEP * np.arange(801)
VELOCITY = 2e-3 * np.sin(2.0 * np.pi * 3.0 * TIMES) + 5e-4 * np.sin(2.0 * np.pi * 41.0 * TIMES)


@pytest.fixture
def drive(build_fmu: BuildFmu) -> Iterator[Drive]:
    made = Drive(FmuPart("friction", build_fmu("LuGre")))
    yield made
    made.close()


def test_held_inputs_give_the_run_of_a_system_to_the_last_bit(build_fmu: BuildFmu, drive: Drive) -> None:
    series = SeriesPart("series", TIMES, {"v": VELOCITY}, {"v": "m/s"}, interpolation="previous")
    experiment = Experiment(stop=TIMES[-1], step=STEP, master="jacobi", record=("friction.F", "friction.z"))
    parts = [series, FmuPart("friction", build_fmu("LuGre"))]
    with System(parts, ["series.v -> friction.v"], {"friction.sigma0": 2e5}, experiment) as system:
        expected = system.run()
    rows = drive.run({"v": VELOCITY}, ["F", "z"], STEP, start={"sigma0": 2e5})
    np.testing.assert_array_equal(rows[1:, 0], expected["friction.F"].to_numpy()[1:])
    np.testing.assert_array_equal(rows[1:, 1], expected["friction.z"].to_numpy()[1:])


def test_lines_between_the_samples_give_the_calls_of_fmi_one_by_one(build_fmu: BuildFmu, drive: Drive) -> None:
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    path = build_fmu("LuGre")
    description = read_model_description(str(path))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Slave(
        guid=description.guid, unzipDirectory=extract(str(path)), modelIdentifier="LuGre", instanceName="alone"
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.setReal([reference["v"]], [VELOCITY[0]])
    expected = [fmu.getReal([reference["F"]])[0]]
    for k in range(len(VELOCITY) - 1):
        fmu.setReal([reference["v"]], [VELOCITY[k]])
        fmu.setRealInputDerivatives([reference["v"]], [1], [(VELOCITY[k + 1] - VELOCITY[k]) / STEP])
        fmu.doStep(k * STEP, STEP)
        expected.append(fmu.getReal([reference["F"]])[0])
    fmu.terminate()
    fmu.freeInstance()
    rows = drive.run({"v": VELOCITY}, ["F"], STEP, between="linear")
    np.testing.assert_array_equal(rows[:, 0], expected)


def test_a_run_does_not_depend_on_the_one_before(drive: Drive) -> None:
    first = drive.run({"v": VELOCITY}, ["F"], STEP)
    drive.run({"v": -VELOCITY}, ["F"], STEP, start={"Fc": 7.0, "Fs": 9.0, "z": 1e-5})
    np.testing.assert_array_equal(drive.run({"v": VELOCITY}, ["F"], STEP), first)


def test_the_first_row_is_the_initial_state_with_the_first_inputs(drive: Drive) -> None:
    rows = drive.run({"v": [0.0, 0.0]}, ["F"], STEP, start={"z": 3e-6, "sigma0": 1e5})
    assert rows[0, 0] == pytest.approx(0.3)


def test_a_refused_start_value_names_the_parameter_and_leaves_the_drive_usable(drive: Drive) -> None:
    with pytest.raises(StartValueError, match="Fc"):
        drive.run({"v": VELOCITY}, ["F"], STEP, start={"Fc": -1.0})
    assert np.isfinite(drive.run({"v": VELOCITY}, ["F"], STEP)).all()


def test_a_run_goes_on_after_a_warning(build_fmu: BuildFmu) -> None:
    """Elements of 0.7 N are weaker than Fs, of which the first step warns."""
    made = Drive(FmuPart("friction", build_fmu("ModifiedLeuven")))
    weak = {f"W[{i}]": 0.07 for i in range(1, 11)}
    rows = made.run({"v": [0.1] * 4}, ["F"], 1.0, start={**weak, "sigma1": 0.0, "sigma2": 0.0})
    made.close()
    np.testing.assert_allclose(rows[:, 0], [0.0, 0.7, 0.7, 0.7], rtol=1e-12)


def test_a_failing_step_tells_its_time(drive: Drive) -> None:
    wild = np.array([0.0, 0.0, 0.0, 1e305, 1e305])
    with pytest.raises(PartError) as caught:
        drive.run({"v": wild}, ["F"], STEP, start={"sigma1": 1e10})
    assert caught.value.time is not None and 1.0 * STEP < caught.value.time < 4.0 * STEP


@pytest.mark.parametrize(
    ("inputs", "step"),
    [({}, STEP), ({"v": [0.0]}, STEP), ({"v": [0.0, np.nan]}, STEP), ({"v": [0.0, 1.0], "Fn": [1.0]}, STEP)],
)
def test_unusable_inputs_are_refused(drive: Drive, inputs: dict[str, list[float]], step: float) -> None:
    with pytest.raises(ExperimentError):
        drive.run(inputs, ["F"], step)


def test_unknown_names_and_steps_that_are_not_positive_are_refused(drive: Drive) -> None:
    with pytest.raises(UnknownNameError, match="speed"):
        drive.run({"speed": VELOCITY}, ["F"], STEP)
    with pytest.raises(UnknownNameError, match="sigma0"):
        drive.run({"sigma0": VELOCITY}, ["F"], STEP)
    with pytest.raises(ExperimentError, match="positive"):
        drive.run({"v": VELOCITY}, ["F"], 0.0)
