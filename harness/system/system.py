"""Systems: parts, the connections between them, and their start values."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self

from harness.errors import ExperimentError, HarnessError, StartValueError, UnconnectedError, UnknownNameError, WireError
from harness.notebook import system_html, system_text
from harness.parts.flat_description import element_names
from harness.parts.fmu import FmuPart
from harness.parts.guard import Guard
from harness.parts.part import Part, Port, StartValue
from harness.system.assembly import resize_parts
from harness.system.experiment import LISTS, Experiment, as_experiment
from harness.system.system_file import SystemDescription, read_system, write_system
from harness.system.wire import Manipulator, Wire, check_wires, find_part, parse_wire, split_name, stated_starts
from harness.units import in_unit
from harness.values import is_count, is_line, plain, shown

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from harness.batch import Batch
    from harness.engine.algorithm import Progress, Tap
    from harness.result import Result
    from harness.ssp import Parameter, ParameterSet


_LOG = logging.getLogger("harness")


class System:
    """A system of connected parts; all names, types, units and values are checked on construction.

    Parameters
    ----------
    parts : iterable of Part, or mapping of str to str or path-like
        The parts; their names must differ. A mapping such as ``{"friction": "LuGre"}`` has FMUs, see `FmuPart`.
    wires : iterable of str, (str, str) or Wire
        The connections, such as ``"a.y -> b.u"``.
    start : mapping of str to value
        Start values of parameters, and constants for unconnected inputs, such as ``{"mass.m": 2.0}``.
    experiment : Experiment, mapping or None
        Default settings of a run, also as a mapping such as ``{"stop": 25.0, "step": 1e-3}``.
    name : str
        Name of the system.
    strict : bool
        Whether every input needs a connection or a value. Otherwise, inputs of third-party FMUs that have neither
        keep the start values of their FMUs, and a warning lists them.

    Attributes
    ----------
    parts : dict of str to Part
        The parts by name.
    wires : tuple of Wire
        The connections.
    start : dict of str to value
        The start values, including those kept from FMUs.

    Raises
    ------
    HarnessError
        The first error found: `UnknownNameError`, `WireError`, `UnitError`, `UnconnectedError` or `StartValueError`.
    """

    def __init__(
        self,
        parts: Iterable[Part] | Mapping[str, str | Path],
        wires: Iterable[str | tuple[str, str] | Wire] = (),
        start: Mapping[str, StartValue] | None = None,
        experiment: Experiment | Mapping[str, Any] | None = None,
        name: str = "system",
        strict: bool = False,
    ) -> None:
        self.name = name
        self.strict = strict
        self.parts: dict[str, Part] = {}
        given = [FmuPart(*one) for one in parts.items()] if isinstance(parts, Mapping) else parts
        for part in given:
            if not part.name or "." in part.name or part.name != part.name.strip() or not is_line(part.name):
                raise HarnessError(
                    f"{shown(part.name)} cannot be the name of a part: use letters, digits and _, no dot"
                )
            if part.name in self.parts:
                raise HarnessError(f"two parts are called '{part.name}': rename one")
            if not is_count(part.every):
                raise ExperimentError(
                    f"'{part.name}' has every = {shown(part.every)}: give an integer number of communication steps, 1 "
                    "or more"
                )
            part.every = int(part.every)
            self.parts[part.name] = part
        self.wires = tuple(parse_wire(wire) for wire in wires)
        self.start = {name: plain(value) for name, value in (start or {}).items()}
        self.experiment = as_experiment(experiment)
        resize_parts(self)
        check_wires(self.parts, self.wires)
        self._check_start()
        if not strict:
            self._keep_stated()
        self._check_connected()

    @classmethod
    def from_toml(
        cls, path: str | Path, resolve: Callable[[str], Path] | None = None, *, open_inputs: bool = False
    ) -> Self:
        """Read a system file.

        Parameters
        ----------
        path : path-like
            The TOML file; paths in it are relative to its folder.
        resolve : callable or None
            ``resolve("LuGre") -> Path`` finds the FMU of a part with ``model = "LuGre"``; None takes the function of an
            imported package with models.
        open_inputs : bool
            Whether unconnected inputs keep the start values of their FMUs, as inputs for `to_fmu`; otherwise
            each needs a start value.

        Returns
        -------
        System
            The system.

        Raises
        ------
        SystemFileError
            If the file cannot be read or has unknown keys.
        HarnessError
            If the described system is invalid.
        """
        found = read_system(Path(path), resolve)
        if open_inputs:
            driven = {wire.target for wire in found.wires} | set(found.start)
            found = replace(found, start=found.start | stated_starts(found.parts, driven))
        return cls._made(found)

    def to_toml(self, path: str | Path) -> None:
        """Write a system file for `from_toml`.

        Parameters
        ----------
        path : path-like
            The TOML file.

        Raises
        ------
        SystemFileError
            If a part has no file (a Python function, or a series made from arrays).
        OutputError
            If the file cannot be written.
        """
        write_system(self, Path(path))

    @classmethod
    def from_ssp(cls, path: str | Path, folder: str | Path | None = None) -> Self:
        """Read an archive of System Structure and Parameterization 1.0 or 2.0.

        The FMU ``c`` in a nested system ``s`` becomes the part ``s_c``. Unconnected inputs keep the start values of
        their FMUs. The experiment is None without a stop time or a communication step (or base step of OSP).

        Parameters
        ----------
        path : path-like
            The .ssp file.
        folder : path-like or None
            Folder for the unpacked FMUs; None uses a temporary folder that is removed with the parts.

        Returns
        -------
        System
            The system.

        Raises
        ------
        SystemFileError
            If the file cannot be read or is invalid, or if it contains signal dictionaries, components that are not
            FMUs, tables that map values, calculated parameters, clocks, or connections of strings or binary values.
        HarnessError
            If the described system is invalid.
        """
        from harness.ssp import read_ssp

        return cls._made(read_ssp(Path(path), None if folder is None else Path(folder)))

    def to_ssp(self, path: str | Path) -> None:
        """Write an SSP archive for `from_ssp`, including the FMUs.

        Its version is 1.0, or 2.0 if it contains arrays or types that only FMI 3.0 has.

        Parameters
        ----------
        path : path-like
            The .ssp file.

        Raises
        ------
        SystemFileError
            If a part is not an FMU, or a start value is not finite or has the wrong type.
        OutputError
            If the file cannot be written.
        """
        from harness.ssp import write_ssp

        write_ssp(self, Path(path))

    def to_fmu(
        self,
        path: str | Path,
        *,
        name: str | None = None,
        step: float | None = None,
        master: str | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        platforms: Sequence[str] = ("native",),
        fmi: Literal[2, 3] = 2,
        target: str | None = None,
        **options: Any,
    ) -> None:
        """Write the system as one FMU, which solves the loops between its parts.

        Parameters
        ----------
        path : path-like
            The .fmu file.
        name : str or None
            Model identifier; None takes the name of the file.
        step : float or None
            Communication step inside the FMU [s]; None takes the step of the experiment.
        master : {"newton", "adaptive"} or None
            Master algorithm inside the FMU; None takes adaptive if the experiment does, and newton otherwise, also in
            place of an explicit master. Without a loop, newton steps each part once, with inputs that vary linearly.
        inputs : sequence of str or None
            Inputs of the FMU, as "part.port"; None takes all unconnected inputs. The others are parameters. An
            output of a part without inputs, such as a reference, becomes an input in place of this part.
        outputs : sequence of str or None
            Outputs of the FMU, with ``*`` and ``?``; None takes all outputs. The others are local variables.
        platforms : sequence of str
            ``"native"``, ``"all"`` or names such as ``"win64"``.
        fmi : {2, 3}
            Version of FMI: 2.0 or 3.0.
        target : str or None
            What is written, in place of an FMU of version ``fmi``; see `friction_fmus.build`.
        **options
            Options of the target.

        Raises
        ------
        BuildError, ExperimentError, UnknownNameError
            If a part has no sources or is written in Python, or an argument is invalid; nothing is written.
        """
        from friction_fmus.export.composite.composite_archive import compose

        settings: dict[str, Any] = {"step": step, "master": master, "inputs": inputs, "outputs": outputs}
        compose(self, Path(path), name, platforms, target or f"fmi{fmi}", options, **settings)

    @classmethod
    def _made(cls, description: SystemDescription) -> Self:
        try:
            return cls(**vars(description))
        except HarnessError:
            for part in description.parts:
                part.close()
            raise

    __repr__ = system_text
    _repr_html_ = system_html

    def with_parameters(
        self, parameters: str | Path | ParameterSet | Mapping[str, Parameter | StartValue], prefix: str = ""
    ) -> System:
        """Return a copy of the system with changed start values, converted to the units of the variables.

        Parameters
        ----------
        parameters : path-like, ParameterSet or mapping of str to Parameter or value
            An SSV file, a parameter set, or parameters by name; a plain value is in the unit of its variable.
        prefix : str
            Prefix of all names, such as ``"friction."`` for a parameter set of one part.

        Returns
        -------
        System
            The new system. It shares the parts, so run only one of the systems at a time.

        Raises
        ------
        SystemFileError
            If the file cannot be read.
        UnknownNameError, UnitError, StartValueError
            If a parameter does not fit its variable, or its unit is unknown.
        """
        from harness.ssp import ParameterSet, read_ssv

        if isinstance(parameters, (str, Path)):
            parameters = read_ssv(parameters)
        if isinstance(parameters, ParameterSet):
            parameters = parameters.parameters
        values, unknown = self._landed({prefix + bare: given for bare, given in parameters.items()})
        if unknown:  # elements of an array whose size these parameters change
            more, unknown = self.with_start(values)._landed(unknown)
            values |= more
        # the new system rejects a name that does not exist or cannot be set
        changed = self.with_start(values | {name: given.value for name, given in unknown.items()})
        changed._check_arrays({prefix + bare: given for bare, given in parameters.items()})
        return changed

    def _check_arrays(self, parameters: Mapping[str, Parameter | StartValue]) -> None:
        """Raise an error if an array of the parameters has other elements than the variable."""
        from harness.ssp import Parameter
        from harness.ssp.structure import shown as array_text

        shapes = {
            dotted.rpartition("[")[0]: given.shape
            for dotted, given in parameters.items()
            if isinstance(given, Parameter) and given.shape
        }
        for dotted, shape in shapes.items():
            owner, name = split_name(dotted)
            part = self.parts[owner]
            elements = {port.name for port in (*part.inputs, *part.parameters) if port.name.startswith(f"{name}[")}
            if elements != set(element_names(name, shape)):
                raise StartValueError(
                    f"{dotted} has {len(elements)} elements, but is given {array_text(shape)}: give a value for each"
                )

    def _landed(
        self, parameters: Mapping[str, Parameter | StartValue]
    ) -> tuple[dict[str, StartValue], dict[str, Parameter]]:
        """Return the values in the units of their variables, and the parameters without a variable."""
        from harness.ssp import Parameter

        values: dict[str, StartValue] = {}
        unknown: dict[str, Parameter] = {}
        for dotted, given in parameters.items():
            owner, name = split_name(dotted)
            part = find_part(self.parts, owner, f"parameter {dotted}")
            port = next((port for port in (*part.inputs, *part.parameters) if port.name == name), None)
            if not isinstance(given, Parameter):
                values[dotted] = given
            elif port is None:
                unknown[dotted] = given
            else:
                values[dotted] = given.start_value(port, dotted)
        return values, unknown

    def with_start(self, values: Mapping[str, StartValue]) -> System:
        """Return a copy of the system with changed start values.

        Parameters
        ----------
        values : mapping of str to value
            Start values by ``part.variable``; a text such as ``"0.002 kN"`` is converted to the unit of the variable.

        Returns
        -------
        System
            The new system. It shares the parts, so run only one of the systems at a time.
        """
        start = {**self.start, **values}
        return System(self.parts.values(), self.wires, start, self.experiment, self.name, self.strict)

    def run(
        self,
        stop: float | None = None,
        *,
        start: float | None = None,
        step: float | None = None,
        master: str | None = None,
        record: Sequence[str] | None = None,
        decimate: int | None = None,
        tolerance: float | None = None,
        order: Sequence[str] | None = None,
        extrapolation: int | None = None,
        loop_tolerance: float | None = None,
        coupling_tolerance: float | None = None,
        step_tolerance: float | None = None,
        manipulators: Sequence[Manipulator] | None = None,
        taps: Sequence[Tap] = (),
        progress: Progress | None = None,
        resume: str | Path | None = None,
        checkpoint: str | Path | None = None,
        pace: float | None = None,
        events: bool = False,
        accuracy: bool | float = False,
        engine: str = "auto",
    ) -> Result:
        """Run the system; arguments that are not given are taken from its experiment.

        Parameters
        ----------
        stop, start, step, master, record, decimate, tolerance, order, extrapolation, loop_tolerance, \
        coupling_tolerance, step_tolerance, manipulators
            See `Experiment`. Without an experiment, the step is the smallest one that an FMU of the system suggests.
        taps : sequence of Tap
            Functions that receive values during the run.
        progress : Progress or None
            Receives reports of progress.
        resume, checkpoint : path-like or None
            Files to read the initial state from and to write the final state to. A continued run needs the same start
            and step and is bit-identical to an uninterrupted run.
        pace : float or None
            Simulated time per wall-clock time, 1 for real time; None runs as fast as possible.
        events : bool
            Whether a row is followed by another one at the same time with the values after the events of FMUs for model
            exchange and of those with clocks, if they change a value. FMI 2.0 FMUs for co-simulation show no events.
        accuracy : bool or float
            Whether the run is repeated with other steps to estimate the error of each variable; a number is the
            required accuracy relative to the range of each variable, instead of 0.01. See `run_with_accuracy` for the
            result.
        engine : {"auto", "general", "compiled"}
            Whether the loop over the communication steps is compiled for this system, which takes 2 to 4 s; the results
            are the same, bit for bit. Possible for blocks and laws of this project as FMI 2.0 FMUs with the master
            gauss-seidel. "auto" compiles from 1e9 steps of parts on, where possible.

        Returns
        -------
        xarray.Dataset
            The recorded variables along ``time`` [s].

        Raises
        ------
        ExperimentError
            If a setting is invalid, or stop is not given.
        HarnessError
            If a part fails; the ``result`` of the error holds the values recorded until then.
        """
        from harness.run import Options, run

        given = locals()  # each field of `Experiment` is an argument
        experiment = self._experiment({key.name: given[key.name] for key in fields(Experiment)})
        options = Options(taps, progress, resume, checkpoint, pace, events, engine)
        if accuracy is False:
            return run(self, experiment, options)
        from harness.accuracy.assess import REQUIRED, run_with_accuracy  # scipy takes long to import

        return run_with_accuracy(self, experiment, options, REQUIRED if accuracy is True else accuracy)

    def batch(
        self,
        n: int,
        *,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = ("*",),
        start: Mapping[str, ArrayLike] | None = None,
        step: float | None = None,
        master: str | None = None,
        threads: int | None = None,
        engine: str = "auto",
    ) -> Batch:
        """Make copies of the system that are stepped together, as learning and Monte Carlo methods need them.

        A copy computes what a run with the same inputs computes, bit for bit, but measures no coupling errors: check
        the step with a run first.

        Parameters
        ----------
        n : int
            Number of copies.
        inputs : sequence of str
            Unconnected inputs, as ``part.port``, that each step sets.
        outputs : sequence of str
            Variables that each step returns, with ``*`` and ``?``.
        start : mapping of str to value or array_like of shape (n,)
            Start values in addition to those of the system; an array has a value for each copy.
        step, master
            See `Experiment`; None takes those of the experiment of the system.
        threads : int or None
            Number of threads; None takes as many as there are processors, and fewer for few copies.
        engine : {"auto", "general", "compiled"}
            See `run`; "auto" compiles once 1e9 steps of parts have been taken, where possible.

        Returns
        -------
        Batch
            The copies, at their start.

        Raises
        ------
        HarnessError
            If a name or a value is not accepted, or a part is not a block or a law of this project.
        """
        from harness.batch import Batch

        if self.experiment is None and step is None:
            step = min(self._suggested_steps(), default=None)
        begin = self.experiment.start if self.experiment else 0.0
        stop = begin + 1000.0 * step if isinstance(step, int | float) else None  # it ends nothing
        experiment = self._experiment({"step": step, "master": master, "stop": stop})
        if experiment.manipulators:
            raise ExperimentError(f"a batch has no manipulators, but the experiment of '{self.name}' has: remove them")
        return Batch(self, n, inputs, outputs, start or {}, threads, experiment, engine)

    def _experiment(self, given: Mapping[str, Any]) -> Experiment:
        """Return the experiment of the system with the changes that are given."""
        changes = {key: value for key, value in given.items() if value is not None}
        changes |= {key: tuple(changes[key]) for key in LISTS if key in changes}
        if self.experiment is not None:
            return replace(self.experiment, **changes)
        if "stop" not in changes or ("step" not in changes and not (steps := self._suggested_steps())):
            raise ExperimentError(f"the system '{self.name}' has no experiment: give stop and step")
        return Experiment(**({} if "step" in changes else {"step": min(steps)}) | changes)

    def _suggested_steps(self) -> list[float]:
        """Return the step sizes of the default experiments of the FMUs."""
        archives = [part.archive for part in self.parts.values() if isinstance(part, FmuPart)]
        defaults = [archive.description.defaultExperiment for archive in archives]
        steps = [float(default.stepSize) for default in defaults if default is not None and default.stepSize]
        return [step for step in steps if 0.0 < step < math.inf]

    def close(self) -> None:
        """Unload all parts and remove their temporary files."""
        guard = Guard([part for part in self.parts.values() if isinstance(part, FmuPart) and part.folder])
        with guard.running():
            for part in self.parts.values():
                with guard.watching(part.name):
                    part.close()

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the description: a copy has its own parts, so that it can run in another thread or process."""
        return System, (tuple(self.parts.values()), self.wires, self.start, self.experiment, self.name, self.strict)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

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
            settable = {port.name: port for port in (*part.inputs, *part.parameters)}
            if port := settable.get(name):
                if isinstance(value, str) and port.type == "Real":
                    self.start[dotted] = plain(in_unit(value, port.unit, port.base, dotted))
                continue
            if name in {port.name for port in (*part.outputs, *part.observables)}:
                raise StartValueError(f"{dotted} is computed by its part: set a parameter or an input instead")
            raise UnknownNameError(f"'{owner}' has no input or parameter '{name}': {part.hint(name, settable)}")

    def _keep_stated(self) -> None:
        """Give unconnected inputs of third-party FMUs the start values that the FMUs state."""
        kept = {
            name: port.start
            for name, port in self._undriven().items()
            if port.start is not None and not self.parts[split_name(name)[0]].strict
        }
        if kept:
            values = ", ".join(f"{name} = {value}" for name, value in kept.items())
            _LOG.warning("not connected: %s; these inputs keep the start values of their FMUs", values)
            self.start |= kept

    def _check_connected(self) -> None:
        missing = list(self._undriven())
        if missing:
            are = "is not connected and has" if len(missing) == 1 else "are not connected and have"
            raise UnconnectedError(
                f"{', '.join(missing)} {are} no start value: connect each input to an output, or give it a constant "
                "start value"
            )

    def _undriven(self) -> dict[str, Port]:
        """Return the inputs that need a connection or a start value and have neither."""
        driven = {wire.target for wire in self.wires} | set(self.start)
        inputs = {f"{name}.{port.name}": port for name, part in self.parts.items() for port in part.inputs}
        return {name: port for name, port in inputs.items() if name not in driven and not port.optional}
