"""One FMI 2.0 instance for model exchange, which the harness integrates."""

from __future__ import annotations

import ctypes
import struct

from harness.engine.integrator import Integrator
from harness.errors import PartError
from harness.parts.archive import Archive
from harness.parts.fmi2 import DO_STEP, Instance, Library, State, exchanges

_TIME = struct.Struct("<d")


class ExchangeInstance(Instance):
    """One instance of an FMU for model exchange, which steps like one for co-simulation."""

    def __init__(self, library: Library, archive: Archive, name: str) -> None:
        """Instantiate the FMU and make its solver."""
        super().__init__(library, archive, name)
        description = archive.description
        needed = {"CompletedIntegratorStep": archive.interface.needsCompletedIntegratorStep}
        try:
            self._integrator = Integrator(
                self.component,
                {name: address * needed.get(name, True) for name, address in library.addresses.items()},
                tuple(_state_name(unknown.variable) for unknown in description.derivatives),
                int(description.numberOfEventIndicators or 0),
                sum(
                    variable.type == "Real" and variable.causality == "input" for variable in archive.variables.values()
                ),
            )
        except BaseException:
            self.release()
            raise
        self.stepped = ctypes.addressof(self._integrator.data)
        self.functions = self._integrator.functions
        self.do_step = DO_STEP(self.functions["DoStep"])
        self.set_, self.get = exchanges(self.functions)
        self.interpolates = True

    def begin(self, time: float, tolerance: float | None) -> None:
        """Leave initialisation mode and let the discrete states settle."""
        super().begin(time, tolerance)
        status = self._integrator.begin(time, tolerance)
        if status > 1:
            raise self.failure("fmi2DoStep", status)

    def reset(self) -> bool:
        """Return the instance to its initial state; it is in no mode of a run then."""
        self._integrator.data.continuous = 0
        return super().reset()

    def save(self, state: State) -> None:
        """Copy the state and the time."""
        state.time = float(self._integrator.data.time)
        self._enter_events()
        super().save(state)

    def restore(self, state: State) -> None:
        """Return to a saved state and its time."""
        self._enter_events()
        super().restore(state)
        self._integrator.data.time = state.time

    def serialised(self, state: State) -> bytes:
        """Return a saved state as bytes, beginning with the time."""
        return _TIME.pack(state.time) + super().serialised(state)

    def deserialise(self, state: State, data: bytes) -> None:
        """Make a saved state of bytes from `serialised`."""
        if len(data) < _TIME.size:
            raise PartError(self.name, "deserialise", f"the state has {len(data)} bytes and belongs to another part")
        (state.time,) = _TIME.unpack(data[: _TIME.size])
        super().deserialise(state, data[_TIME.size :])

    def _enter_events(self) -> None:
        status = self._integrator.enter_events()
        if status > 1:
            raise self.failure("fmi2DoStep", status)

    def failure(self, function: str, status: int, time: float | None = None) -> PartError:
        """Return the error for a failed call; for a step, with the cause and its time."""
        if function != "fmi2DoStep":
            return super().failure(function, status, time)
        cause = self._integrator.failure()
        error = super().failure(cause.function, cause.status, cause.time)
        return PartError(self.name, cause.function, cause.reason, cause.time) if cause.reason else error

    def release(self) -> None:
        """Free the solver and the instance; further calls have no effect."""
        super().release()
        if hasattr(self, "_integrator"):
            self._integrator.close()


def _state_name(derivative: object) -> str:
    """Return the name of the state that has this derivative."""
    state = getattr(derivative, "derivative", None)
    return str(getattr(state, "name", None) or getattr(derivative, "name", derivative))
