"""Runs systems in libcosim: reads jobs as JSON from standard input, prints a line of JSON for each.

A process of its own, as libcosim crashes where it should refuse.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

SET = {float: "real_initial_value", int: "integer_initial_value", bool: "boolean_initial_value"}


def run(job: dict[str, Any]) -> dict[str, Any]:
    execution = CosimExecution.from_step_size(round(job["step"] * 1e9))
    slaves = {
        part: execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name=part))
        for part, fmu in job["fmus"].items()
    }
    variables = {part: {v.name.decode(): v for v in execution.slave_variables(i)} for part, i in slaves.items()}

    def place(name: str) -> tuple[int, int]:
        part, _, port = name.partition(".")
        return slaves[part], variables[part][port].reference

    for name, value in job["start"].items():
        slave, reference = place(name)
        assert getattr(execution, SET[type(value)])(slave, reference, value), name
    for source, target in job["wires"]:
        (a, y), (b, u) = place(source), place(target)
        assert execution.connect_real_variables(a, y, b, u) == 0, (source, target)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    rows = []
    for _ in range(job["count"] // job["every"]):
        assert execution.step(job["every"]), execution.status()
        rows.append([])
        for name in job["outputs"]:
            slave, reference = place(name)
            rows[-1] += observer.last_real_values(slave, [reference])
    return {"rows": rows}


log_output_level(CosimLogLevel.FATAL)
for job in json.load(sys.stdin):
    print(json.dumps({"begin": job["name"]}), flush=True)
    try:
        done = run(job)
    except Exception as error:
        done = {"error": repr(error)}
    print(json.dumps({"end": job["name"]} | done), flush=True)
