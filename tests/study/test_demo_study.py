"""The study of the synthetic axis from end to end: each night in full, killed in the middle and then gone on with."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from thorough import THOROUGH, nightly, some

from friction_fmus.__main__ import main
from friction_fmus.axis.position_map import PositionMap
from friction_fmus.axis.servo_loop import run_loop
from friction_fmus.export import identified_axis
from friction_fmus.study import Compensation, StudyResult, load_config, run_study
from friction_fmus.study.steps import CACHE, rebuild
from harness import System


@dataclass(frozen=True)
class Study:
    out: Path
    result: StudyResult
    kept: dict[Path, int]
    told: list[tuple[int, int]]


MODELS = some(("Coulomb", "Stribeck", "LuGre"), ("Stribeck", "LuGre"))
PAGE = Path(__file__).parents[2] / "docs" / "study-of-an-axis.md"


def blocks(mark: str) -> list[str]:
    """The code blocks of the page that stand below ``<!-- mark -->``."""
    return re.findall(rf"<!-- {mark} -->\n```\w+\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.S | re.M)


class Listener:
    def __init__(self) -> None:
        self.told: list[tuple[int, int]] = []

    def update(self, done: int, total: int) -> None:
        self.told.append((done, total))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    out = tmp_path_factory.mktemp("study")
    (out / "notes of mine.txt").write_text("keep")
    listener = Listener()
    if not THOROUGH:
        few = Compensation(("StaticFeedforward", "LuGreFeedforward"), (0.4, 1.0, 1.2))
        config = replace(load_config("demo"), models=MODELS, compensation=few)
        with pytest.MonkeyPatch.context() as patch:  # test_what_if.py tests the axis in the browser
            patch.setattr("friction_fmus.study.study.panel_of", lambda *_: "It is not compiled here.")
            patch.setattr(
                "friction_fmus.study.study_files.export_composites", lambda *_: ()
            )  # see slow/test_recommended_files.py
            patch.setattr("friction_fmus.codegen.law_export.CORES", ())  # see slow/test_target.py
            return Study(out, run_study(config, out, processes=1, progress=listener), {}, listener.told)
    command = [sys.executable, "-m", *blocks("demo")[0].replace("-", "_", 1).replace("-o out", f"-o {out}").split()]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        end = time.monotonic() + 300.0
        while len(list((out / CACHE).glob("model-*.json"))) < 2:
            assert process.poll() is None, process.stderr.read() if process.stderr else ""
            assert time.monotonic() < end
            time.sleep(0.05)
        process.kill()
    kept = {file: file.stat().st_mtime_ns for file in (out / CACHE).glob("*.json")}
    return Study(out, run_study("demo", out, processes=1, progress=listener), kept, listener.told)


@nightly
def test_finished_pieces_are_not_repeated(study: Study) -> None:
    assert len(study.kept) >= 2
    assert {file: file.stat().st_mtime_ns for file in study.kept} == study.kept


def test_the_true_model_comes_first_and_is_found(study: Study) -> None:
    best = study.result.models[0]
    assert (best.name, best.rank) == ("LuGre", 1)
    for parameter in best.parameters:
        if parameter.name in ("M", "Fc", "sigma0"):
            assert parameter.value == pytest.approx(parameter.published, rel=0.02)
    assert [row.rank for row in study.result.models] == [*range(1, len(MODELS) + 2)]
    assert study.result.plant == "LuGre"


def test_tracking_errors_say_how_far_they_are_off(study: Study) -> None:
    runs = {row.name: row.metrics for row in study.result.compensators if row.metrics is not None and not row.untried}
    assert runs
    for name, metrics in runs.items():
        assert metrics.rms_bound is not None, name
        # or half a step of the encoder, where the feedforward leaves less than that
        assert 0.0 < metrics.rms_bound < max(0.2 * metrics.rms, 5e-8)


def test_compensators_gain(study: Study) -> None:
    none = study.result.compensator("none")
    assert none.metrics is not None
    exact = study.result.compensator("LuGreFeedforward")
    assert exact.metrics is not None
    assert exact.gain == 1.0
    assert exact.metrics.rms < 0.05 * none.metrics.rms
    # what is missing of the force is missing of the error: half of a feedforward leaves about half of it
    left = {point.gain: point.metrics.rms for point in exact.trials if point.metrics is not None}
    assert left[0.4] / none.metrics.rms == pytest.approx(0.6, abs=0.03)
    assert left[1.2] > left[1.0]
    # forces that are 5 % off leave 5 % of the error
    off = [corner.metrics.rms for corner in exact.corners if "friction" in corner.name and corner.metrics is not None]
    assert max(off) / none.metrics.rms == pytest.approx(0.05, abs=0.02)


def test_one_is_recommended_with_its_runner_up(study: Study) -> None:
    found = study.result.recommendation
    first, second = (row for row in study.result.compensators if row.rank in (1, 2))
    assert (found.name, found.runner_up) == (first.name, second.name)
    measured, motion = study.result.ladder[:2]  # friction causes the error, not inertia
    assert motion.metrics.rms > 0.95 * measured.metrics.rms
    assert "Alone, it does not reduce the tracking error" in found.next_steps[0]
    assert first.improves


def test_everything_is_written_and_nothing_else_touched(study: Study) -> None:
    written = {path.relative_to(study.out).as_posix() for path in study.out.rglob("*") if path.is_file()}
    own = {path for path in written if not path.startswith(CACHE)}
    assert own == {*(file.path for file in study.result.files), "notes of mine.txt"}
    assert {"report.html", "study.json", "recommended/axis.ssp", "recommended/compensator.ssv"} <= own
    assert any(path.startswith("recommended/c/") and path.endswith(".c") for path in own)
    page = (study.out / "recommended" / "generic.md").read_text(encoding="utf-8")
    assert "% of the error without compensation" in page


def test_the_json_is_the_result(study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(identified_axis, "PositionMap", PositionMap, raising=False)  # known to type checkers only
    content = json.loads((study.out / "study.json").read_text(encoding="utf-8"))
    assert rebuild(content, StudyResult) == study.result


def test_the_exported_axis_moves_as_the_one_of_the_study(study: Study) -> None:
    row = study.result.compensator(study.result.recommendation.name)
    assert row.error is not None
    with System.from_ssp(study.out / "recommended" / "axis.ssp") as system:
        position = run_loop(system).q
    with System.from_ssp(study.out / "recommended" / "axis.ssp") as system:
        reference = system.run(record=["reference.r"])["reference.r"].to_numpy()[:-1]
    at = np.round(np.array(row.error.x) / 1e-3).astype(int)
    np.testing.assert_allclose((reference - position)[at], row.error.y, rtol=0.0, atol=1e-9)


def test_the_recommended_fmu_carries_its_parameters(study: Study) -> None:
    row = study.result.compensator(study.result.recommendation.name)
    laws = row.name.split(" + ")
    for law in laws:
        description = fmpy.read_model_description(study.out / "recommended" / f"{law}.fmu")
        start = {variable.name: variable.start for variable in description.modelVariables}
        assert float(start["u_max"]) == 20.0
        assert float(start["Ts"]) == 1e-3
        own = {name.removeprefix(f"{law}."): value for name, value in row.parameters.items()}
        given = {name: value for name, value in own.items() if "." not in name and not isinstance(value, bool)}
        assert given
        for name, value in given.items():
            assert float(start[name]) == pytest.approx(value, rel=1e-12)


@nightly
def test_the_report_contains_the_axis_twice(study: Study) -> None:
    """With the recommended compensator and without one; the browser test moves its sliders."""
    page = (study.out / "report.html").read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json" id="what-if-data">(.*?)</script>', page, re.DOTALL)
    content = json.loads(data)
    assert [run["label"] for run in content["runs"]] == ["recommended", "no compensation"]
    assert [knob["name"] for knob in content["knobs"]] == [
        "friction",
        "mass",
        "delay",
        "controller gains",
        "encoder step",
    ]
    (mass,) = (each.value for each in study.result.model("LuGre").parameters if each.name == "M")
    assert content["knobs"][1]["start"] == pytest.approx(mass, rel=1e-4)
    for run in content["runs"]:
        assert f'frictionFmus.register({{"name":"{run["model"]}"' in page


def test_the_conditions_of_the_loop_are_evaluated(study: Study) -> None:
    assert len(study.result.conditions) > 5
    assert all(row.wrong for row in study.result.conditions if not row.ok)


def test_progress_only_grows(study: Study) -> None:
    assert study.told == sorted(study.told)
    assert study.told[-1] == (100, 100)


@nightly
def test_the_study_of_the_page_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log_file = PAGE.parents[1] / "examples" / "identification" / "log_file.py"
    subprocess.run([sys.executable, str(log_file), str(tmp_path)], check=True)
    (config,) = blocks("file: axis.toml")
    (tmp_path / "axis.toml").write_text(config, encoding="utf-8")
    (command,) = blocks("commands")
    program, *arguments = command.split()
    assert program == "friction-fmus"
    places = {"axis.toml": str(tmp_path / "axis.toml"), "out": str(tmp_path / "out")}
    assert main([places.get(each, each) for each in arguments]) == 0
    printed = capsys.readouterr().out
    assert "Recommendation: " in printed
    assert "Runner-up: " in printed
    content = json.loads((tmp_path / "out" / "study.json").read_text(encoding="utf-8"))
    best = content["models"][0]
    assert best["name"] == "LuGre"
    found = {parameter["name"]: parameter["value"] for parameter in best["parameters"]}
    assert found["M"] == pytest.approx(20.0, rel=0.01)  # the truth, from log_file.py
    assert found["Fc"] == pytest.approx(20.0, rel=0.02)
