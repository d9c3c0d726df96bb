"""FMUs for model exchange, integrated by CVODE over each communication step; the loop is in integrator.h.

CVODE has a variable step, is stiff (BDF) and locates events. It comes with fmpy, which the harness needs anyway, as
SUNDIALS 7 for Linux, Windows and macOS. The compiled engine calls it and the FMU without Python in between: a step of
1 ms of an oscillator takes 4 us. With scikit-sundae, whose callbacks are Python functions, it takes 54 us. Each
communication step and each event starts CVODE anew, with a first step of order 1: then the solver has no state of its
own, and a master can repeat a step after the FMU alone has been rolled back.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from harness.compiling.engine_library import library, mirror
from harness.errors import ENDED, HarnessError

_POINTER, _INT, _REAL, _FLAG = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double, ctypes.c_int

TOLERANCE: Final = 1e-8  # relative tolerance of a run that states none

_SHARE: Final = 0.01
"""Tolerance of the solver relative to that of the run: an undamped oscillator gains the errors of all its starts, 3.5
times this tolerance in each communication step."""

_FINEST: Final = 1e-13  # finest tolerance of the solver: a finer one is rounding

_SUNDIALS: Final = 7
_BDF: Final = 2
_ADVICE: Final = "export the FMU for co-simulation"

_FIELDS: Final = {
    "EnterEventMode": "enter_event_mode",
    "NewDiscreteStates": "new_discrete_states",
    "EnterContinuousTimeMode": "enter_continuous_time_mode",
    "CompletedIntegratorStep": "completed_step",
    "SetTime": "set_time",
    "SetContinuousStates": "set_states",
    "GetContinuousStates": "get_states",
    "GetDerivatives": "get_derivatives",
    "GetEventIndicators": "get_indicators",
    "GetNominalsOfContinuousStates": "get_nominals",
}  # fields in Integrator
FUNCTIONS: Final = tuple(_FIELDS)
"""Functions for model exchange, in the order of ``failure`` in integrator.h, which begins at 1."""

_SET_INPUTS, _GET_INPUTS = 11, 12
_OTHERS: Final = MappingProxyType(
    {
        16: ENDED,
        17: "its event iteration does not end: after 100 calls it still asks for another",
        18: "it has more than 10000 events in one communication step: it chatters, or the step is too long",
        19: "the solver needs more than a million steps for one communication step: use a shorter step",
    }
)
_NOT_FINITE: Final = MappingProxyType({13: "the derivative of {}", 14: "event indicator {}", 15: "{}"})
_SOLVER_REASONS: Final = MappingProxyType(
    {
        -3: "the error test fails even with the shortest step",
        -4: "its corrector does not converge even with the shortest step",
        -6: "its Jacobian cannot be evaluated",
        -8: "the derivatives cannot be evaluated",
        -9: "the derivatives cannot be evaluated at the start of the step",
        -10: "the derivatives cannot be evaluated however short the step",
        -27: "the step is shorter than the resolution of the time",
    }
)

_TYPES: Final = ("Real", "Integer", "Boolean")
_STATE: Final = ("Get", "Set", "Free")
_EXPORTED: Final = MappingProxyType(
    {
        **{f"{verb}{kind}": f"{verb}_{kind}".lower() for verb in ("Set", "Get") for kind in _TYPES},
        **{"DoStep": "step", "SetRealInputDerivatives": "set_slopes"},
        **{f"{verb}FMUstate": f"{verb}_state".lower() for verb in _STATE},
    }
)

mirror("EventInfo")  # is in Integrator
IntegratorData = mirror("Integrator")


class Failure(NamedTuple):
    """Why a step of an `Integrator` failed."""

    function: str  # function of the FMU that failed, or ``"its integration"``
    reason: str  # what went wrong; empty if the function returned a status
    status: int  # this status
    time: float  # time of the failure [s]


class Integrator:
    """An FMU for model exchange together with its solver; the engine calls it like an FMU for co-simulation."""

    def __init__(
        self, component: int, addresses: Mapping[str, int], states: tuple[str, ...], indicators: int, inputs: int
    ) -> None:
        engine = library()
        self.functions = {name: address_of(engine, f"integrator_{export}") for name, export in _EXPORTED.items()}
        self.states = states
        data = self.data = IntegratorData()
        data.component = component
        data.set, data.get = ((_POINTER * 3)(*(addresses[verb + kind] for kind in _TYPES)) for verb in ("Set", "Get"))
        data.get_state, data.set_state, data.free_state = (addresses[f"{verb}FMUstate"] for verb in _STATE)
        for function, field in _FIELDS.items():
            setattr(data, field, addresses[function])
        data.states, data.indicators, data.most_moving = len(states), indicators, inputs
        size = max(1, len(states), indicators, inputs)
        self._kept = {name: np.zeros(size) for name in ("nominals", "z", "begin", "slopes", "u")}
        self._kept |= {"above": np.zeros(size, dtype=np.uint8), "references": np.zeros(size, dtype=np.uint32)}
        for name, array in self._kept.items():
            setattr(data, name, array.ctypes.data)
        self.close: Callable[[], object] = _make_solver(self) if states or indicators else lambda: None

    def begin(self, time: float, tolerance: float | None) -> int:
        """Begin a run after initialisation mode and return a status of FMI."""
        self.data.tolerance = max(_SHARE * (tolerance or TOLERANCE), _FINEST)
        if self.data.solver:  # invalidates the tolerances of the last run
            ctypes.memset(self.data.absolute, 0, 8 * max(1, len(self.states)))
        return int(library().integrator_begin(ctypes.byref(self.data), _REAL(time)))

    def event(self, time: float) -> int:
        """Take the event at this time, as the next step does, and return a status of FMI."""
        status = self.enter_events()
        return status if status > 1 else int(library().integrator_begin(ctypes.byref(self.data), _REAL(time)))

    def enter_events(self) -> int:
        """Go to event mode, in which states are saved and restored, and return a status of FMI."""
        return int(library().integrator_enter_events(ctypes.byref(self.data)))

    def failure(self) -> Failure:
        """Return why the last step failed."""
        data = self.data
        code, index, time = int(data.failure), int(data.index), float(data.failed_at)
        if code in _NOT_FINITE:
            what = str(index + 1) if code == 14 else self.states[index]
            return Failure("its integration", f"{_NOT_FINITE[code].format(what)} is not finite", 3, time)
        if code in _OTHERS:
            return Failure("its integration", _OTHERS[code], 3, time)
        if code > max(_OTHERS):
            reason = _SOLVER_REASONS.get(index, f"it returned the flag {index}")
            return Failure("its integration", f"the solver CVODE stopped, as {reason}", 3, time)
        name = {_SET_INPUTS: "SetReal", _GET_INPUTS: "GetReal"}.get(code) or FUNCTIONS[code - 1]
        return Failure(f"fmi2{name}", "", int(data.status), time)


class _Sundials(NamedTuple):
    """The libraries of SUNDIALS that make a solver."""

    core: Any
    vectors: Any
    matrices: Any
    linear: Any
    cvode: Any


@cache
def _sundials() -> _Sundials:
    """Load SUNDIALS from fmpy."""
    try:
        found = import_module("fmpy.sundials.libraries")
        names = ("core", "nvecserial", "sunmatrixdense", "sunlinsoldense", "cvode")
        # loaded once more, as fmpy has declared Python types for the arguments
        libraries = _Sundials(*(ctypes.CDLL(getattr(found, f"sundials_{name}")._name) for name in names))
        major, minor, patch = _FLAG(), _FLAG(), _FLAG()
        libraries.core.SUNDIALSGetVersionNumber(
            *map(ctypes.byref, (major, minor, patch)), ctypes.create_string_buffer(16), 16
        )
    except (OSError, ImportError, AttributeError) as error:
        raise HarnessError(f"fmpy has no CVODE that runs here ({error}): {_ADVICE}") from error
    if major.value != _SUNDIALS:
        raise HarnessError(f"fmpy has SUNDIALS {major.value} instead of {_SUNDIALS}: install fmpy 0.3.28 or later")
    libraries.core.N_VGetArrayPointer.restype = libraries.vectors.N_VNew_Serial.restype = _POINTER
    libraries.matrices.SUNDenseMatrix.restype = libraries.linear.SUNLinSol_Dense.restype = _POINTER
    libraries.cvode.CVodeCreate.restype = _POINTER
    return libraries


def _make_solver(integrator: Integrator) -> weakref.finalize[Any, Any]:
    """Make a solver for an FMU and return what frees it."""
    sun, engine, data = _sundials(), library(), integrator.data
    n = _INT(max(1, len(integrator.states)))
    context = _POINTER()
    sun.core.SUNContext_Create(0, ctypes.byref(context))
    sun.core.SUNContext_ClearErrHandlers(context)  # they would print; errors are reported by their code
    vectors = [_POINTER(sun.vectors.N_VNew_Serial(n, context)) for _ in range(2)]
    values = [sun.core.N_VGetArrayPointer(vector) for vector in vectors]
    matrix = _POINTER(sun.matrices.SUNDenseMatrix(n, n, context))
    linear = _POINTER(sun.linear.SUNLinSol_Dense(vectors[0], matrix, context))
    solver = _POINTER(sun.cvode.CVodeCreate(_BDF, context))
    for place in values:
        ctypes.memset(place, 0, 8 * n.value)
    itself = ctypes.addressof(data)
    flags = [
        sun.cvode.CVodeInit(solver, ctypes.cast(engine.integrator_derivatives, _POINTER), _REAL(0.0), vectors[0]),
        sun.cvode.CVodeSStolerances(solver, _REAL(TOLERANCE), _REAL(TOLERANCE)),
        sun.cvode.CVodeSetUserData(solver, _POINTER(itself)),
        sun.cvode.CVodeSetLinearSolver(solver, linear, matrix),
        sun.cvode.CVodeRootInit(
            solver, _FLAG(data.indicators), ctypes.cast(engine.integrator_roots, _POINTER) if data.indicators else None
        ),
        sun.cvode.CVodeSetNoInactiveRootWarn(solver),
        sun.cvode.CVodeSetMaxHnilWarns(solver, -1),
    ]
    assert not any(flags), f"CVODE refused a setting: {flags}"
    data.solver = solver
    data.vector, data.absolute_vector = vectors
    data.x, data.absolute = values
    for field, place, function in (
        ("restart", sun.cvode, "CVodeReInit"),
        ("set_stop", sun.cvode, "CVodeSetStopTime"),
        ("set_tolerances", sun.cvode, "CVodeSVtolerances"),
        ("solve", sun.cvode, "CVode"),
        ("values_of", sun.core, "N_VGetArrayPointer"),
    ):
        setattr(data, field, address_of(place, function))
    return weakref.finalize(integrator, _free_solver, sun, solver, linear, matrix, vectors, context)


def _free_solver(sun: _Sundials, solver: Any, linear: Any, matrix: Any, vectors: list[Any], context: Any) -> None:
    sun.cvode.CVodeFree(ctypes.byref(solver))
    sun.core.SUNLinSolFree(linear)
    sun.core.SUNMatDestroy(matrix)
    for vector in vectors:
        sun.core.N_VDestroy(vector)
    sun.core.SUNContext_Free(ctypes.byref(context))


def address_of(library: Any, function: str) -> int:
    """Return the address of a function of a loaded library."""
    return ctypes.cast(getattr(library, function), _POINTER).value or 0
