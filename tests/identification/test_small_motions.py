"""Stiffness and damping at rest from small motions."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from friction_fmus.identification import ExcitationError, FitError, Record, RecordError

sys.path.append(str(Path(__file__).parents[2] / "examples" / "identification"))
from small_motions import identify_presliding, shaken_contact

M, D, K = 2.0, 400.0, 2e5
TS = 1e-3


def shaken(seed: int, noise: float = 0.0, seconds: float = 40.0) -> Record:
    """A mass on a spring and a damper that many sines shake, in the steady state."""
    random = np.random.default_rng(seed)
    t = TS * np.arange(round(seconds / TS))
    f = np.fft.rfftfreq(len(t), TS)
    w = 2.0 * np.pi * f
    lines = (np.arange(len(f)) % 7 == 3) & (f > 0.5) & (f < 160.0)
    spectrum = np.where(lines, 0.01 * len(t) * np.exp(2j * np.pi * random.uniform(size=len(f))), 0.0)
    force = np.fft.irfft(spectrum, len(t))
    q = np.fft.irfft(spectrum / (K - M * w * w + 1j * w * D), len(t))
    return Record("shaken", t, q=q + random.normal(0.0, noise, len(t)), force=force)


def test_mass_spring_and_damper_are_found() -> None:
    found = identify_presliding(shaken(1), band=(1.0, 150.0)).values()
    assert found == pytest.approx({"sigma0": K, "sigma1 + sigma2": D, "M": M}, rel=5e-3)


def test_intervals_cover_the_truth_with_noise_in_the_position() -> None:
    truth = {"sigma0": K, "sigma1 + sigma2": D, "M": M}
    hits = {name: 0 for name in truth}
    for seed in range(40):
        found = identify_presliding(shaken(seed, noise=2e-8, seconds=20.0), band=(1.0, 100.0)).parameters
        for name, value in truth.items():
            hits[name] += abs(found[name].value - value) < 1.96 * found[name].standard_error
    assert all(count >= 34 for count in hits.values()), hits  # of 40; 38 are expected


def test_a_known_mass_is_kept_out() -> None:
    found = identify_presliding(shaken(2), band=(1.0, 150.0), mass=M)
    assert set(found.parameters) == {"sigma0", "sigma1 + sigma2"}
    assert found.values()["sigma0"] == pytest.approx(K, rel=5e-3)


def test_a_held_command_is_half_a_sample_late() -> None:
    random = np.random.default_rng(5)
    t = TS * np.arange(40_000)
    force = scipy.signal.sosfilt(scipy.signal.butter(2, 200.0, fs=1.0 / TS, output="sos"), random.normal(size=len(t)))
    A, B = np.array([[0.0, 1.0], [-K / M, -D / M]]), np.array([[0.0], [1.0 / M]])
    plant = scipy.signal.cont2discrete((A, B, np.array([[1.0, 0.0]]), np.zeros((1, 1))), TS)
    _, q, _ = scipy.signal.dlsim(plant, force)
    record = Record("held", t, q=q[:, 0], force=force)
    found = identify_presliding(record, band=(1.0, 100.0), held=True).values()
    assert found == pytest.approx({"sigma0": K, "sigma1 + sigma2": D, "M": M}, rel=1e-2)
    late = identify_presliding(record, band=(1.0, 10.0)).values()["sigma1 + sigma2"]
    assert late == pytest.approx(D + 0.5 * TS * K, rel=5e-2)


def test_lugre_at_rest_is_a_spring_and_a_damper() -> None:
    """With sigma0 A / Fs = 0.02 the contact has hardly begun to slide: 1e-4 of the stiffness."""
    found = identify_presliding(shaken_contact(), band=(3.0, 50.0)).values()
    assert found["sigma0"] == pytest.approx(1e5, rel=2e-2)
    assert found["sigma1 + sigma2"] == pytest.approx(np.sqrt(1e5) + 0.4, rel=5e-2)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"band": (50.0, 10.0)}, FitError, "band"),
        ({"mass": -1.0}, FitError, "negative"),
        ({"segments": 2}, FitError, "at least 4"),
        ({"segments": 4000}, RecordError, "has only .* samples for .* segments"),
        ({"band": (400.0, 499.0)}, ExcitationError, "coherent"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments: dict[str, object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        identify_presliding(shaken(4, noise=1e-8), **arguments)  # type: ignore[arg-type]
