"""The step that reaches a required accuracy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from harness.accuracy.estimate import Estimate
from harness.system.experiment import Experiment

MARGIN: Final = 0.8
"""Share of the required accuracy at which a suggestion aims."""

SHORTEST: Final = 4096
"""Largest quotient of the present and the suggested step: beyond it, the observed order says nothing."""


def suggested_step(found: Sequence[Estimate], experiment: Experiment, required: float, floor: float) -> float | None:
    """Return the step with which all variables have the required accuracy [s].

    It is the present step over a whole number, so that sampled parts keep their sample times.
    """
    if floor >= MARGIN * required:
        return None
    quotients = [1]
    for one in found:
        if one.verdict in {"right", "sensitive"}:
            continue
        if one.verdict != "too coarse":
            return None
        excess = one.worst / (MARGIN * required)
        quotients.append(math.ceil(excess ** (1.0 / one.convergence.expected)))
    quotient = max(quotients)
    return experiment.step / quotient if 1 < quotient <= SHORTEST else None
