"""The equations in Modelica and in C over the same motion, with reversals, rests and break-away."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchange.solver import Exchange
from fmpy import extract
from modelica.library import Library
from thorough import nightly

NODES = np.array([0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.14, 0.2, 0.24, 0.3, 0.32, 0.36, 0.4, 0.5])
V = np.array([0.0, 1e-3, 0.0, 0.0, -1e-3, 0.0, 5e-3, 5e-3, -5e-3, -5e-3, 0.0, 0.0, 2e-3, 2e-3])
LOAD = np.array([1.0, 1.0, 1.5, 1.5, 2.0, 0.5, 0.5, 1.2, 0.0, -0.5, 0.5, 1.0, 1.0, 1.0])  # the contact opens once
GRID = np.union1d(np.round(np.linspace(0.0, 0.5, 501), 9), NODES)
AGREEMENT = 1e-6  # of the largest force

THREE = {"N": 3, "k": [3e4, 2e4, 1e4]}
NEGATIVE = {"Fc_neg": 0.8, "Fs_neg": 1.0, "vs_neg": 2e-3, "delta_neg": 1.0, "sigma2_neg": 0.1}
TIP = {"a": 1e-5, "k": 1e5, "E0": 1e-5, "m": 1e-2, "damping": 3e3}


def case(law: str, values: Mapping[str, Any], load: str = "", *, night: bool = False) -> Any:
    marks = (nightly,) if night else ()
    name = "-".join([law, *(["load"] if load else []), *(f"{n}={v}" for n, v in values.items())])
    return pytest.param(law, values, {load: LOAD} if load else {}, id=name.replace(" ", ""), marks=marks)


CASES = [
    case("Viscous", {"delta_v": 2.0}),
    case("Dahl", {}, "Fn"),
    case("Dahl", {"n": 0.5}),
    case("Dahl", {"n": 0.0}, night=True),
    case("Dahl", {"n": 3.0}, night=True),
    case("LuGre", {}, "Fn"),
    case("LuGre", {"delta": 1.0, "v_d": 1e-2}, night=True),
    case("LuGre", {"asymmetric": True, **NEGATIVE}),
    case("ElastoPlastic", {}, "Fn"),
    case("ElastoPlastic", {"delta": 1.0, "v_d": 1e-2}, night=True),
    case("MaxwellSlip", {**THREE, "W": [0.3, 0.4, 0.5]}, "Fn"),
    case("MaxwellSlip", {}, night=True),
    case("GMS", {**THREE, "alpha": [0.3, 0.4, 0.5], "Ci": [-1.0, 50.0, 20.0], "sigma": 5.0}),
    case("GMS", {}, "Fn", night=True),
    case("ModifiedLeuven", {"N": 2, "k": [6e4, 4e4], "W": [0.8, 0.8]}, "Fn"),  # N = n: rumoca takes one for the other
    case("BlimanSorine", {"eps": 1e-4}, "Fn"),
    case("BlimanSorine", {"eps": 1e-4, "order": 1}, night=True),
    case("LoadDependentDahl", {"eps": 1e-5}, "F_t"),
    case("ResetIntegrator", {}, "Fn"),
    case("RateAndState", {}, "Fn"),
    case("RateAndState", {"law": True}, night=True),
    case("PrandtlTomlinson", TIP),
]


def start_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a law as those of the FMU."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        found |= {f"{name}[{i}]": one for i, one in enumerate(value, 1)} if isinstance(value, list) else {name: value}
    return found


@pytest.mark.parametrize(("law", "values", "inputs"), CASES)
def test_friction_is_that_of_the_fmu(
    law: str,
    values: Mapping[str, Any],
    inputs: Mapping[str, np.ndarray],
    library: Library,
    build_fmu: Callable[..., Path],
    tmp_path: Path,
) -> None:
    extract(str(build_fmu(law, **start_values(values))), str(tmp_path))
    lines = {name: np.interp(GRID, NODES, line) for name, line in {"v": V, **inputs}.items()}
    fmu = Exchange(tmp_path, GRID, lines, {})
    stepped = fmu.co_simulation(["F"])[:, 0]
    t, F = library.prescribed(law, NODES, V, values, inputs, 1e-3)
    # at an event there are two values, before and after it
    first, last = (np.searchsorted(t, GRID + shift) for shift in (-1e-9, 1e-9))
    off = np.minimum(np.abs(F[first] - stepped), np.abs(F[last - 1] - stepped))
    if law == "RateAndState":
        off[lines["v"] == 0.0] = 0.0  # its force changes from 0 within a rounding error of v
    assert np.max(off) <= AGREEMENT * np.max(np.abs(stepped))
    if fmu.description.modelExchange and law != "RateAndState":
        exchanged = fmu.model_exchange(["F"], 1e-10)[0][:, 0]
        off = np.minimum(np.abs(F[first] - exchanged), np.abs(F[last - 1] - exchanged))
        assert np.max(off) <= AGREEMENT * np.max(np.abs(stepped))
