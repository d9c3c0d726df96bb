"""Systems: parts, the wires between them, and their start values."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from harness.engine.tap import Progress, Tap
from harness.errors import (
    ExperimentError,
    HarnessError,
    StartValueError,
    UnconnectedError,
    UnknownNameError,
    WireError,
    nearest,
)
from harness.notebook import system_html, system_text
from harness.parts.fmu import FmuPart
from harness.parts.guard import Guard
from harness.parts.part import Part, Port, StartValue
from harness.result import Result
from harness.run import Options, run
from harness.ssp import Parameter, ParameterSet, read_ssp, read_ssv, write_ssp
from harness.system.experiment import Experiment
from harness.system.manipulator import Manipulator
from harness.system.system_file import SystemDescription, read_system, write_system
from harness.system.wire import Wire, check_wires, find_part, parse_wire, split_name
from harness.values import is_count, is_line, shown

_LOG = logging.getLogger("harness")


class System:
    """Parts wired together; everything is checked when the system is made.

    Parameters
    ----------
    parts : iterable of Part
        The parts; their names must differ.
    wires : iterable of str, (str, str) or Wire
        ``"a.y -> b.u"``.
    start : mapping of str to value
        Start values of parameters, and constants for inputs that have no wire: ``{"mass.m": 2.0}``.
    experiment : Experiment or None
        How the system is run when nothing else is said.
    name : str
        Name of the system.
    strict : bool
        Whether every input needs a wire or a value. Otherwise an input of an FMU of another tool that has neither keeps
        the start value that its FMU states, and a warning lists such inputs.

    Attributes
    ----------
    parts : dict of str to Part
        The parts by name.
    wires : tuple of Wire
        The wires.
    start : dict of str to value
        The start values, also those that were not given but kept.

    Raises
    ------
    HarnessError
        `UnknownNameError`, `WireError`, `UnitError`, `UnconnectedError`, `StartValueError`: at the first
        thing that is wrong.
    """

    def __init__(
        self,
        parts: Iterable[Part],
        wires: Iterable[str | tuple[str, str] | Wire] = (),
        start: Mapping[str, StartValue] | None = None,
        experiment: Experiment | None = None,
        name: str = "system",
        strict: bool = False,
    ) -> None:
        """Check everything."""
        self.name = name
        self.strict = strict
        self.parts: dict[str, Part] = {}
        for part in parts:
            if not part.name or "." in part.name or part.name != part.name.strip() or not is_line(part.name):
                raise HarnessError(
                    f"{shown(part.name)} cannot be the name of a part: use letters, digits and _, no dot"
                )
            if part.name in self.parts:
                raise HarnessError(f"two parts are called '{part.name}': rename one")
            if not is_count(part.every):
                raise ExperimentError(
                    f"'{part.name}' is to be stepped every {shown(part.every)} ticks: give a whole number, 1 or more"
                )
            self.parts[part.name] = part
        self.wires = tuple(parse_wire(wire) for wire in wires)
        self.start = dict(start or {})
        self.experiment = experiment
        check_wires(self.parts, self.wires)
        self._check_start()
        if not strict:
            self._keep_stated()
        self._check_connected()

    def __repr__(self) -> str:
        """Return its name, its parts and the number of connections."""
        return system_text(self)

    def _repr_html_(self) -> str:
        """Return parts, connections and start values as tables, for a notebook."""
        return system_html(self)

    @classmethod
    def from_toml(cls, path: str | Path, resolve: Callable[[str], Path] | None = None) -> Self:
        """Read a system file.

        Parameters
        ----------
        path : path-like
            The TOML file; paths in it are relative to its folder.
        resolve : callable or None
            ``resolve("LuGre") -> Path`` finds the FMU of a part that is given as ``model = "LuGre"``.

        Raises
        ------
        SystemFileError
            If the file cannot be read or has keys that are not understood.
        HarnessError
            If what it describes is wrong.
        """
        return cls._made(read_system(Path(path), resolve))

    def to_toml(self, path: str | Path) -> None:
        """Write a system file that `from_toml` reads back.

        Raises
        ------
        SystemFileError
            If a part has no file (a callable, or a series made from arrays).
        OutputError
            If the file cannot be written.
        """
        write_system(self, Path(path))

    @classmethod
    def from_ssp(cls, path: str | Path, folder: str | Path | None = None) -> Self:
        """Read an archive of System Structure and Parameterization 1.0.

        Nested systems are dissolved: the FMU ``c`` in the system ``s`` becomes the part ``s_c``. An input that
        nothing drives keeps the start value that its FMU states. The experiment is None where the file states no
        stop time or no communication step (its own, or the base step of the Open Simulation Platform).

        Parameters
        ----------
        path : path-like
            The .ssp file.
        folder : path-like or None
            Where the FMUs are unpacked to; None: to a temporary folder that vanishes with the parts.

        Raises
        ------
        SystemFileError
            If the file cannot be read, is not valid, or has what the harness has no place for: signal dictionaries,
            components that are not FMUs, values mapped by a table, calculated parameters.
        HarnessError
            If what it describes is wrong.
        """
        return cls._made(read_ssp(Path(path), None if folder is None else Path(folder)))

    def to_ssp(self, path: str | Path) -> None:
        """Write an archive that `from_ssp` reads back, with the FMUs in it.

        Raises
        ------
        SystemFileError
            If a part is not an FMU, or a start value is not finite or not of the type of its variable.
        OutputError
            If the file cannot be written.
        """
        write_ssp(self, Path(path))

    def with_parameters(
        self, parameters: str | Path | ParameterSet | Mapping[str, Parameter | StartValue], prefix: str = ""
    ) -> System:
        """A system with some start values changed, converted to the units of the variables; see `with_start`.

        Parameters
        ----------
        parameters : path-like, ParameterSet or mapping of str to Parameter or value
            An SSV file, or what `read_ssv` returns, or parameters by name; a plain value is in the unit of the
            variable.
        prefix : str
            Stands before all names: ``"friction."`` for a set that was made for one part.

        Raises
        ------
        SystemFileError
            If the file cannot be read.
        UnknownNameError, UnitError, StartValueError
            If a parameter does not fit its variable.
        """
        if isinstance(parameters, (str, Path)):
            parameters = read_ssv(parameters)
        if isinstance(parameters, ParameterSet):
            parameters = parameters.parameters
        values: dict[str, StartValue] = {}
        for bare, given in parameters.items():
            dotted = prefix + bare
            owner, name = split_name(dotted)
            part = find_part(self.parts, owner, f"parameter {dotted}")
            port = next((port for port in (*part.inputs, *part.parameters) if port.name == name), None)
            if not isinstance(given, Parameter):
                values[dotted] = given
            else:  # a name that does not exist, or cannot be set, is refused by the new system
                values[dotted] = given.value if port is None else given.start_value(port, dotted)
        return self.with_start(values)

    def with_start(self, values: Mapping[str, StartValue]) -> System:
        """A system with some start values changed; the parts are shared, so run one of them at a time."""
        start = {**self.start, **values}
        return System(self.parts.values(), self.wires, start, self.experiment, self.name, self.strict)

    def run(
        self,
        *,
        start: float | None = None,
        stop: float | None = None,
        step: float | None = None,
        master: str | None = None,
        record: Sequence[str] | None = None,
        decimate: int | None = None,
        tolerance: float | None = None,
        order: Sequence[str] | None = None,
        extrapolation: int | None = None,
        loop_tolerance: float | None = None,
        manipulators: Sequence[Manipulator] | None = None,
        taps: Sequence[Tap] = (),
        progress: Progress | None = None,
        resume: str | Path | None = None,
        checkpoint: str | Path | None = None,
        pace: float | None = None,
    ) -> Result:
        """Run the system; what is not given is taken from its experiment, see `Experiment`.

        Parameters
        ----------
        start, stop, step, master, record, decimate, tolerance, order, extrapolation, loop_tolerance, manipulators
            See `Experiment`.
        taps : sequence of Tap
            Functions that are shown values during the run.
        progress : Progress or None
            Told how far the run is.
        resume, checkpoint : path-like or None
            File with the state from which the run goes on, and file for the state at its end. A run that goes on
            has the same start and step, and gives the same values as one that was not interrupted, to the last bit.
        pace : float or None
            Simulated seconds for each second of the clock, 1 is real time; None: as fast as it goes.

        Returns
        -------
        xarray.Dataset
            The recorded variables along ``time`` [s].

        Raises
        ------
        ExperimentError
            If the times make no sense, or stop and step are given nowhere.
        HarnessError
            If a part fails; what was recorded until then is in the ``result`` of the error.
        """
        given = {
            "start": start,
            "stop": stop,
            "step": step,
            "master": master,
            "decimate": decimate,
            "tolerance": tolerance,
            "extrapolation": extrapolation,
            "loop_tolerance": loop_tolerance,
        }
        lists = {"record": record, "order": order, "manipulators": manipulators}
        changes: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
        changes |= {key: tuple(value) for key, value in lists.items() if value is not None}
        if self.experiment is not None:
            experiment = replace(self.experiment, **changes)
        elif stop is None or step is None:
            raise ExperimentError(f"the system '{self.name}' has no experiment: give stop and step")
        else:
            experiment = Experiment(**changes)
        return run(self, experiment, Options(taps, progress, resume, checkpoint, pace))

    def close(self) -> None:
        """Unload all parts and remove their temporary files."""
        guard = Guard([part for part in self.parts.values() if isinstance(part, FmuPart) and part.folder])
        with guard.running():
            for part in self.parts.values():
                with guard.watching(part.name):
                    part.close()

    def __reduce__(self) -> tuple[object, ...]:
        """A copy has parts of its own, so that it can run at the same time in another thread or process."""
        return System, (tuple(self.parts.values()), self.wires, self.start, self.experiment, self.name, self.strict)

    def __enter__(self) -> Self:
        """Return the system; leaving the block closes it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the system."""
        self.close()

    @classmethod
    def _made(cls, description: SystemDescription) -> Self:
        try:
            return cls(**vars(description))
        except HarnessError:
            for part in description.parts:
                part.close()
            raise

    def _check_start(self) -> None:
        wired = {wire.target: wire for wire in self.wires}
        for dotted, value in self.start.items():
            owner, name = split_name(dotted)
            part = find_part(self.parts, owner, f"start value {dotted}")
            if dotted in wired:
                raise WireError(
                    f"{dotted} is driven twice, by {wired[dotted].source} and by the start value {value!r}: "
                    "remove one of them"
                )
            settable = {port.name for port in (*part.inputs, *part.parameters)}
            if name in settable:
                continue
            if name in {port.name for port in (*part.outputs, *part.observables)}:
                raise StartValueError(f"{dotted} is computed by the part: set a parameter or an input instead")
            raise UnknownNameError(f"'{owner}' has no input or parameter '{name}': {nearest(name, settable)}")

    def _keep_stated(self) -> None:
        """Give the inputs of foreign FMUs that nothing drives the start values that they state."""
        kept = {
            name: port.start
            for name, port in self._undriven().items()
            if port.start is not None and not self.parts[split_name(name)[0]].strict
        }
        if kept:
            values = ", ".join(f"{name} = {value}" for name, value in kept.items())
            _LOG.warning("nothing drives %s: kept at these start values of their FMUs", values)
            self.start |= kept

    def _check_connected(self) -> None:
        missing = list(self._undriven())
        if missing:
            raise UnconnectedError(
                f"nothing drives {', '.join(missing)}: wire each one to an output or give it a constant as start value"
            )

    def _undriven(self) -> dict[str, Port]:
        """The inputs without a wire and a start value that need one."""
        driven = {wire.target for wire in self.wires} | set(self.start)
        inputs = {f"{name}.{port.name}": port for name, part in self.parts.items() for port in part.inputs}
        return {name: port for name, port in inputs.items() if name not in driven and not port.optional}
