"""Systems in files: TOML, SSP and composite FMUs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, Self

from harness.composite.package import compose
from harness.errors import HarnessError
from harness.parts.part import Part, StartValue
from harness.ssp import read_ssp, write_ssp
from harness.system.experiment import Experiment
from harness.system.system_file import SystemDescription, read_system, write_system
from harness.system.wire import Wire, stated_starts


class StoredSystem:
    """Base class of `System` that reads and writes its files."""

    name: str
    parts: dict[str, Part]
    wires: tuple[Wire, ...]
    start: dict[str, StartValue]
    strict: bool
    experiment: Experiment | None

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
            ``resolve("LuGre") -> Path`` finds the FMU of a part with ``model = "LuGre"``.
        open_inputs : bool
            Whether inputs that nothing drives keep the start values of their FMUs, as inputs for `to_fmu`; otherwise
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
            Inputs of the FMU, as "part.port"; None takes all inputs that nothing drives. The others are parameters. An
            output of a part without inputs, such as a reference, becomes an input in place of this part.
        outputs : sequence of str or None
            Outputs of the FMU, with ``*`` and ``?``; None takes all outputs. The others are local variables.
        platforms : sequence of str
            ``"native"``, ``"all"`` or names such as ``"win64"``.
        fmi : {2, 3}
            Version of FMI: 2.0 or 3.0.

        Raises
        ------
        BuildError, ExperimentError, UnknownNameError
            If a part has no sources or is written in Python, or an argument is invalid; nothing is written.
        """
        compose(
            self,
            Path(path),
            name=name,
            step=step,
            master=master,
            inputs=inputs,
            outputs=outputs,
            platforms=platforms,
            fmi=fmi,
        )

    @classmethod
    def _made(cls, description: SystemDescription) -> Self:
        try:
            return cls(**vars(description))
        except HarnessError:
            for part in description.parts:
                part.close()
            raise
