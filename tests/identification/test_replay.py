"""An identified contact that is run along its record gives the force of the fit, under the default master."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from contacts import LUGRE, Array, dahl_force, lugre_force, maxwell_force

from friction_fmus import fmu
from harness import Drive, FmuPart, SeriesPart, System

STEP = 2e-3
T = STEP * np.arange(150)
V = 8e-3 * np.sin(2.0 * np.pi * 10.0 * T) + 2e-3
# of straight lines of the velocity; a reversal within a step has a path of its own
TIMES = np.unique(np.concatenate([T, [t - v * STEP / d for t, v, d in zip(T, V, np.diff(V), strict=False) if d]]))
TIMES = TIMES[np.abs(TIMES - 0.5 * T[-1]) <= 0.5 * T[-1]]
PATH = np.append(0.0, np.cumsum(0.5 * np.diff(TIMES) * (np.interp(TIMES[1:], T, V) + np.interp(TIMES[:-1], T, V))))

DAHL = {"sigma": 1e5, "Fc": 10.0}
ELEMENTS = {"N": 2, "k[1]": 5e4, "k[2]": 2e4, "W[1]": 4.0, "W[2]": 6.0}
GMS = {"N": 2, "k[1]": 5e4, "k[2]": 2e4, "alpha[1]": 0.4, "alpha[2]": 0.6, "Fc": 10.0, "Fs": 15.0, "C": 500.0}


def at_samples(force: Array) -> Array:
    return force[np.searchsorted(TIMES, T - 1e-12)]


@pytest.mark.parametrize(
    ("model", "parameters", "known"),
    [
        ("LuGre", LUGRE, lambda: lugre_force(T, V)),
        ("Dahl", DAHL, lambda: at_samples(dahl_force(PATH, DAHL["sigma"], DAHL["Fc"]))),
        (
            "MaxwellSlip",
            ELEMENTS,
            lambda: at_samples(maxwell_force(PATH, np.array([5e4, 2e4]), np.array([4.0, 6.0]), np.zeros(2))),
        ),
        ("GMS", GMS, None),
    ],
)
def test_replay_is_the_force_of_the_fit(
    model: str, parameters: Mapping[str, float], known: Callable[[], Array] | None
) -> None:
    drive = Drive(FmuPart("friction", fmu(model)))
    fitted = drive.run({"v": V}, ["F"], STEP, between="linear", start=parameters, tolerance=1e-9)[:, 0]
    drive.close()
    start = {f"friction.{name}": value for name, value in parameters.items()}
    parts = [SeriesPart("record", T, {"v": V}, {"v": "m/s"}), FmuPart("friction", fmu(model))]
    with System(parts, ["record.v -> friction.v"], start) as system:
        replayed = system.run(stop=float(T[-1]), step=STEP, tolerance=1e-9)["friction.F"].values
    largest = float(np.max(np.abs(fitted)))
    assert np.max(np.abs(replayed - fitted)) < 1e-9 * largest
    if known is not None:
        assert np.max(np.abs(replayed - known())) < 1e-6 * largest
