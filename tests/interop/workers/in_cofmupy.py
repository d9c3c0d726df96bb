"""Runs systems in CoFMPy: reads jobs as JSON from standard input, prints a line of JSON for each.

In an environment of its own, as CoFMPy needs an old fmpy.
"""

from __future__ import annotations

import contextlib
import json
import sys
from typing import Any

from cofmupy import Coordinator


def run(job: dict[str, Any]) -> dict[str, Any]:
    start: dict[str, dict[str, Any]] = {part: {} for part in job["fmus"]}
    for name, value in job["start"].items():
        part, _, port = name.partition(".")
        start[part][port] = value
    ends = [[dict(zip(("id", "variable"), name.split("."), strict=True)) for name in wire] for wire in job["wires"]]
    coordinator = Coordinator()
    coordinator.start(
        {
            "fmus": [{"id": part, "path": fmu, "initialization": start[part]} for part, fmu in job["fmus"].items()],
            "connections": [{"source": a | {"type": "fmu"}, "target": b | {"type": "fmu"}} for a, b in ends],
            "cosim_method": job["method"],
            "iterative": False,
        }
    )
    rows = []
    for step in range(1, job["count"] + 1):
        coordinator.do_step(job["step"])
        if step % job["every"] == 0:
            rows.append([coordinator.get_variable(tuple(name.split(".", 1)))[0] for name in job["outputs"]])
    order = [part for parts in coordinator.graph_engine.sequence_order for part in parts]
    return {"rows": rows, "order": order}


for job in json.load(sys.stdin):
    print(json.dumps({"begin": job["name"]}), flush=True)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            done = run(job)
    except Exception as error:
        done = {"error": repr(error)}
    print(json.dumps({"end": job["name"]} | done), flush=True)
