"""The pairs in other people's masters, each recording the same variables; their packages are the extra ``bench``."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from fmpy.fmi2 import FMU2Slave

from benchmarks.pairs import STEP, Built, Values


def importable(*names: str) -> bool:
    """Whether these modules can be used: ecospy, say, needs Debian's libtbb12, too."""
    try:
        for name in names:
            import_module(name)
    except (ImportError, OSError):
        return False
    return True


class Watch:
    """Seconds from now on: by the clock or of the processor, what is less; some work with several threads."""

    def __init__(self) -> None:
        """Take the times."""
        self.begin = time.perf_counter(), time.process_time()

    def seconds(self) -> float:
        """Since then."""
        return min(time.perf_counter() - self.begin[0], time.process_time() - self.begin[1])


@dataclass(frozen=True)
class Peer:
    """Another master.

    Attributes
    ----------
    run : callable
        ``run(built, n)`` gives the seconds for n steps, without the start, and the last row.
    installed : bool
        Whether it can be run.
    target : float or None
        What the engine is to take at most of its time; None: what the pair says.
    """

    run: Callable[[Built, int], tuple[float, Values]]
    installed: bool
    target: float | None


def by_fmpy(built: Built, n: int) -> tuple[float, Values]:
    """The loop as it is written with fmpy's FMU2Slave."""
    fmus = []
    for member in built.pair.members:
        description = built.descriptions[member.name]
        names = description.guid, str(built.folders[member.name]), description.coSimulation.modelIdentifier
        fmu = FMU2Slave(guid=names[0], unzipDirectory=names[1], modelIdentifier=names[2], instanceName=member.name)
        fmu.instantiate()
        references = [built.references[f"{member.name}.{name}"] for name in member.start]
        fmu.setReal(references, list(member.start.values()))
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmus.append(fmu)
    (first, second), pair = fmus, built.pair
    u = [[built.references[f"{member.name}.{member.input}"]] for member in pair.members]
    y = [[built.references[f"{member.name}.{name}"] for name in member.outputs] for member in pair.members]
    rows = np.empty((n + 1, len(pair.recorded)))
    width = len(y[0])
    second.setReal(u[1], first.getReal(y[0])[:1])
    force = second.getReal(y[1])
    watch = Watch()
    for i in range(n):
        t = i * STEP
        if pair.closed:
            first.setReal(u[0], force)
        first.doStep(currentCommunicationPoint=t, communicationStepSize=STEP)
        state = first.getReal(y[0])
        second.setReal(u[1], state[:1])
        second.doStep(currentCommunicationPoint=t, communicationStepSize=STEP)
        force = second.getReal(y[1])
        rows[i + 1, :width] = state
        rows[i + 1, width:] = force
    seconds = watch.seconds()
    for fmu in fmus:
        fmu.terminate()
        fmu.freeInstance()
    return seconds, rows[n]


def by_ecos(built: Built, n: int) -> tuple[float, Values]:
    """Ecos with its CSV writer, which is what it records with."""
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure

    EcosLib.set_log_level("off")
    named = {f"{m.name}::{name}": value for m in built.pair.members for name, value in m.start.items()}
    recorded = [name.replace(".", "::") for name in built.pair.recorded]
    with EcosSimulationStructure() as structure:
        for name, path in built.paths.items():
            structure.add_model(name, path)
        for output, input_ in built.pair.wires:
            structure.make_real_connection(output.replace(".", "::"), input_.replace(".", "::"))
        structure.add_parameter_set("start", named)
        with EcosSimulation(STEP, structure=structure) as simulation:
            simulation.add_csv_writer(str(built.folder / "ecos.csv"), identifiers=recorded)
            simulation.init(parameter_set="start")
            watch = Watch()
            simulation.step(n)
            seconds = watch.seconds()
            last = np.array([simulation.get_real(name) for name in recorded])
            simulation.terminate()
    return seconds, last


def by_libcosim(built: Built, n: int) -> tuple[float, Values]:
    """Libcosim with a time series of each variable, on one core: it is ten times slower with two."""
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.FATAL)
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    execution = CosimExecution.from_step_size(step_size=round(STEP * 1e9))
    slaves = {name: CosimLocalSlave(str(path), name) for name, path in built.paths.items()}
    numbers = {name: execution.add_local_slave(slave) for name, slave in slaves.items()}

    def at(name: str) -> tuple[int, int]:
        return numbers[name.partition(".")[0]], built.references[name]

    for member in built.pair.members:
        for name, value in member.start.items():
            execution.real_initial_value(*at(f"{member.name}.{name}"), value)
    for output, input_ in built.pair.wires:
        execution.connect_real_variables(*at(output), *at(input_))
    observer = CosimObserver.create_time_series(buffer_size=n + 1)
    execution.add_observer(observer=observer)
    for name in built.pair.recorded:
        observer.start_time_series(*at(name), CosimVariableType.REAL)
    watch = Watch()
    execution.step(step_count=n)
    seconds = watch.seconds()
    last = np.array([observer.time_series_real_samples(*at(name), n, 1)[2][0] for name in built.pair.recorded])
    os.sched_setaffinity(0, cores)
    return seconds, last


PEERS = {
    "fmpy's FMU2Slave": Peer(by_fmpy, True, None),
    "ecospy": Peer(by_ecos, importable("ecospy"), 1 / 3),
    "libcosimpy": Peer(by_libcosim, importable("libcosimpy.CosimExecution"), 1 / 20),
}
