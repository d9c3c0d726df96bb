"""The error of numbers that summarise runs: in sweeps and in studies."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from accuracy.known import damped, decay, driven, exact_damped, sampled
from thorough import nightly

from harness import CallablePart, Experiment, FmuPart, Noise, System, sweep
from harness.accuracy.measure_bounds import number_bound


@nightly
def test_a_swept_measure_has_the_bound_of_its_closed_form(tmp_path: Path) -> None:
    """v = exp(-Fv t) at 1 s."""
    with decay() as system:
        samples = [{"friction.Fv": value} for value in (1.0, 2.0, 4.0)]
        experiment = Experiment(stop=1.0, step=0.01, master="gauss-seidel")
        plain = sweep(system, samples, measure="final(mass.v)", experiment=experiment, executor="serial")
        told = sweep(
            system,
            samples,
            measure="final(mass.v)",
            experiment=experiment,
            executor="serial",
            accuracy=True,
            output=tmp_path / "sweep",
        )
    assert np.array_equal(told["final(mass.v)"], plain["final(mass.v)"])
    assert "final(mass.v).bound" not in plain
    error = np.abs(plain["final(mass.v)"].to_numpy() - np.exp(-np.array([1.0, 2.0, 4.0])))
    bound = told["final(mass.v).bound"].to_numpy()
    assert (error > 1e-4).all() and (error <= bound).all() and (bound < 5.0 * error).all()


def test_a_run_that_cannot_be_repeated_is_the_error_of_its_row() -> None:
    with driven("LuGre") as system:
        experiment = Experiment(stop=0.1, step=1e-3, manipulators=(Noise("friction.v", 1e-6),))
        table = sweep(
            system,
            [{"mass.m": 1.0}],
            measure="final(mass.x)",
            experiment=experiment,
            executor="serial",
            accuracy=True,
        )
    assert "draws a random number in each step" in str(table["error"][0].item())


@pytest.mark.parametrize(
    ("values", "bound"),
    [
        ([1.001, 1.004, 1.016], 2.5 * 0.003 / 3.0),  # second order: 1 + 0.1 h^2 with h = 0.1
        ([1.01, 1.01, 1.16], 0.15 / 4.0),  # agreement by chance
        ([1.0, math.nan, 1.0], math.inf),
        ([1.0], math.inf),
    ],
)
def test_the_bound_of_a_number(values: list[float], bound: float) -> None:
    found = number_bound(values, most=2.0, noise=0.0, finer=False)
    assert found >= 0.9 * bound
    assert found < 4.0 * bound or math.isinf(bound)


@nightly
def test_a_part_that_is_sampled_in_every_second_step_leaves_room_for_one_other_run() -> None:
    with sampled(2) as system:
        assert any(isinstance(part, FmuPart) and part.every == 2 for part in system.parts.values())
        result = system.run(stop=0.4, step=0.25e-3, master="newton", accuracy=True)
    assert result.attrs["accuracy"] == "within tolerance"
    assert math.isnan(result["axis.v"].attrs["observed_order"])
    assert result["friction.F"].attrs["energy_error"] < 0.05 * abs(result["friction.F"].attrs["energy"])


@pytest.mark.parametrize(("steps", "decimate"), [(100, 1), (102, 1), (103, 1), (103, 10)])
def test_bounds_hold_whatever_the_number_of_steps(steps: int, decimate: int) -> None:
    """Runs with two and four times the step end before 103 steps do, or have their last row before."""
    kinds = {"final": lambda y: y[-1], "mean": np.mean, "rms": lambda y: np.sqrt(np.mean(y**2))}
    masters, lengths = ("newton", "gauss-seidel", "jacobi"), (0.5e-2, 0.6e-2, 0.7e-2)
    samples = [{"master": master, "step": step, "stop": steps * step} for master in masters for step in lengths]
    names = {f"{kind}({name})": (kind, name) for kind in kinds for name in ("mass.x", "mass.v")}
    with damped() as system:
        experiment = Experiment(stop=1.0, step=0.1, decimate=decimate)
        table = sweep(system, samples, measure=names, experiment=experiment, executor="serial", accuracy=True)
    fine = 50 if decimate == 1 else 1  # rows in every step tell a mean over time, others one over rows
    missed = []
    for run, sample in enumerate(samples):
        rows = steps // decimate * fine + 1
        exact = exact_damped(np.arange(rows) * (sample["step"] * decimate / fine))
        for label, (kind, name) in names.items():
            error = abs(table[label].to_numpy()[run] - kinds[kind](exact[name]))
            if not error <= table[f"{label}.bound"].to_numpy()[run]:
                missed.append((sample, label))
    assert len(missed) <= 2  # of 54: 95 %


def test_an_exact_system_has_the_error_of_a_mean_over_rows() -> None:
    """The mean of t over rows is exact, that of t^2 is off by stop h/6, also with 101 steps."""
    samples = [{"stop": 0.01 * steps} for steps in (100, 101, 103)]
    with System([CallablePart("clock", lambda t, u, x: [t, t * t], outputs=["t", "square"])]) as system:
        experiment = Experiment(stop=1.0, step=0.01)
        table = sweep(system, samples, measure="mean(*)", experiment=experiment, executor="serial", accuracy=True)
    stops = table["stop"].to_numpy()
    error = np.abs(table["mean(clock.square)"].to_numpy() - stops**2 / 3.0)
    assert error == pytest.approx(stops * 0.01 / 6.0, rel=1e-3)
    bound = table["mean(clock.square).bound"].to_numpy()
    assert (error <= bound).all() and (bound < 5.0 * error).all()
    assert (table["mean(clock.t).bound"] < 1e-9).all()
