"""What the SSP archive of the recommended axis records: reference, position, tracking error and drive force."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from friction_fmus.axis.assembly import block
from friction_fmus.axis.loop import RECORDED
from harness import FmuPart, System, Wire

REFERENCE: Final = "reference.r"
ERROR: Final = "tracking_error"
"""Part with the reference minus the position."""


def with_tracking_error(system: System) -> System:
    """Return the system of an axis with a part that computes the tracking error, and with more recorded variables."""
    assert system.experiment is not None
    # at the samples only, because the reference has its new value only then
    part = FmuPart(ERROR, block("Sum"), every=system.experiment.decimate)
    parts = [*system.parts.values(), part]
    wires: list[str | Wire] = [*system.wires, f"{REFERENCE} -> {ERROR}.u1", f"axis.x -> {ERROR}.u2"]
    start = {**system.start, f"{ERROR}.gain[2]": -1.0}
    experiment = replace(system.experiment, record=(REFERENCE, RECORDED[0], f"{ERROR}.y", *RECORDED[1:]))
    return System(parts, wires, start, experiment, system.name)
