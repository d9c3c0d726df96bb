"""Free run: multiple shooting on an unstable system, an axis whose motion has a closed form, and the EMPS record."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from contacts import Array, noise
from scipy.signal import cont2discrete
from thorough import nightly

from friction_fmus.identification import FitError, Record, identify
from friction_fmus.identification.fit.shooting import Arc, Prior, shoot

TS = 5e-3
T = 3.0 + TS * np.arange(4000)
M, FV, OF, RATE = 12.0, 40.0, 1.5, 0.02
PUSH = sum(a * np.sin(w * T + p) for a, w, p in ((20.0, 3.1, 0.3), (15.0, 7.3, 1.0), (8.0, 17.0, 2.0), (6.0, 0.7, 0.0)))
FORCE: Array = PUSH + OF


def viscous_axis() -> Record:
    """M dv/dt = u - Fv v - OF - OF_rate (t - middle) for a force that is held: the exact discrete system."""
    load = OF + RATE * (T - 0.5 * (T[0] + T[-1]))
    A, B, *_ = cont2discrete((np.array([[0.0, 1.0], [0.0, -FV / M]]), np.array([[0.0], [1.0 / M]]), np.eye(2), 0.0), TS)
    state, path = np.array([0.1, 0.02]), []
    # the load changes over a sample, so its mean counts
    for u in FORCE - load - 0.5 * RATE * TS:
        path.append(state[0])
        state = A @ state + B[:, 0] * u
    return Record("viscous", T, q=np.array(path) + noise(2, len(T), 2e-6), force=FORCE)


@nightly
def test_parameters_and_drift_of_an_axis_with_a_closed_form() -> None:
    record = viscous_axis()
    train, validation = record.window(3.0, 15.0), record.window(15.0, 23.0)
    result = identify("Viscous", train, validation=validation, method="free-run")
    assert (result.method, result.signal, result.unit) == ("free-run", "q", "m")
    middle = 9.0  # of the training data
    expected = {"M": M, "Fv": FV, "OF": OF + RATE * (middle - 0.5 * (T[0] + T[-1])), "OF_rate": RATE}
    for name, value in expected.items():
        assert result.parameters[name].value == pytest.approx(value, rel=0.01), name
    assert result.validation is not None
    assert result.validation.rms < 2e-4  # of a travel of a metre, 14 s after the middle of the training data
    assert len(result.measured) == len(train) - 20
    assert any("drifts by" in warning for warning in result.warnings)


@nightly
def test_the_result_is_written_and_drawn(tmp_path: Path) -> None:
    result = identify("Viscous", viscous_axis().window(3.0, 9.0), method="free-run")
    assert result.plot(tmp_path / "free.png").is_file()
    assert result.to_fmu(tmp_path).is_file()
    assert "Fv" in result.to_ssv(tmp_path / "free.ssv").read_text(encoding="utf-8")


def test_multiple_shooting_fits_a_system_that_runs_away() -> None:
    """x'' = k x for 8 s: an error of 20 % in k multiplies the end of one simulation by five."""
    k, step = 4.0, 0.01
    t = step * np.arange(801)
    q = 1e-3 * np.exp(-2.0 * t) + 1e-6 * np.exp(2.0 * t)
    q += noise(1, len(t), 1e-6)

    def simulate(x: Array, arc: Arc, state: Array) -> tuple[Array, Array]:
        w, s = np.sqrt(x[0]), step * np.arange(arc.end - arc.begin + 1)
        grows, falls = 0.5 * (state[0] + state[1] / w), 0.5 * (state[0] - state[1] / w)
        rising, falling = grows * np.exp(w * s), falls * np.exp(-w * s)
        return rising + falling, w * (rising - falling)

    begins = [*range(0, 800, 100), 800]
    arcs = [Arc(0, a, b, q[a : b + 1]) for a, b in pairwise(begins)]
    states = np.array([[q[arc.begin], np.gradient(q, step)[arc.begin]] for arc in arcs])
    prior = Prior(np.array([5.0]), np.array([2.0]), np.array([0.1]), np.array([10.0]))
    found = shoot(simulate, arcs, states, prior, 100.0, np.array([1e-7, 1e-7]))
    assert found.converged
    assert found.x[0] == pytest.approx(k, rel=1e-3)
    ends = np.array([simulate(found.x, arc, state)[0][-1] for arc, state in zip(arcs, found.states, strict=True)])
    np.testing.assert_allclose(ends[:-1], found.states[1:, 0], atol=1e-6)


def test_it_needs_a_drive_force_and_a_position() -> None:
    record = viscous_axis().window(3.0, 9.0)
    assert record.q is not None
    v = np.gradient(record.q, TS)
    with pytest.raises(FitError, match="needs the columns position and force"):
        identify("Viscous", Record("v", record.t, v=v, force=record.force), method="free-run")
    with pytest.raises(FitError, match="needs the columns position and force"):
        identify("Viscous", Record("friction", record.t, q=record.q, friction=FV * v), method="free-run")
