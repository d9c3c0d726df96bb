"""The study of the EMPS axis from end to end, all of it from FMUs; it is done once for all tests here."""

from __future__ import annotations

import json
import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
import pytest

from friction_fmus.data import EMPS_PUBLISHED, load_emps
from friction_fmus.study import StudyError, StudySettings, Summary, agreement, run_study
from friction_fmus.study.servo import forget_systems, friction_curve, run_servo
from harness import System


@dataclass(frozen=True)
class Study:
    out: Path
    summary: Summary
    seconds: float
    told: list[tuple[int, int]]


class Listener:
    def __init__(self) -> None:
        self.told: list[tuple[int, int]] = []

    def update(self, done: int, total: int) -> None:
        self.told.append((done, total))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    out = tmp_path_factory.mktemp("study")
    (out / "notes of mine.txt").write_text("keep")
    listener, begin = Listener(), sum(os.times()[:4])
    summary = run_study(out, listener, StudySettings(workers=2))
    return Study(out, summary, sum(os.times()[:4]) - begin, listener.told)


@pytest.fixture(scope="module")
def figures(study: Study) -> dict[str, dict[str, dict[str, float]]]:
    content: dict[str, dict[str, dict[str, float]]] = json.loads((study.out / "summary.json").read_text())
    return content


@pytest.mark.parametrize("name", EMPS_PUBLISHED)
def test_identified_values_are_the_published_ones(figures: dict[str, dict[str, dict[str, float]]], name: str) -> None:
    found = figures["identified"][name]
    assert found["value"] == pytest.approx(EMPS_PUBLISHED[name], rel=5e-3)
    assert found["published"] == EMPS_PUBLISHED[name]
    assert found["standard_error"] > 0.0


@pytest.mark.parametrize(("model", "position", "force"), [("coulomb", 1.70, 4.65), ("stribeck", 1.42, 3.90)])
def test_closed_loop_stays_with_the_measurement(
    figures: dict[str, dict[str, dict[str, float]]], model: str, position: float, force: float
) -> None:
    found = figures["closed_loop"][model]
    assert found["position_rms_um"] <= position
    assert found["force_percent"] <= force


def test_friction_grows_with_speed(study: Study) -> None:
    """The axis wants Fs < Fc, in the fit and in the FMU that carries it."""
    stribeck = study.summary.stribeck
    assert stribeck["Fs"].value < stribeck["Fc"].value
    curve = friction_curve(study.out / "fmus" / "EmpsFrictionStribeck.fmu", np.array([1e-6, 0.03, 0.1]))
    expected = stribeck["Fc"].value + stribeck["Fv"].value * 0.1 + stribeck["OF"].value
    assert curve[0] == pytest.approx(stribeck["Fs"].value + stribeck["OF"].value, rel=1e-3)
    assert curve[2] == pytest.approx(expected, rel=1e-6)


def test_feedforward_gains(figures: dict[str, dict[str, dict[str, float]]]) -> None:
    gain = figures["compensation"]["tracking_rms_um"]
    assert gain["with"] < gain["without"]
    rigid = figures["compensation"]["tracking_rms_um_with_motion_feedforward"]
    assert rigid["with"] < 0.2 * rigid["without"]


def test_everything_is_written_and_nothing_else_touched(study: Study) -> None:
    written = {path.relative_to(study.out).as_posix() for path in study.out.rglob("*") if path.is_file()}
    assert written == {*study.summary.files, "notes of mine.txt"}
    assert {"report.html", "summary.json", "parameters.toml", "coulomb.ssv", "stribeck.ssv"} <= written
    assert not list(study.out.glob(".study-*"))


def test_the_fmus_carry_the_identified_values(study: Study) -> None:
    carried = {
        ("EmpsAxisCoulomb", "m"): study.summary.identified["M"].value,
        ("EmpsFrictionCoulomb", "Fc"): study.summary.identified["Fc"].value,
        ("EmpsFrictionCoulomb", "Fs"): study.summary.identified["Fc"].value,
        ("EmpsFrictionCoulomb", "offset"): study.summary.identified["OF"].value,
        ("EmpsAxisStribeck", "m"): study.summary.stribeck["M"].value,
        ("EmpsFrictionStribeck", "Fv"): study.summary.stribeck["Fv"].value,
        ("EmpsFrictionStribeck", "vs"): study.summary.stribeck["vs"].value,
        ("EmpsFeedforwardStribeck", "Fs"): study.summary.stribeck["Fs"].value,
    }
    for (fmu, variable), value in carried.items():
        description = fmpy.read_model_description(study.out / "fmus" / f"{fmu}.fmu")
        start = {v.name: v.start for v in description.modelVariables}[variable]
        assert float(start) == value


def test_parameter_file_has_the_estimates(study: Study) -> None:
    content = tomllib.loads((study.out / "parameters.toml").read_text())
    for name, found in (("axis.m", "M"), ("friction.Fs", "Fs")):
        entry = content["stribeck"][name]
        assert entry["value"] == study.summary.stribeck[found].value
        assert entry["standard_error"] == study.summary.stribeck[found].standard_error
    assert "Janot" in content["citation"]


def test_the_system_file_gives_the_figures_again(study: Study) -> None:
    found = run_servo(study.out / "servo_stribeck.toml")
    forget_systems()
    assert agreement(load_emps().record, found.q, found.force) == study.summary.closed_loop["stribeck"]


def test_every_system_file_is_complete(study: Study) -> None:
    files = sorted(study.out.glob("*.toml"))
    systems = [file for file in files if file.name != "parameters.toml"]
    assert len(systems) == 7
    for file in systems:
        with System.from_toml(file) as system:
            assert system.experiment is not None


def test_the_report_cites_the_data(study: Study) -> None:
    page = (study.out / "report.html").read_text()
    assert "Janot" in page
    assert page.count("data:image/png;base64,") == 4
    assert str(study.out) not in page


def test_progress_only_grows(study: Study) -> None:
    assert study.told == sorted(study.told)
    assert study.told[-1] == (100, 100)


def test_it_does_not_take_a_minute(study: Study) -> None:
    """Of processor time, all processes together: elapsed time would depend on what else runs here."""
    assert study.seconds < 60.0


def test_a_study_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="whole part of the sampling period"):
        run_study(tmp_path, settings=StudySettings(fit_step=3e-4))
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match=r"Cannot make the folder .*file"):
        run_study(tmp_path / "file")
