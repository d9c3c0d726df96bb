"""Blocks that are for model exchange and continuous, with what is compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from exchange.motions import NODE, drawn
from exchange.solver import Exchange
from fmpy import extract, read_model_description

from friction_fmus import catalogue

SAME_TIME = 1e-6  # s
AGREEMENT = 1e-6
FORCE_LEVEL = 1.0  # N, the Coulomb friction of all models


@dataclass(frozen=True)
class Case:
    """A block with other start values: its outputs, and its flags, which change at events only.

    `decided_by` is a variable whose sign decides the flags, and the size below which rounding decides its sign.
    """

    block: str
    start: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ("F",)
    inputs: Mapping[str, float] = field(default_factory=lambda: {"v": 0.0, "Fn": 1.0})
    tolerance: float = 1e-9
    decided_by: tuple[str, float] | None = None


_ELEMENTS = tuple(f"slipping[{i}]" for i in range(1, 11))
_AT_REST = {"v": 0.0, "F_ext": 0.5, "Fn": 1.0}
_NEGATIVE = {"asymmetric": 1.0, "Fc_neg": 0.8, "Fs_neg": 1.1, "vs_neg": 2e-3}

CASES = {
    "LuGre": Case("LuGre"),
    "LuGre asymmetric": Case("LuGre", {**_NEGATIVE, "sigma2_neg": 0.9}),
    "LuGre fading": Case("LuGre", {"v_d": 1e-3}),
    "Dahl": Case("Dahl"),
    "Dahl ductile": Case("Dahl", {"n": 2.0}),
    "Dahl brittle": Case("Dahl", {"n": 0.5}),
    "Dahl plastic": Case("Dahl", {"n": 0.0}),
    "BlimanSorine": Case("BlimanSorine", tolerance=1e-10),
    "BlimanSorine first order": Case("BlimanSorine", {"order": 1}, tolerance=1e-10),
    "LoadDependentDahl": Case("LoadDependentDahl", inputs={"v": 0.0, "F_t": 1.0}),
    "RateAndState": Case("RateAndState"),
    "RateAndState slip": Case("RateAndState", {"law": 1}, tolerance=1e-10),
    "Viscous": Case("Viscous", {"delta_v": 1.5}, inputs={"v": 0.0}),
    "ElastoPlastic": Case("ElastoPlastic", flags=("elastic",)),
    "GMS": Case("GMS", flags=_ELEMENTS),
    "GMS damped": Case("GMS", {"sigma": 1.0, "Ci[1]": 50.0, "Ci[3]": 300.0}, flags=_ELEMENTS),
    "MaxwellSlip": Case("MaxwellSlip", flags=_ELEMENTS),
    "ModifiedLeuven": Case("ModifiedLeuven", flags=_ELEMENTS, decided_by=("der(z)", 1e-9)),
    "Leuven": Case("Leuven", flags=("depth", "sliding")),
    "Leuven sharp": Case("Leuven", {"n": 20.0}, flags=("depth",)),
    "ResetIntegrator": Case("ResetIntegrator", flags=("stuck",)),
    "Coulomb": Case("Coulomb", flags=("stuck",), inputs=_AT_REST),
    "Stiction": Case("Stiction", flags=("stuck",), inputs=_AT_REST),
    "Tustin": Case("Tustin", flags=("stuck",), inputs=_AT_REST),
    "Stribeck": Case("Stribeck", flags=("stuck",), inputs=_AT_REST),
    "Stribeck asymmetric": Case(
        "Stribeck", {**_NEGATIVE, "Fv_neg": 0.9, "offset": 0.1, "shape": 1}, flags=("stuck",), inputs=_AT_REST
    ),
    "Karnopp": Case("Karnopp", flags=("stuck",), inputs=_AT_REST),
    "KarnoppMass": Case("KarnoppMass", outputs=("x", "v"), flags=("stuck",), inputs={}, tolerance=1e-12),
    "Mass": Case("Mass", {"k": 1e3, "d": 2.0}, outputs=("x", "v"), inputs={}, tolerance=1e-12),
    "TwoMass": Case("TwoMass", outputs=("x1", "v2"), inputs={}, tolerance=1e-12),
    "Belt": Case("Belt", outputs=("x", "v"), inputs={}, tolerance=1e-12),
    "Cogging": Case("Cogging", inputs={}),
    "DCMotor": Case("DCMotor", {"K": 0.4, "R": 4.0}, outputs=("F", "i"), inputs={}),
    "TransmissionLoad": Case("TransmissionLoad", {"at_rest": 0.3, "b_drive": 0.2}, outputs=("Fn",), inputs={}),
    "PositionMap": Case("PositionMap", outputs=("F_position",), inputs={}),
    "Quantiser": Case("Quantiser", {"q": 1e-4}, outputs=("y",), inputs={}),
    "Sine": Case("Sine", outputs=("r",), inputs={}),
    "Profile": Case("Profile", outputs=("r", "rd"), inputs={}),
    "Circle": Case("Circle", outputs=("x", "yd"), flags=("reversals",), inputs={}),
    "Multisine": Case("Multisine", outputs=("r", "rdd"), inputs={}),
    "Record": Case("Record", outputs=("r",), inputs={}),
    "Sum": Case("Sum", outputs=("y",), inputs={}),
}


def covered() -> set[str]:
    """Blocks that are compared."""
    return {case.block for case in CASES.values()}


def wanted() -> set[str]:
    """Continuous blocks that claim model exchange."""
    blocks = catalogue().values()
    return {each.name for each in blocks if not each.no_exchange and "\n#define SAMPLED" not in each.code}


def agreement(case: Case, build_fmu: Callable[..., Path], seed: int, duration: float = 1.0) -> int:
    """Compare both kinds over a random motion; the number of events."""
    fmu = build_fmu(case.block, **case.start)
    folder = fmu.with_suffix(".exchange")
    if not folder.is_dir():
        extract(str(fmu), str(folder))
    nodes, lines = drawn(read_model_description(str(folder)), seed, duration)
    run = Exchange(folder, nodes, lines, {})
    names = (*case.outputs, *case.flags)
    exchanged, events = run.model_exchange(names, case.tolerance)
    # rounding of a line that ends at 0 would be a reversal: no bracket around a node
    apart = [event for event in events if np.min(np.abs(nodes - event)) > 2.0 * SAME_TIME]
    brackets = [t for event in apart for t in (event - SAME_TIME, event + SAME_TIME)]
    times = np.union1d(nodes, brackets)
    deciding, least = case.decided_by or ("time", 0.0)
    stepped = run.co_simulation((*names, deciding), brackets)
    decided = np.abs(stepped[:, -1]) >= least
    at_nodes = stepped[np.searchsorted(times, nodes)]
    near = np.min(np.abs(nodes[:, None] - np.array([-1.0, *events])), axis=1) <= SAME_TIME

    for k, name in enumerate(case.outputs):
        level = max(float(np.max(np.abs(at_nodes[:, k]))), FORCE_LEVEL if name == "F" else 0.0)
        assert np.max(np.abs(exchanged[~near, k] - at_nodes[~near, k])) <= AGREEMENT * level, name
    for k, name in enumerate(case.flags, start=len(case.outputs)):
        compared = ~near & decided[np.searchsorted(times, nodes)]
        assert np.array_equal(exchanged[compared, k], at_nodes[compared, k]), name
        for step in np.flatnonzero(np.diff(stepped[:, k]) * (decided[:-1] & decided[1:])):
            begin, end = times[step] - SAME_TIME, times[step + 1] + SAME_TIME
            inside = [event for event in events if begin <= event <= end]
            at_node = [event for event in inside if event not in apart]
            assert at_node or (inside and end - begin < 5.0 * SAME_TIME), (name, times[step + 1])
    return len(events)


assert NODE > 10.0 * SAME_TIME
