"""The rules of the binary: name, severity, section of FMI 2.0.5, and a description of the error."""

from __future__ import annotations

from typing import Final

RULES: Final = {
    "binary-not-loadable": ("error", "2.3", "The library for this platform cannot be loaded."),
    "binary-crashes": ("error", "2.1.3", "A legal call ends the process."),
    "binary-hangs": ("error", "2.1.3", "A legal call does not return within the time limit."),
    "free-null": ("warning", "2.1.5", "fmi2FreeInstance does not ignore a null pointer."),
    "misuse-crashes": (
        "warning",
        "4.2.4",
        "A call in a state in which it is not allowed ends the process or hangs.",
    ),
    "function-missing": ("error", "2.3", "The library does not export a function of the standard."),
    "version-answer": ("error", "2.1.4", "fmi2GetVersion or fmi2GetTypesPlatform returns a wrong result."),
    "instantiate-fails": ("error", "2.1.5", "fmi2Instantiate returns no instance for the guid of the XML."),
    "guid-not-checked": ("error", "2.1.5", "fmi2Instantiate accepts a guid that differs from the XML."),
    "second-instance": ("error", "4.3.1", "A second instance is rejected although the XML allows it."),
    "instances-interfere": ("error", "2.1.5", "An instance affects the results of another one."),
    "call-refused": ("error", "4.2.4", "A call is rejected in a state in which the standard allows it."),
    "call-order-accepted": ("warning", "4.2.4", "A call is accepted in a state in which the standard forbids it."),
    "start-differs": ("error", "2.2.7", "A start value in the XML differs from the start value in the binary."),
    "variable-not-readable": ("error", "2.1.7", "A declared variable cannot be read."),
    "variable-not-settable": ("error", "2.1.7", "An input or parameter rejects its own start value."),
    "step-refused": ("error", "4.2.2", "fmi2DoStep rejects a step that the capabilities allow."),
    "step-rounding": ("error", "4.2.2", "fmi2DoStep rejects a step that differs from the last one only by rounding."),
    "time-wrong": ("error", "4.2.2", "The time after a step is not the end of the step."),
    "time-own-grid": (
        "note",
        "4.2.2",
        "The time after a step lags by less than a preferred step, on a grid of the FMU.",
    ),
    "time-rounded": ("note", "4.2.2", "The time after a step differs from the end of the step by rounding."),
    "value-not-finite": ("warning", "2.2.7", "An output is NaN or infinite with all start values unchanged."),
    "event-iteration": ("error", "3.2.2", "fmi2NewDiscreteStates asks for iterations without end."),
    "event-time": ("error", "3.2.2", "The next time event is not after the current time."),
    "counts": ("error", "3.2.2", "A function sets more or fewer results than it must."),
    "nominal-states": ("error", "3.2.2", "A nominal value of a state is not positive."),
    "states": ("error", "3.2.1", "States are not kept, or are other variables than the XML says."),
    "history": ("error", "3.2.1", "Values depend on points that the solver has tried before."),
    "directional": ("error", "2.1.9", "A directional derivative disagrees with differences."),
    "dependency-missing": ("error", "2.2.8", "A value depends on an input that its dependencies omit."),
    "not-reproducible": ("warning", "2.1.5", "Two instances with the same calls give different results."),
    "reset-incomplete": ("error", "2.1.6", "After fmi2Reset, the same calls give different results."),
    "state-not-restored": ("error", "2.1.8", "fmi2SetFMUstate does not restore the complete saved state."),
    "state-pointer": ("error", "2.1.8", "fmi2FreeFMUstate does not clear the pointer to the freed state."),
    "state-not-serialized": ("error", "2.1.8", "A state differs after serialisation."),
    "capability": ("error", "4.3.1", "A function fails although the XML declares the capability."),
    "memory-grows": ("warning", "2.1.5", "Memory grows with every instance or every step."),
    "log-category": ("note", "2.2.4", "A message is logged in a category that the XML does not declare."),
    "prints": ("note", "2.1.5", "The library prints to stdout or stderr instead of the logger."),
    "process-changed": (
        "warning",
        "2.1.5",
        "The library changes the working directory, the locale or the rounding mode.",
    ),
}

RULES_3: Final = {
    "fmi3-configuration": (
        "error",
        "2.2.1",
        "A structural parameter cannot be set in its mode, or elsewhere too.",
    ),
    "fmi3-adjoint": ("error", "2.2.11", "An adjoint derivative disagrees with a directional derivative."),
    "fmi3-event-mode": ("error", "4.2.2", "A co-simulation with events fails."),
    "fmi3-intermediate-update": ("error", "4.2.2", "Intermediate updates are out of order or end a step."),
}
"""Rules of what FMI 3.0 adds, with sections of FMI 3.0.2."""
