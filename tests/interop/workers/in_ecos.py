"""Runs systems in ecos: reads jobs as JSON from standard input, prints a line of JSON for each."""

from __future__ import annotations

import json
import sys
from typing import Any

from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure


def run(job: dict[str, Any]) -> dict[str, Any]:
    def ecos(name: str) -> str:
        return name.replace(".", "::", 1)

    with EcosSimulationStructure() as structure:
        for part, fmu in job["fmus"].items():
            structure.add_model(part, fmu)
        for source, target in job["wires"]:
            structure.make_real_connection(ecos(source), ecos(target))
        structure.add_parameter_set("start", {ecos(name): value for name, value in job["start"].items()})
        with EcosSimulation(job["step"], structure=structure) as simulation:
            simulation.init(parameter_set="start")
            rows = []
            for _ in range(job["count"] // job["every"]):
                simulation.step(job["every"])
                rows.append([simulation.get_real(ecos(name)) for name in job["outputs"]])
            simulation.terminate()
    return {"rows": rows}


EcosLib.set_log_level("warn")
for job in json.load(sys.stdin):
    print(json.dumps({"begin": job["name"]}), flush=True)
    try:
        done = run(job)
    except Exception as error:
        done = {"error": repr(error)}
    print(json.dumps({"end": job["name"]} | done), flush=True)
