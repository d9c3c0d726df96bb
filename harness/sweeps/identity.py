"""The identity of a sweep: a folder with another sweep is rejected."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from harness.parts.identity import digest, function_identity, part_identity
from harness.sweeps.measures import Builtin, Measure, label
from harness.sweeps.samples import Sample
from harness.sweeps.worker import Job
from harness.system.system import System


def description(system: System, job: Job, samples: Sequence[Sample]) -> dict[str, Any]:
    """Return a description of a sweep as JSON, with hashes of its large elements."""
    content = {
        "parts": {name: part_identity(part) for name, part in system.parts.items()},
        "wires": sorted(repr(wire) for wire in system.wires),
        "start": dict(system.start),
    }
    experiment = {key.name: getattr(job.experiment, key.name) for key in fields(job.experiment)}
    return {
        "system": digest(json.dumps(content, sort_keys=True).encode()),
        "samples": digest(json.dumps(samples).encode()),
        "runs": len(samples),
        "experiment": experiment | {"manipulators": [repr(one) for one in job.experiment.manipulators]},
        "measures": [_measure(measure) for measure in job.measures],
        "keep": job.keep,
    } | ({"accuracy": True} if job.accuracy else {})


def _measure(measure: Measure) -> str:
    return str(measure) if isinstance(measure, Builtin) else f"{label(measure)} {function_identity(measure)}"
