"""Runs of one FMU with sampled inputs in the compiled engine, as a fit repeats them hundreds of times."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from harness.compiling.engine_library import library, mirror
from harness.errors import ExperimentError, HarnessError, UnknownNameError
from harness.parts.fmu import FmuPart
from harness.parts.guard import Guard
from harness.parts.part import Native, StartValue, Values

_FUNCTION = {0: "fmi2SetReal", 1: "fmi2DoStep", 2: "fmi2GetReal", 5: "fmi2SetRealInputDerivatives"}
"""FMI function called in each operation of engine.h."""

_DriveData = mirror("Drive")


class Drive:
    """An FMU that is run repeatedly with sampled inputs and different start values.

    Each step adds about 0.1 us to the computing time of the FMU; each reset between two runs takes about 0.1 ms.

    Parameters
    ----------
    part : FmuPart
        The FMU. Do not use it elsewhere while the drive is open.
    """

    def __init__(self, part: FmuPart) -> None:
        self.part = part
        part.reuse = True
        self._kinds = {port.name: port.type for port in (*part.inputs, *part.outputs, *part.observables)}
        self._inputs = {port.name for port in part.inputs}
        self._guard = Guard([part])

    def run(
        self,
        inputs: Mapping[str, ArrayLike],
        outputs: Sequence[str],
        step: float,
        *,
        between: Literal["held", "linear"] = "held",
        start: Mapping[str, StartValue] | None = None,
        tolerance: float | None = None,
    ) -> Values:
        """Run from the first sample to the last one.

        Parameters
        ----------
        inputs : mapping of str to array_like, shape (n,)
            Samples of Real inputs at t = 0, step, 2 step, ...
        outputs : sequence of str
            Real outputs or other Real variables to read.
        step : float
            Sampling interval and communication step [s].
        between : {"held", "linear"}
            Value of an input between two samples: held at the earlier sample, or interpolated linearly.
        start : mapping of str to value, optional
            Start values that replace the start values of the FMU.
        tolerance : float, optional
            Relative tolerance for the FMU's own solver.

        Returns
        -------
        array, shape (n, len(outputs))
            The outputs. Row 0 holds the initial values for the first inputs, row k the values after the step from
            sample k - 1 to sample k.

        Raises
        ------
        ExperimentError
            If there are no inputs, if they differ in length, have fewer than 2 samples or are not finite, or if the
            step is not positive.
        UnknownNameError
            If the FMU has no Real variable of that name.
        HarnessError
            If linear interpolation is requested and the FMU does not accept input derivatives.
        StartValueError, PartError
            If the FMU rejects a value or fails; the message states the time.
        """
        table = self._table(inputs, step)
        names = list(inputs)
        self._check_names(names, outputs)
        with self._guard.running(look=self.part.folder is None):
            return self._run(table, names, outputs, step, between, tolerance, start or {})

    def _run(
        self,
        table: Values,
        names: Sequence[str],
        outputs: Sequence[str],
        step: float,
        between: str,
        tolerance: float | None,
        start: Mapping[str, StartValue],
    ) -> Values:
        samples = len(table)
        self.part.enter_initialisation(0.0, float("inf"), tolerance, start)
        try:
            native = self.part.native(names, list(outputs))
            assert native is not None  # an FMU in this process has one
            if between == "linear" and not native.interpolates:
                raise HarnessError(f"part '{self.part.name}' accepts no input derivatives: use between='held'")
            rows = np.empty((samples, len(outputs)))
            slopes = np.zeros_like(table)
            slopes[:-1] = np.diff(table, axis=0) / step
            data, kept = _data(native, table, slopes if between == "linear" else None, rows, step)
            self.part.exit_initialisation()
            done = library().engine_drive(ctypes.addressof(data), samples)
            del kept
            if done < samples:
                raise native.failure(_FUNCTION[data.failed_operation], int(data.status), done * step)
        finally:
            self.part.terminate()
        return rows

    def close(self) -> None:
        """Free the FMU instance and unload the FMU."""
        self.part.close()

    def _table(self, inputs: Mapping[str, ArrayLike], step: float) -> Values:
        if not (step > 0.0 and np.isfinite(step)):
            raise ExperimentError(f"the step of the drive of '{self.part.name}' is {step}: give a positive number [s]")
        columns = [np.asarray(values, dtype=np.float64) for values in inputs.values()]
        if not columns or len({column.shape for column in columns}) > 1 or columns[0].ndim != 1 or len(columns[0]) < 2:
            raise ExperimentError(
                f"the drive of '{self.part.name}' needs inputs as vectors of one length, at least 2: "
                f"got {', '.join(str(column.shape) for column in columns) or 'none'}"
            )
        table = np.column_stack(columns)
        if not np.isfinite(table).all():
            raise ExperimentError(f"an input of the drive of '{self.part.name}' is not finite: repair those samples")
        return np.ascontiguousarray(table)

    def _check_names(self, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        for name in (*inputs, *outputs):
            if self._kinds.get(name) != "Real":
                raise UnknownNameError(f"'{self.part.name}' has no Real variable '{name}' to set or read")
        for name in inputs:
            if name not in self._inputs:
                raise UnknownNameError(f"'{name}' of '{self.part.name}' is not an input: give it as a start value")


def _data(
    native: Native, table: Values, slopes: Values | None, rows: Values, step: float
) -> tuple[ctypes.Structure, list[Any]]:
    """Return the struct, and the arrays that must stay alive while it is used."""
    references = [np.array(each, dtype=np.uint32) for each in (native.inputs, native.outputs)]
    orders = np.ones(len(native.inputs), dtype=np.intc)
    at, data = native.functions, _DriveData()
    data.component = native.component
    data.set, data.get, data.do_step = at["SetReal"], at["GetReal"], at["DoStep"]
    data.input_references, data.output_references = (each.ctypes.data for each in references)
    data.input_count, data.output_count = len(native.inputs), len(native.outputs)
    data.inputs, data.outputs, data.orders = table.ctypes.data, rows.ctypes.data, orders.ctypes.data
    if slopes is not None:
        data.set_slopes, data.slopes = at["SetRealInputDerivatives"], slopes.ctypes.data
    data.start, data.step = 0.0, step
    return data, [*references, orders, table, slopes, rows]
