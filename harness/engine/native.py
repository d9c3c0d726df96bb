"""The native engine: the plan of a run as C structs, and the compiled loop over them."""

import ctypes
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any, Final

import numpy as np

from harness.compiling.engine_library import library, mirror
from harness.errors import HarnessError, PartError, not_whole
from harness.parts.guard import REMEDY, described_floats
from harness.parts.part import TYPE_ORDER, Calls, Native, Values
from harness.system.plan import GET, SET, STEP, Plan
from harness.system.wire import split_name

SAVE: Final = 3
RESTORE: Final = 4
SWAP: Final = 6
NOT_WHOLE: Final = 100
NOT_CONVERGED: Final = 101
FLOATS_CHANGED: Final = 102
_TYPES = TYPE_ORDER[:3]
_CALL = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_double, ctypes.c_double)

_POINTER = ctypes.c_void_p
_FREE = ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, _POINTER)

Ports = mirror("Ports")
EnginePart = mirror("EnginePart")
EngineData = mirror("Engine")


@dataclass(frozen=True)
class _Bound:
    """A part with the addresses that the compiled loop calls."""

    calls: Calls  # operations of the plan for which it was bound; a part with other operations is bound again
    native: Native | None  # the functions of an FMU; None for a part in Python
    kept: list[object]  # objects that the addresses in its struct point to


class Engine:
    """A plan as the data of the compiled loop."""

    def __init__(self, plan: Plan, program: Sequence[tuple[int, int]]) -> None:
        self.plan = plan
        self.error: BaseException | None = None
        self.data = EngineData()  # new for each run
        self.parts = (EnginePart * len(plan.parts))()
        self.program = tuple(program)
        self._program = np.array(program, dtype=np.int64).reshape(-1, 2)
        self._bound: dict[int, _Bound] = {}
        self._kept: list[object] = []
        self._run = library().engine_run

    def begin(self, rows: Values, columns: Sequence[int], decimate: int) -> None:
        """Prepare a run of the plan, whose parts have been started."""
        plan = self.plan
        self.error, self._kept = None, []
        for index, calls in enumerate(plan.calls):
            if index not in self._bound or self._bound[index].calls is not calls:
                self.parts[index], self._bound[index] = self._part(index)
        data = self.data = EngineData()
        data.parts = ctypes.addressof(self.parts)
        data.part_count = len(plan.parts)
        data.signals, data.sources = self.keep(plan.signals), self.keep(plan.sources)
        if not plan.plain:
            data.gains, data.offsets = self.keep(plan.gains), self.keep(plan.offsets)
        data.program, data.program_length = self.keep(self._program), len(self._program)
        data.start, data.step, data.stop = plan.start, plan.step, plan.start + plan.ticks * plan.step
        data.rows, data.columns = self.keep(rows), self.keep(np.array(columns, dtype=np.int64))
        data.width, data.decimate = len(columns), decimate

    def run(self, first: int, last: int) -> int:
        """Run the ticks first, ..., last - 1, without the GIL; return the one that failed, or last."""
        return int(self._run(ctypes.addressof(self.data), first, last))

    def end(self) -> None:
        """Free what `keep` keeps and the states of FMUs that the loop has saved; call it before FMUs are unloaded."""
        # The callback of a part in Python and this engine refer to each other: the cycle must not keep the table alive.
        self._kept = []
        for index, bound in self._bound.items():
            part, native = self.parts[index], bound.native
            if native is not None:
                direct = "fmi3DoStep" in native.functions
                free = _FREE(native.functions["fmi3FreeFMUState" if direct else "FreeFMUstate"])
                owner = native.instance if direct else native.component
            for place in ("state", "other_state"):
                state = _POINTER(getattr(part, place))
                if native is not None and state:
                    free(owner, ctypes.byref(state))
                setattr(part, place, None)

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """End the run if the handler of Ctrl-C raises, at the next part in Python or after the current span of ticks.

        An exception raised in a callback from C would be lost. Only the main thread receives the signal.
        """
        handler = signal.getsignal(signal.SIGINT)
        # without a function in Python, the program has a handler in C, or ignores the signal
        if threading.current_thread() is not threading.main_thread() or not callable(handler):
            yield
            return

        def note(number: int, frame: FrameType | None) -> None:
            try:
                handler(number, frame)
            except BaseException as error:
                self.error = error

        signal.signal(signal.SIGINT, note)
        try:
            yield
        finally:
            if signal.getsignal(signal.SIGINT) is note:  # a part may have set another one
                signal.signal(signal.SIGINT, handler)
        if self.error is not None:
            raise self.error

    def advance_by(self, function: str, data: ctypes.Structure) -> None:
        """Let a master advance the ticks of this run."""
        self.data.advance = ctypes.cast(getattr(library(), function), _POINTER)
        self.data.algorithm = self.keep_struct(data)

    def keep(self, array: np.ndarray[Any, Any]) -> int:
        """Return the address of an array that is kept until the run ends."""
        self._kept.append(array)
        return array.ctypes.data

    def keep_struct(self, struct: ctypes.Array[Any] | ctypes.Structure) -> int:
        """Return the address of a struct or an array of them that is kept until the run ends."""
        self._kept.append(struct)
        return ctypes.addressof(struct)

    def failure(self) -> BaseException:
        """Return the error of the last failed call."""
        if self.error is not None:
            error, self.error = self.error, None
            if isinstance(error, PartError) and error.time is None:
                error.time = float(self.data.failed_time)
            return error
        data = self.data
        if data.status == FLOATS_CHANGED:
            return self._floats_changed()
        name, native = self.plan.parts[data.failed_part].name, self._bound[int(data.failed_part)].native
        if data.status == NOT_WHOLE:
            return not_whole(name, data.failed_time)
        function = {SET: "fmi2SetReal", STEP: "fmi2DoStep", GET: "fmi2GetReal", SAVE: "fmi2GetFMUstate"}
        assert native is not None, "a part in Python reports its own errors"
        label = function.get(data.failed_operation, "fmi2SetFMUstate")
        failure = native.failure(label, int(data.status), float(data.failed_time))
        assert isinstance(failure, PartError)
        if "fmi3DoStep" in native.functions:
            failure.ended = float(self.parts[data.failed_part].ended)
        return failure

    def _floats_changed(self) -> HarnessError:
        """Return the error for a part that changes the results of all other parts."""
        data = self.data
        what = f"it changed {described_floats(data.float_change)} of the whole process, which affects all parts"
        time = float(data.failed_time)
        if data.failed_part >= 0:
            return PartError(self.plan.parts[data.failed_part].name, "fmi2DoStep", f"{what}: {REMEDY}", time)
        names = [
            f"'{part.name}'" for index, part in enumerate(self.plan.parts) if self._bound[index].native is not None
        ]
        return HarnessError(f"one of the parts {', '.join(names)} failed after t = {time:.12g} s: {what}: {REMEDY}")

    def _part(self, index: int) -> tuple[ctypes.Structure, _Bound]:
        plan, names = self.plan, self.plan.names
        ranges = [slice(*plan.inputs[index]), slice(*plan.outputs[index])]
        inputs, outputs = ([split_name(name)[1] for name in names[ports]] for ports in ranges)
        native = plan.parts[index].native(inputs, outputs)
        bound = _Bound(plan.calls[index], native, [])

        def keep(array: np.ndarray[Any, Any]) -> int:
            bound.kept.append(array)
            return array.ctypes.data

        part = EnginePart()
        part.every, part.phase = int(plan.every[index]), int(plan.phase[index])
        part.sampled = plan.parts[index].sampled
        for side, block in zip(("inputs", "outputs"), ranges, strict=True):
            types = [plan.ports[name].type for name in names[block]]
            places = np.cumsum([block.start, *(types.count(kind) for kind in _TYPES)])
            setattr(part, side, (ctypes.c_int64 * 4)(*(int(place) for place in places)))
        if native is None:
            function = self._callback(index)
            bound.kept.append(function)
            part.call = ctypes.cast(function, _POINTER)
            return part, bound
        part.component = native.component
        at = native.functions
        part.set = (_POINTER * 3)(*(at[f"Set{kind}"] for kind in _TYPES))
        part.get = (_POINTER * 3)(*(at[f"Get{kind}"] for kind in _TYPES))
        part.do_step = at["DoStep"]
        direct = "fmi3DoStep" in at
        part.get_state = at["fmi3GetFMUState" if direct else "GetFMUstate"]
        part.set_state = at["fmi3SetFMUState" if direct else "SetFMUstate"]
        if native.interpolates:
            part.set_slopes = at["fmi3SetInputDerivatives" if direct else "SetRealInputDerivatives"]
        part.instance = native.instance
        part.set_scalars, part.get_scalars = at.get("fmi3SetFloat64"), at.get("fmi3GetFloat64")
        part.do_step_3 = at.get("fmi3DoStep")
        part.input_references = keep(np.array(native.inputs, dtype=np.uint32))
        part.output_references = keep(np.array(native.outputs, dtype=np.uint32))
        part.direct, ports = at.get("blockDirect"), part.ports
        ports.input_references, ports.output_references = part.input_references, part.output_references
        ports.sources = plan.sources.ctypes.data + plan.sources.itemsize * int(ranges[0].start)
        ports.inputs, ports.outputs = part.inputs[0], part.outputs[0]
        ports.reals, _, ports.flags = np.diff(part.inputs)
        ports.out_reals, ports.out_counts, ports.out_flags = np.diff(part.outputs)
        size = max(len(inputs), len(outputs), 1)
        part.whole = keep(np.zeros(size, dtype=np.intc))
        part.orders = keep(np.ones(size, dtype=np.intc))
        part.slopes = keep(np.zeros(size))
        return part, bound

    def _callback(self, index: int) -> Any:
        """Return the operations of a Python part as a C function; an exception is raised after the run."""
        calls, part = self.plan.calls[index], self.plan.parts[index]
        state: list[object] = [None, None]

        def save(_t: float, _h: float) -> None:
            state[0] = part.save(state[0])

        operations: dict[int, Callable[[float, float], None]] = {
            SET: lambda t, h: calls.set(),
            STEP: calls.step,
            GET: lambda t, h: calls.get(),
            SAVE: save,
            RESTORE: lambda t, h: part.restore(state[0]),
            SWAP: lambda t, h: state.reverse(),
        }

        def call(operation: int, t: float, h: float) -> int:
            if self.error is not None:
                return 3
            try:
                operations[operation](t, h)
            except BaseException as error:
                self.error = error
                return 3
            return 0

        return _CALL(call)
