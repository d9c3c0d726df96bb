"""Learned residuals: on made records whose residual is known, and on measured ones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from contacts import Array, noise
from thorough import nightly, some

from friction_fmus.__main__ import main
from friction_fmus.data import load_emps, load_tribometer
from friction_fmus.identification import FitError, Record, identify, learn_residual
from harness import FmuPart, System

TS = 2e-3
T = TS * np.arange(15_000)


def lacking(x: Array, v: Array) -> Array:
    """What a Coulomb model lacks: friction that depends on position forward, and on speed backward."""
    forward, backward = 0.6 * np.sin(2.0 * np.pi * x / 0.2), 2.0 * np.abs(v)
    return np.where(v > 0.0, forward, np.where(v < 0.0, -backward, 0.0))


def made(size: float, seed: int = 3) -> Record:
    """A friction force along strokes of 0.1 m at changing speeds."""
    phase = 2.0 * np.pi * (0.4 * T + np.sin(2.0 * np.pi * 0.037 * T))
    rate = 2.0 * np.pi * (0.4 + 2.0 * np.pi * 0.037 * np.cos(2.0 * np.pi * 0.037 * T))
    q, v = 0.05 * (1.0 - np.cos(phase)), 0.05 * rate * np.sin(phase)
    friction = 3.0 * np.sign(v) + size * lacking(q, v) + noise(seed, len(T), 0.1)
    return Record("made", T, q=q, v=v, friction=friction)


def test_it_finds_what_a_model_lacks() -> None:
    record = made(1.0)
    train, validation = record.window(0.0, 18.0), record.window(18.0, 30.0)
    result = identify("Coulomb", train, validation=validation)
    learned = learn_residual(result, validation)
    assert learned is not None
    assert learned.over_position
    assert learned.validation_without > 0.19
    assert learned.validation < 1.15 * 0.1  # the noise
    assert learned.crossed == pytest.approx(learned.validation, rel=0.1)
    fast = np.abs(validation.column("v")) > 0.05
    x, v = validation.column("q")[fast], validation.column("v")[fast]
    F = result.values()["Fc"] * np.sign(v)
    expected = 3.0 * np.sign(v) + lacking(x, v)
    found = learned.table.total(F, x, v) + result.values()["OF"]
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.04


def test_there_is_none_where_a_model_lacks_nothing() -> None:
    assert learn_residual(identify("Coulomb", made(0.0).window(0.0, 18.0))) is None


def test_validation_data_have_no_influence() -> None:
    result = identify("Coulomb", made(1.0).window(0.0, 10.0))
    one = learn_residual(result)
    other = learn_residual(result, made(1.0, seed=8).window(10.0, 20.0))
    assert one is not None and other is not None
    assert one.table == other.table
    assert math.isnan(one.validation) and math.isfinite(other.validation)


def test_a_residual_that_only_adds_is_passive_with_every_model() -> None:
    record = made(1.0)
    learned = learn_residual(identify("Coulomb", record.window(0.0, 18.0)), only_adds=True)
    assert learned is not None
    x, v = record.column("q"), record.column("v")
    F = np.random.default_rng(2).normal(size=len(v))
    assert ((learned.table.total(F, x, v) - F) * v >= 0.0).all()


def test_a_model_of_positions_has_no_residual() -> None:
    result = identify("Coulomb", made(0.0).window(0.0, 2.0))
    with pytest.raises(FitError, match="Coulomb was fitted to positions, not to a force"):
        learn_residual(replace(result, signal="q"))


def test_the_command_says_first_what_it_cannot_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["identify", "emps", "--residual", "--method", "free-run", "-o", str(out)]) == 2
    assert "--residual needs a fit to forces" in " ".join(capsys.readouterr().err.split())
    assert not out.exists()


@pytest.mark.parametrize(
    ("model", "most"), some([("Coulomb", 0.35), ("Stribeck", 0.75), ("LuGre", 0.75)], [("Coulomb", 0.35)])
)
def test_emps_lacks_a_residual(model: str, most: float) -> None:
    """Validation from 15 s on, the friction before."""
    record = load_emps().record
    train, validation = record.window(0.0, 15.0), record.window(15.0, 25.0)
    learned = learn_residual(identify(model, train, starts=1), validation)
    assert learned is not None
    assert learned.validation < most * learned.validation_without
    v = validation.column("q") * 0.0 + 0.1
    total = learned.table.total(np.zeros(len(v)), validation.column("q"), v)
    assert (total >= 0.0).all() and (total <= learned.table.R_max).all()


@nightly
@pytest.mark.parametrize("model", ["Dahl", "MaxwellSlip"])
def test_the_tribometer_lacks_a_residual(model: str) -> None:
    record = load_tribometer()
    train, validation = record.window(7.0, 60.0), record.window(60.0, 100.0)
    learned = learn_residual(identify(model, train, starts=1), validation)
    assert learned is not None
    assert learned.validation < 0.7 * learned.validation_without


@nightly
def test_the_command_writes_the_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It predicts the record as the table does."""
    record = made(1.0)
    table = np.column_stack([T, record.column("q"), record.column("v"), record.column("friction")])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t [s],x [m],v [m/s],friction [N]", comments="")
    out = tmp_path / "out"
    assert main(["identify", str(tmp_path / "log.csv"), "--model", "Coulomb", "--residual", "-o", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "residual of Coulomb over velocity, position and direction, at most" in printed
    assert "CoulombResidual.fmu" in printed
    result = identify("Coulomb", record.window(0.0, 17.9))
    learned = learn_residual(result)
    assert learned is not None
    parts = [FmuPart("learned", out / "CoulombResidual.fmu")]
    with System(parts, [], {"learned.f": 3.0, "learned.x": 0.03, "learned.v": 0.1}) as system:
        found = system.run(stop=0.01, step=1e-3)["learned.u"].to_numpy()[-1]
    expected = learned.table.total(np.array([3.0]), np.array([0.03]), np.array([0.1]))[0]
    assert found == pytest.approx(expected, abs=0.05)
