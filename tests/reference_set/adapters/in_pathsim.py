"""PathSim by pathsim-fmi, in its own environment: blocks for co-simulation and model exchange."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from adapter import AdaptedCase, Rows, UnsupportedError, main
from pathsim import Connection, Simulation
from pathsim.blocks import Scope, Source
from pathsim.solvers import RKDP54
from pathsim_fmi import CoSimulationFMU, ModelExchangeFMU

LACKS = ("call", "ssp", "partial-last-step", "event-mode", "enumerations")


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    if case.start:
        raise UnsupportedError("its FMUs start at 0")
    inputs = case.inputs()
    if inputs.held:
        raise UnsupportedError("its signals are real numbers")
    if any(isinstance(value, (str, list)) for value in case.values.values()):
        raise UnsupportedError("its start values are numbers")
    if case.kind == "cs":
        block: Any = CoSimulationFMU(str(case.file), start_values=case.values, dt=case.step)
    else:
        block = ModelExchangeFMU(str(case.file), start_values=case.values)
    scope = Scope(labels=case.outputs)
    variables = block.fmu_wrapper.model_description.modelVariables
    held = {v.name: float(v.start) for v in variables if v.causality == "input" and v.type in ("Real", "Float64")}
    held |= {name: float(value) for name, value in case.values.items() if name in held}
    sources = {name: Source(lambda t, value=value: value) for name, value in held.items()}  # else it sets them to 0
    sources |= {name: Source(lambda t, name=name: inputs.at(t)[name]) for name in inputs.columns}
    wires = [Connection(source, block[name]) for name, source in sources.items()]
    for k, name in enumerate(case.outputs):
        try:
            wires.append(Connection(block[name], scope[k]))
        except Exception as error:
            raise UnsupportedError(f"its block has no port {name}: {error}") from error
    simulation = Simulation(
        [block, scope, *sources.values()],
        wires,
        Solver=RKDP54,
        tolerance_lte_rel=1e-8,
        tolerance_lte_abs=1e-10,
        dt=case.step,
        dt_max=case.step,
        log=False,
    )
    first, *others = case.times()
    simulation._update(first)  # it computes outputs when it runs
    rows = [[first, *block_values(block, case)]]
    for _ in others:
        simulation.run(case.step, reset=False, adaptive=case.kind == "me")
        rows.append([simulation.time, *block_values(block, case)])
    return rows


def block_values(block: Any, case: AdaptedCase) -> list[float]:
    """The outputs of now."""
    return [float(block.outputs[name]) for name in case.outputs]


if __name__ == "__main__":
    main(run, LACKS, lambda: version("pathsim-fmi"))
