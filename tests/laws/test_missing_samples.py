"""Samples with an input that is NaN: a disabled law is at rest, and a law that knows time knows how much has passed."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from shell.instance import OK, WARNING, Instance, load, signals
from thorough import landing, some

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import LawC, rows_of
from friction_fmus.blocks.catalogue import catalogue, laws_folder
from friction_fmus.codegen.emulation import samples
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import Export
from friction_fmus.codegen.servo_law import LoopFile, LoopLaw, loop_text
from friction_fmus.lawkit.law import Kind, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
BLOCKS = [*LAWS, *(block.name for block in catalogue().values() if block.kind == "compensator" and not block.is_law)]
PASSES = {"Prefilter", "PreviewPrefilter", "InverseDynamics"}
"""Laws that pass their reference on while disabled: these outputs are held."""
NOT_ZERO = {"theta": 1.0, "theta_0": 1.0, "theta_1": 1.0, "theta_2": 1.0, "Fc_hat": 1.0, "Fv_hat": 0.4, "Fn": 1.0}
"""Start values of estimates, which are parameters, and the normal force without load."""
KEPT = {"rms", "trial", "pulses", "line", "seen", "missed"}
"""What is not set back: counts, and the references of the past."""
Ts = 1e-3


@pytest.mark.parametrize("name", some(BLOCKS, BLOCKS[::6]))
def test_a_disabled_block_is_at_rest_whatever_its_inputs_are(name: str, build_fmu: Callable[..., Path]) -> None:
    library = load(build_fmu(name, Ts=Ts))
    with Instance(library) as run:
        run.initialise()
        for k, values in enumerate(signals(library, 2, 20)):
            run.set(values)
            run.step(k * Ts, Ts)
        bad = library.names("input", type="Real")[0]
        run.set({bad: math.nan, "enable": 0.0})
        assert run.call("DoStep", 20 * Ts, Ts, 1) in (OK, WARNING)
        assert run.get1("fault") == 1.0
        passed = {"r_out", "rd_out", "r_now", "rd_now", "rdd_now", "r_motor", "rd_motor"} if name in PASSES else set()
        for variable in (*library.names("output", type="Real"), *library.names("local", type="Real")):
            if variable.partition("[")[0] not in passed | KEPT | {"time"}:
                assert run.get1(variable) == NOT_ZERO.get(variable, 0.0), variable
        # enabled again with valid inputs, it starts anew
        run.set({bad: 0.0, "enable": 1.0})
        run.step(21 * Ts, Ts)
        assert run.get1("fault") == 0.0


Run = Mapping[str, np.ndarray]


def gap(name: str, build_fmu: Callable[..., Path], inputs: Mapping[str, np.ndarray], **start: float) -> Run:
    """Outputs at every sample, with NaN in the first input for ten samples from sample 30 on."""
    rows: dict[str, list[float]] = {}
    library = load(build_fmu(name, Ts=Ts))
    with Instance(library) as block:
        block.initialise(**start)
        for k in range(len(next(iter(inputs.values())))):
            values = {column: float(value[k]) for column, value in inputs.items()}
            if 30 <= k < 40:
                values[next(iter(inputs))] = math.nan
            block.set(values)
            assert block.call("DoStep", k * Ts, Ts, 1) in (OK, WARNING)
            for output in (*library.names("output"),):
                rows.setdefault(output, []).append(block.get1(output))
    found = {output: np.array(values) for output, values in rows.items()}
    assert np.flatnonzero(found["fault"]).tolist() == list(range(30, 40))
    return found


K = np.arange(60)
VALID = (K < 30) | (K >= 40)


@pytest.mark.parametrize("second_order", [0.0, 1.0])
def test_the_disturbance_observer_filters_over_the_true_time(second_order: float, build_fmu) -> None:
    """A constant force F = 5 N through the filter: F (1 - exp(-w t)), or its second-order equivalent."""
    m, a, w = 2.0, 3.0, 2.0 * np.pi * 30.0
    inputs = {"v": a * K * Ts, "u_prev": np.full(60, 5.0 + m * a)}
    # the first sample sees no force
    found = gap("DisturbanceObserver", build_fmu, inputs, m=m, fq=30.0, second_order=second_order)["F_hat"]
    t, q = K * Ts, w * K * Ts / np.sqrt(2.0)
    share = np.exp(-q) * (np.cos(q) + np.sin(q)) if second_order else np.exp(-w * t)
    assert found[VALID] == pytest.approx((5.0 * (1.0 - share))[VALID], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", ["PredictiveFilter", "KalmanFriction", "ExtendedStateObserver"])
def test_an_observer_predicts_over_the_true_time(name: str, build_fmu) -> None:
    """A mass without friction under a constant force: no friction is estimated."""
    a = 3.0
    inputs = {"x": 0.5 * a * (K * Ts) ** 2, "v": a * K * Ts, "u_prev": np.full(60, a)}
    if name == "PredictiveFilter":
        del inputs["x"]
    if name == "ExtendedStateObserver":
        del inputs["v"]
    found = gap(name, build_fmu, inputs, m=1.0)
    assert found["F_hat"] == pytest.approx(np.zeros(60), abs=1e-9)


def test_the_velocity_observer_of_andfc_predicts_over_the_true_time(build_fmu) -> None:
    """Without friction in its model, the estimated velocity is that of a mass under a constant force."""
    a = 3.0
    none = {"sigma0": 1e-9, "sigma1": 0.0, "sigma2": 0.0, "k0": 0.0, "k1": 0.0, "Gamma0": 0.0, "Gamma1": 0.0}
    inputs = {"x": 0.5 * a * (K * Ts) ** 2, "u_prev": np.full(60, a)}
    found = gap("ANDFC", build_fmu, inputs, m=1.0, Gamma2=0.0, **none)
    assert found["v_est"][VALID] == pytest.approx((a * K * Ts)[VALID], abs=1e-7)


@pytest.mark.parametrize(
    "name",
    [
        *("LuGreFeedforward", "ElastoPlasticFeedforward", "GMSFeedforward"),
        pytest.param("LeuvenFeedforward", marks=landing),
        "ModifiedLeuvenFeedforward",
    ],
)
def test_a_feedforward_law_slides_at_the_true_velocity(name: str, build_fmu) -> None:
    """Steady sliding on the Stribeck curve, Fc + (Fs - Fc) exp(-(v/vs)^2) + sigma2 v, before and after the gap."""
    v, count = 1e-3, 600
    k = np.arange(count)
    start = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "sigma2": 0.4, "gain": 1.0}
    start |= {"mass" if "Leuven" in name else "m": 0.0}
    start |= {"n": 100.0} if name == "ModifiedLeuvenFeedforward" else {}
    rows = load(build_fmu(name, Ts=Ts))
    with Instance(rows) as block:
        block.initialise(**start)
        found = []
        for i in k:
            block.set({"r": math.nan if 500 <= i < 510 else v * i * Ts, "rd": v})
            assert block.call("DoStep", i * Ts, Ts, 1) in (OK, WARNING)
            found.append(block.get1("F_hat"))
    steady = 1.0 + 0.5 * np.exp(-1.0) + 0.4 * v
    assert found[499] == pytest.approx(steady, rel=2e-3)
    assert found[510] == pytest.approx(found[499], rel=1e-4)
    assert found[599] == pytest.approx(steady, rel=2e-3)


def test_the_preview_prefilter_sees_no_jump_after_missing_references(build_fmu) -> None:
    """At a constant velocity, there is no acceleration."""
    found = gap("PreviewPrefilter", build_fmu, {"r": 0.1 * K * Ts}, m=1.0)
    since = (K >= 8) & VALID
    assert found["rd_now"][since] == pytest.approx(np.full(since.sum(), 0.1), rel=1e-9)
    assert found["u_hat"][since] == pytest.approx(np.zeros(since.sum()), abs=1e-6)
    assert found["r_now"][since] == pytest.approx(0.1 * (K[since] - 4) * Ts, rel=1e-9)


@pytest.mark.parametrize("a", [0.0, 3.0])
def test_the_discrete_inverse_goes_on_at_the_velocity_over_a_gap(a: float, build_fmu) -> None:
    """A mass of 1 kg at a constant velocity needs no force; at a constant acceleration, a."""
    r = 0.1 * K * Ts + 0.5 * a * (K * Ts) ** 2
    found = gap("DiscreteInverse", build_fmu, {"r": r})
    line = np.where(K < 40, K, 40) * (r[40] - r[29]) / 11.0 + r[40] - 40 * (r[40] - r[29]) / 11.0
    since = np.maximum(K - 13, 0)
    known = np.where(K < 40, r[since], np.where(since < 40, line[since], r[since]))
    assert found["r_now"][VALID] == pytest.approx(known[VALID], abs=1e-12)
    assert found["u"][25:30] == pytest.approx(np.full(5, a), abs=1e-6)
    # the velocity over the gap lags by 5.5 samples; the inverse of the sampled mass overshoots
    assert np.max(np.abs(found["u"][40:] - a)) < 1e-6 + 8.0 * a
    assert found["u"][56:] == pytest.approx(np.full(4, a), abs=1e-6 + 0.01 * a)


@pytest.mark.parametrize("window", [1, 4])
@pytest.mark.parametrize("real", ["double", "float"])
def test_a_loop_knows_how_long_it_missed_the_position(window: int, real, tmp_path: Path) -> None:
    """v = 0.1 m/s from positions; ten references are NaN, and everything is held meanwhile."""
    laws = {
        "compensator": LoopLaw("DisturbanceObserver", {"fq": 20.0}),
        "servo": LoopLaw("CascadePPI", {"kp": 30.0, "kv": 190.0}),
    }
    path = tmp_path / "loop.toml"
    path.write_text(loop_text(LoopFile(laws, Ts, -50.0, 50.0, window=window, v0=0.1), "A loop"), encoding="utf-8")
    export = make_export(path, real=real)
    x = 0.1 * K * Ts
    rows = rows_of(export, commands(export, 60) | {"r": np.where(VALID, x, math.nan), "x": x, "rd": np.full(60, 0.1)})
    found = LawC(export, tmp_path).run(rows, feeds_back=True)
    names = [v.name for v in export.law.select(Kind.OUTPUT)]
    assert found[:, names.index("v")] == pytest.approx(np.full(60, 0.1), rel=1e-3 if real == "float" else 1e-9)
    # nothing accelerates, so the observer sees no more than rounding
    assert np.abs(found[:, names.index("u")]).max() < (0.5 if real == "float" else 1e-6)


def commands(export: Export, n: int) -> dict[str, np.ndarray]:
    """All other inputs at their start values."""
    return {v.name: np.full(n, v.starts[0]) for v in export.groups["inputs"]}


@pytest.mark.parametrize(
    "name",
    some(
        ["PID", "DisturbanceObserver", "KalmanFriction", "AdaptiveLuGre", "GMSObserver", "PreviewPrefilter"],
        ["PID", "KalmanFriction", "GMSObserver"],
    ),
)
def test_an_absurd_sample_does_no_lasting_harm_in_float(name: str, tmp_path: Path) -> None:
    """Each input in turn is 1e36 once: results stay finite, and outputs are held in that sample."""
    check_absurd(name, tmp_path)


def check_absurd(name: str, folder: Path) -> None:
    export = make_export(name, real="float")
    law = LawC(export, folder)
    given = samples(export, 30)
    outputs = len(export.law.select(Kind.OUTPUT))
    for variable in export.law.select(Kind.INPUT, Kind.OPTIONAL):
        for absurd in (1e36, -3e38):
            column = given[variable.name].copy()
            column[20] = absurd
            found = law.run(rows_of(export, {**commands(export, 30), **given, variable.name: column}), feeds_back=True)
            assert np.isfinite(found).all(), variable.name
            assert (found[20, :outputs] == found[19, :outputs]).all() or given["enable"][20] == 0.0


def test_a_result_that_overflows_sets_the_law_back(tmp_path: Path) -> None:
    """Finite inputs near the limit: m (v - v_last)/Ts overflows double, and the observer starts anew."""
    export = make_export("DisturbanceObserver")
    v = np.zeros(10)
    v[5] = 1e307
    rows = rows_of(export, commands(export, 10) | {"v": v, "u_prev": np.full(10, 7.0)})
    found = LawC(export, tmp_path).run(rows, feeds_back=True)
    assert np.isfinite(found).all()
    assert (found[5, :3] == 0.0).all()
    assert found[7:, 0] == pytest.approx(found[1:4, 0], rel=1e-12)


@pytest.mark.parametrize("name", ["PID", "CascadePPI", "ResetPID"])
def test_a_small_error_is_integrated_at_a_large_force_in_float(name: str, tmp_path: Path) -> None:
    """Half a second with e = 1 um at 500 N and Ts = 50 us: u rises by Ki times the integral of the error."""
    n, step, e, force, K_i, K_p = 10_000, 5e-5, 1e-6, 500.0, 250e3, 12e3
    start = {"Ts": step, "Kp": K_p, "Ki": K_i} if name != "CascadePPI" else {"Ts": step, "kp": 30.0, "ki": K_i / 30.0}
    export = make_export(name, real="float", start=start)
    track = np.zeros(n)
    track[0] = 1.0
    given = commands(export, n) | {"x": np.full(n, -e), "track": track, "u_track": np.full(n, force)}
    u = LawC(export, tmp_path).run(rows_of(export, given), feeds_back=True)[:, 0]
    assert u[-1] - u[0] == pytest.approx(K_i * e * step * (n - 1), rel=1e-3)
