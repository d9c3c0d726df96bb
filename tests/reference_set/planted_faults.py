"""Faults that can be planted in the importer of the tests, and what each of them does wrong."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

FAULTS: Mapping[str, str] = MappingProxyType(
    {
        # inputs, start values and outputs
        "get-before-set": "outputs are read before the inputs of that time are set",
        "inputs-held-one-step-late": "a step uses the inputs of the communication point before",
        "inputs-after-step": "inputs of a time are set after the step that begins at this time",
        "inputs-not-interpolated": "inputs are held between communication points where the FMU takes lines",
        "input-jump-without-event": "a jump of an input in model exchange is no event",
        "start-values-ignored": "start values are not set",
        "start-values-after-initialisation": "start values are set after the initialisation",
        "boolean-as-real": "Booleans are set by the function for floating-point numbers",
        "integer-through-float32": "integers pass through a float of 32 bits",
        "string-dropped": "strings are not set",
        "enumeration-off-by-one": "items of enumerations are counted from 0",
        "nan-passed-through-as-zero": "NaN is set as 0",
        "wrong-value-reference-order": "values of one call are assigned in the order of value references",
        "arrays-transposed": "arrays of two dimensions are set column by column",
        "array-first-element-only": "only the first element of an array is set",
        "structural-parameter-ignored": "structural parameters are not set in configuration mode",
        # events
        "missed-time-event": "time events are ignored",
        "time-event-at-end-of-step": "a time event is handled at the next communication point",
        "missed-state-event": "event indicators are ignored",
        "state-event-at-end-of-step": "a state event is handled at the next communication point",
        "no-event-iteration": "the discrete states are updated once per event",
        "no-new-states-after-event": "states that an event has changed are not read",
        "no-completed-integrator-step": "the end of a step of the integrator is not told",
        # time
        "stop-time-overrun": "the last step is a whole one, beyond the stop time",
        "last-partial-step-skipped": "the last step is left out if it is not a whole one",
        "start-time-zero": "time begins at 0 whatever the start time",
        "time-accumulates-by-addition": "times are sums of steps",
        # what an FMU answers
        "discard-ignored": "a step that was discarded counts as done",
        "early-return-ignored": "a step that returned early counts as done",
        "terminated-ignored": "the run goes on when the FMU asks to end it",
        "warning-as-error": "a warning ends the run",
        "error-ignored": "a refused call counts as done",
        # states
        "state-not-restored": "a saved state is not restored",
        "state-shared": "all saved states are the last one",
        "state-without-time": "a restored state does not bring its time back",
        "serialised-state-truncated": "a serialised state is kept as text, up to its first zero byte",
        "reset-keeps-state": "reset does nothing",
        # derivatives
        "directional-derivative-sign": "directional derivatives have the wrong sign",
        "adjoint-not-transposed": "an adjoint derivative is computed as a directional one",
        # systems
        "wrong-units": "units are not converted",
        "unit-offset-ignored": "offsets of units are ignored",
        "transformation-ignored": "linear transformations of connections are ignored",
        "parameter-set-ignored": "parameter sets are not read",
        "connection-delayed-one-step": "connections are one step late",
        "algebraic-loop-one-pass": "values pass once along the connections of an algebraic loop",
        "second-instance-aliases-first": "two components of one FMU are one instance",
        "parameters-of-first-instance-only": "start values of the second component of an FMU are not set",
    }
)
