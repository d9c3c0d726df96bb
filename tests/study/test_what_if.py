"""The axis of the what-if panel moves as the axis of the study, for every change that the study also tries."""

from __future__ import annotations

import html
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_study import made_up_study
from small_axis import LAW, NOISE, SERVO, bench_of, runs_of
from thorough import nightly, some

from friction_fmus.axis.loop_assembly import PartPool
from friction_fmus.axis.servo import Compensator
from friction_fmus.axis.servo_loop import run_loop
from friction_fmus.report import report_html
from friction_fmus.study.evaluation import Case, Scheme, changed, off_by, system_of
from friction_fmus.study.what_if import knobs_of, panel_of, variable_system
from harness.compiling import toolchain

CASES = {
    "as identified": Case("as identified"),
    "delay": Case("delay", delay=2),
    "encoder": Case("encoder", coarser=4.0),
    "friction and mass": Case("friction and mass", friction=2.0, mass=1.5),
}


@pytest.mark.parametrize("case", some([*CASES.values()], [CASES["delay"]]), ids=lambda case: case.name)
@pytest.mark.parametrize("law", some([None, LAW], [LAW]), ids=some(["alone", "compensated"], ["compensated"]))
@pytest.mark.parametrize("noise", some([0.0, 1e-7], [1e-7]), ids=some(["exact", "noisy"], ["noisy"]))
def test_a_knob_changes_the_axis_as_the_study_does(
    tmp_path: Path, case: Case, law: Compensator | None, noise: float
) -> None:
    bench = bench_of(tmp_path, replace(SERVO, noise=noise))
    scheme = Scheme(bench.servo, 0.8, compensator=law, table=law is not None)
    servo, trajectory = changed(scheme.servo, bench.trajectory, case)
    with PartPool() as pool:
        studied = system_of(replace(bench, trajectory=trajectory), replace(scheme, servo=servo), pool)
        expected = run_loop(studied.with_start(off_by(studied, case.friction, case.mass)))
    with PartPool() as pool:
        system = variable_system(bench, scheme, pool)
        values = {"friction": case.friction, "mass": case.mass, "delay": servo.delay, "encoder step": servo.quantum}
        start: dict[str, float] = {}
        for knob in knobs_of(bench, [scheme], [system]):
            value = values.get(knob.name, knob.start)
            start |= {name: factor * value for name, factor in knob.settings[0].items()}
            start |= {name: float(k == value - knob.least) for k, name in enumerate(knob.taps)}
        found = run_loop(system.with_start(start))
    np.testing.assert_allclose(found.q, expected.q, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(found.force, expected.force, rtol=0.0, atol=1e-9)


def test_the_loop_gain_scales_the_feedback(tmp_path: Path) -> None:
    """All gains of a PID; of a cascade those outside of the product, u = kv (kp e - v) + ki ..."""
    cascade = replace(SERVO, law="CascadePPI", gains={"kp": 60.0, "kv": 200.0, "ki": 5.0})
    for servo in (SERVO, cascade):
        bench, scheme = bench_of(tmp_path, servo), Scheme(servo)
        with PartPool() as pool:
            system = variable_system(bench, scheme, pool)
            (gain,) = (knob for knob in knobs_of(bench, [scheme], [system]) if knob.name == "controller gains")
        scaled = {**servo.gains, **{name.removeprefix("servo."): 2.0 * v for name, v in gain.settings[0].items()}}
        np.testing.assert_allclose(replace(servo, gains=scaled).pid, 2.0 * np.array(servo.pid), rtol=1e-15)


def test_an_exact_encoder_stays_exact(tmp_path: Path) -> None:
    bench = bench_of(tmp_path, replace(SERVO, quantum=0.0))
    with PartPool() as pool:
        expected = run_loop(system_of(bench, Scheme(bench.servo), pool))
        found = run_loop(variable_system(bench, Scheme(bench.servo), pool))
    np.testing.assert_allclose(found.q, expected.q, rtol=0.0, atol=1e-15)  # an encoder of step 0 passes its input


@nightly
def test_without_a_compiler_the_report_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = bench_of(tmp_path)
    runs = runs_of(bench)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    monkeypatch.setenv("FRICTION_FMUS_CACHE", str(tmp_path / "cache"))
    toolchain._zig.cache_clear()
    said = panel_of(bench, runs, NOISE)
    assert isinstance(said, str)
    assert "cannot be compiled for the browser" in said
    assert "ziglang" in said
    page = report_html(made_up_study(), said)
    assert html.escape(said).replace("&#x27;", "&#39;") in page
    assert "wasm-unsafe-eval" not in page
