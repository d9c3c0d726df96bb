"""Repetition of a search in which a force parameter ran away."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.identification.data.record import Record
from friction_fmus.identification.result import Identification

FAR: Final = 10.0
"""Ratio to the largest measured force beyond which a force parameter has run away: the drive overcame all friction."""


def within_reach(
    identify: Callable[..., Identification], model: str | Path, train: Sequence[Record], **options: Any
) -> Identification:
    """Identify a model; if a force parameter ran away, identify it again with a bound for this parameter.

    A record that passes the Stribeck velocity between two samples does not determine Fs: the product of a huge Fs and
    the exponential of a tiny vs fits. Nothing can be computed with such a value, and it hides that Fs is unknown.
    """
    found = identify(model, train, **options)
    forces = [values for record in train for values in (record.force, record.friction) if values is not None]
    if options.get("bounds") or not forces:
        return found
    largest = FAR * max(float(np.max(np.abs(values))) for values in forces)
    unit = train[0].units.force
    far = [name for name, e in found.parameters.items() if e.unit == unit and name != "OF" and abs(e.value) > largest]
    bounds = {name: (0.0, largest) for name in far}
    return identify(model, train, **{**options, "bounds": bounds}) if far else found
