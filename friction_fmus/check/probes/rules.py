"""The rules of the binary: name -> severity, section of FMI 2.0.5, what is wrong when it is found."""

from __future__ import annotations

from typing import Final

RULES: Final = {
    "binary-not-loadable": ("error", "2.3", "The library of this platform cannot be loaded."),
    "binary-crashes": ("error", "2.1.3", "A legal call brings the process down."),
    "binary-hangs": ("error", "2.1.3", "A legal call does not return within the time limit."),
    "free-null": ("warning", "2.1.5", "fmi2FreeInstance does not ignore a null pointer."),
    "misuse-crashes": (
        "warning",
        "4.2.4",
        "A call in a state where it is not allowed brings the process down or hangs.",
    ),
    "function-missing": ("error", "2.3", "The library does not export a function of the standard."),
    "version-answer": ("error", "2.1.4", "fmi2GetVersion or fmi2GetTypesPlatform gives a wrong answer."),
    "instantiate-fails": ("error", "2.1.5", "fmi2Instantiate with the guid of the XML gives no instance."),
    "guid-not-checked": ("error", "2.1.5", "fmi2Instantiate accepts another guid than that of the XML."),
    "second-instance": ("error", "4.3.1", "A second instance is refused although the XML does not say so."),
    "instances-interfere": ("error", "2.1.5", "What one instance does changes the results of another."),
    "call-refused": ("error", "4.2.4", "A call is refused where the standard allows it."),
    "call-order-accepted": ("warning", "4.2.4", "A call is accepted in a state where the standard forbids it."),
    "start-differs": ("error", "2.2.7", "A start value in the XML is not that of the binary."),
    "variable-not-readable": ("error", "2.1.7", "A declared variable cannot be read."),
    "variable-not-settable": ("error", "2.1.7", "An input or parameter does not take its own start value."),
    "step-refused": ("error", "4.2.2", "fmi2DoStep refuses a step that the capabilities allow."),
    "step-rounding": ("error", "4.2.2", "fmi2DoStep refuses a step that differs from the last by rounding only."),
    "time-wrong": ("error", "4.2.2", "After a step the time is not that of its end."),
    "time-own-grid": (
        "note",
        "4.2.2",
        "After a step the time is less than a preferred step behind, on a grid of its own.",
    ),
    "time-rounded": ("note", "4.2.2", "After a step the time is that of its end but for rounding."),
    "value-not-finite": ("warning", "2.2.7", "An output is NaN or infinite with all start values unchanged."),
    "not-reproducible": ("warning", "2.1.5", "Two instances with the same calls give different results."),
    "reset-incomplete": ("error", "2.1.6", "After fmi2Reset the same calls give other results than at first."),
    "state-not-restored": ("error", "2.1.8", "fmi2SetFMUstate does not bring back all of the saved state."),
    "state-pointer": ("error", "2.1.8", "fmi2FreeFMUstate leaves a pointer to what it has freed."),
    "state-not-serialized": ("error", "2.1.8", "A state is not the same after serialisation."),
    "capability": ("error", "4.3.1", "A function fails although the XML declares the capability."),
    "memory-grows": ("warning", "2.1.5", "Memory grows with every instance or every step."),
    "log-category": ("note", "2.2.4", "A message is logged in a category that the XML does not declare."),
    "prints": ("note", "2.1.5", "The library prints to stdout or stderr, in place of the logger."),
    "process-changed": ("warning", "2.1.5", "The library changes the working folder, the locale or the rounding mode."),
}
