"""The identity of a sweep: a folder with another sweep is rejected."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from harness.parts.callable_part import CallablePart
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.parts.series import SeriesPart
from harness.sweeps.measures import label
from harness.sweeps.samples import Sample
from harness.sweeps.worker import Job
from harness.system.system import System


def description(system: System, job: Job, samples: Sequence[Sample]) -> dict[str, Any]:
    """Return a description of a sweep as JSON, with hashes of its large elements.

    Parameters
    ----------
    system : System
        The system.
    job : Job
        Settings and measures of the runs. A function that measures is identified by its name only.
    samples : sequence of mapping
        All parameter sets.

    Returns
    -------
    dict
        The description; equal sweeps have equal descriptions, independent of the paths of their files.
    """
    content = {
        "parts": {name: _identity(part) for name, part in system.parts.items()},
        "wires": sorted(repr(wire) for wire in system.wires),
        "start": dict(system.start),
    }
    experiment = {key.name: getattr(job.experiment, key.name) for key in fields(job.experiment)}
    return {
        "system": _hash(json.dumps(content, sort_keys=True).encode()),
        "samples": _hash(json.dumps(samples).encode()),
        "runs": len(samples),
        "experiment": experiment | {"manipulators": [repr(one) for one in job.experiment.manipulators]},
        "measures": [label(measure) for measure in job.measures],
        "keep": job.keep,
    } | ({"accuracy": True} if job.accuracy else {})


def _identity(part: Part) -> list[str]:
    """Return kind, content and sample time of a part."""
    kind = type(part).__qualname__
    if isinstance(part, FmuPart):
        return [kind, _hash(part.path.read_bytes()), str(part.every)]
    if isinstance(part, SeriesPart):
        return [kind, _hash(part.content()), part.interpolation, part.beyond]
    ports = [port.name for port in (*part.inputs, *part.outputs)]
    if isinstance(part, CallablePart):
        ports += [str(part.initial_state.tolist()), label(part.function), label(part.advance)]
    return [kind, *ports, str(part.every)]


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
