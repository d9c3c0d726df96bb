"""Checkpoints: the state of a whole run in a file, from which another process continues it to the last bit."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from harness.assembly import Assembly
from harness.atomic import atomic_path
from harness.errors import ExperimentError
from harness.experiment import Experiment
from harness.fmu import FmuPart
from harness.part import Part
from harness.plan import Plan

_FORMAT = 1


@dataclass(frozen=True)
class Checkpoint:
    """A state read from a file.

    Parameters
    ----------
    path : Path
        The file.
    tick : int
        Number of steps that are done.
    system : mapping
        What it is the state of.
    signals : mapping of str to float
        Values by "part.port".
    states : mapping of str to bytes
        State of each part.
    memory : mapping of str to uint8 array
        What the master remembers.
    """

    path: Path
    tick: int
    system: Mapping[str, Any]
    signals: Mapping[str, float]
    states: Mapping[str, bytes]
    memory: Mapping[str, np.ndarray[Any, Any]]

    def restore(self, plan: Plan, memory: Mapping[str, np.ndarray[Any, Any]]) -> None:
        """Bring started parts, their values and the memory of the master to this state.

        Raises
        ------
        HarnessError
            If a part refuses its state, or the master remembers other things.
        """
        for part in plan.parts:
            part.deserialise(self.states[part.name])
        for call in plan.calls:
            call.get()
        for name, value in self.signals.items():
            if name in plan.columns:
                plan.signals[plan.columns[name]] = value
        for name, array in memory.items():
            saved = self.memory.get(name)
            if saved is None or saved.shape != array.shape:
                raise ExperimentError(
                    f"{self.path} has another {name} than this run: continue with the same manipulators and options"
                )
            array[...] = saved


def write_checkpoint(
    path: Path,
    system: Assembly,
    experiment: Experiment,
    plan: Plan,
    memory: Mapping[str, np.ndarray[Any, Any]],
) -> None:
    """Write the state at the end of a run; the file is replaced only when the new one is complete.

    Raises
    ------
    HarnessError
        If a part cannot put its state into a file.
    OutputError
        If the file cannot be written.
    """
    header = {
        "format": _FORMAT,
        "tick": plan.ticks,
        "system": identity(system, experiment),
        "signals": {name: float(plan.signals[index]).hex() for name, index in plan.columns.items()},
        "memory": list(memory),
    }
    states = [(part.name, part.serialise()) for part in plan.parts]
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("checkpoint.json", json.dumps(header, indent=1))
        for name, state in states:
            archive.writestr(f"parts/{name}", state)
        for name, array in memory.items():
            with archive.open(f"memory/{name}.npy", "w") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)


def read_checkpoint(path: Path, system: Assembly, experiment: Experiment) -> Checkpoint:
    """Read the state of a run.

    Raises
    ------
    ExperimentError
        If the file cannot be read, or is not of this system and these steps, or lies behind the end of the run.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            header = json.loads(archive.read("checkpoint.json"))
            states = {name: archive.read(f"parts/{name}") for name in header["system"]["parts"]}
            memory = {}
            for name in header["memory"]:
                with archive.open(f"memory/{name}.npy") as file:
                    memory[name] = np.lib.format.read_array(file, allow_pickle=False)
            signals = {name: float.fromhex(text) for name, text in header["signals"].items()}
            if header["format"] != _FORMAT:
                raise ValueError(f"it has the format {header['format']}")
    except (OSError, zipfile.BadZipFile, KeyError, ValueError, TypeError) as error:
        raise ExperimentError(
            f"cannot read the checkpoint {path}: {error}; give a file that a run has written"
        ) from error
    wanted = identity(system, experiment)
    for key, value in wanted.items():
        if header["system"].get(key) != value:
            raise ExperimentError(
                f"{path} is the state of a run with other {key}: {header['system'].get(key)} instead of {value}"
            )
    if header["tick"] > experiment.ticks:
        reached = experiment.start + header["tick"] * experiment.step
        raise ExperimentError(f"{path} is the state at {reached:.12g} s: give a later stop than {experiment.stop:.12g}")
    return Checkpoint(path, int(header["tick"]), header["system"], signals, states, memory)


def identity(system: Assembly, experiment: Experiment) -> dict[str, Any]:
    """What must agree for a state to fit."""
    wires = [(str(wire), wire.gain, wire.offset, wire.delay) for wire in system.wires]
    return {
        "parts": {name: _kind(part) for name, part in system.parts.items()},
        "wires": [f"{text} * {gain!r} + {offset!r}, delay {delay}" for text, gain, offset, delay in wires],
        "start": experiment.start,
        "step": experiment.step,
        "master": experiment.master,
        "order": list(experiment.order),
    }


def _kind(part: Part) -> str:
    # an FMU is the same one in a process of its own
    kind = FmuPart if isinstance(part, FmuPart) else type(part)
    return f"{kind.__name__} {part.identity} every {part.every}"
