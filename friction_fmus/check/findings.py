"""Findings of a check, and the rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

Severity = Literal["error", "warning", "note"]
"""Severities: a violation of the standard; a likely problem with importers; advice."""

Kind = Literal["archive", "description", "binary", "fmi3", "ssp"]
"""Kinds of rules: the part of the FMU that a rule examines; "fmi3" stands for the XML of FMI 3.0, "ssp" for an SSP."""

DESCRIPTION: Final = "modelDescription.xml"

LONGEST: Final = 2000
"""Largest length of a text in a finding [characters]."""


@dataclass(frozen=True)
class Rule:
    """A rule.

    Parameters
    ----------
    id : str
        Name in reports, such as ``start-outside-limits``.
    severity : {"error", "warning", "note"}
        Severity; only notes leave the exit status at 0.
    section : str
        Section of FMI 2.0.5; of FMI 3.0.2 for the kind "fmi3", of SSP 1.0 for "ssp".
    summary : str
        One sentence that describes the error.
    kind : {"archive", "description", "binary", "fmi3", "ssp"}
        The examined part of the FMU.
    """

    id: str
    severity: Severity
    section: str
    summary: str
    kind: Kind

    @property
    def standard(self) -> str:
        """The version of FMI that the section refers to."""
        return {"fmi3": "FMI 3.0.2", "ssp": "SSP 1.0"}.get(self.kind, "FMI 2.0.5")

    def finding(self, message: str, file: str = "", *, line: int | None = None, variable: str | None = None) -> Finding:
        """Return a finding of this rule, with long texts shortened in the middle."""
        short = None if variable is None else _shortened(variable)
        standard = "SSP 1.0" if self.kind == "ssp" else "FMI 2.0.5"
        return Finding(self.id, self.severity, _shortened(message), _shortened(file), line, short, standard)


@dataclass(frozen=True)
class Finding:
    """An error in an FMU, and its place.

    Parameters
    ----------
    rule : str
        Name of the rule.
    severity : {"error", "warning", "note"}
        Severity of the rule.
    message : str
        Description of the error, and its remedy.
    file : str
        Member of the archive; empty for the archive itself.
    line : int, optional
        Line in the file.
    variable : str, optional
        Name of the variable.
    standard : str
        The version of FMI.
    """

    rule: str
    severity: Severity
    message: str
    file: str = ""
    line: int | None = None
    variable: str | None = None
    standard: str = "FMI 2.0.5"

    @property
    def source(self) -> str:
        """The standard, with its section if the rule is of this version, such as ``FMI 2.0.5, 2.2.7``."""
        known = RULES[self.rule]
        return f"{self.standard}, {known.section}" if known.standard == self.standard else self.standard

    @property
    def place(self) -> str:
        """File and line, such as ``modelDescription.xml:12``."""
        return f"{self.file}:{self.line}" if self.line else self.file

    def __str__(self) -> str:
        """Return one line of text."""
        place = f"{self.place}: " if self.file else ""
        return f"{place}{self.severity} {self.rule}: {self.message}"


@dataclass(frozen=True)
class Fault:
    """An error yielded by a rule's function, from which the rule makes a `Finding`."""

    message: str
    line: int | None = None
    variable: str | None = None
    """See `Finding`."""
    file: str = DESCRIPTION


def _shortened(text: str) -> str:
    """Return a text without its middle if it is long; the end of a message contains the remedy."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


Function = Callable[[Any], Iterator[Fault]]

RULES: Final[dict[str, Rule]] = {}
"""All rules by name."""

_functions: Final[list[tuple[Rule, Function]]] = []


def declare(id: str, severity: Severity, section: str, summary: str, kind: Kind) -> Rule:
    """Add a rule that another part of the check evaluates."""
    RULES[id] = Rule(id, severity, section, summary, kind)
    return RULES[id]


def rule(
    id: str, severity: Severity, section: str, summary: str, kind: Kind = "description"
) -> Callable[[Function], Function]:
    """Add a rule with its function, which maps the examined part of the FMU to `Fault` objects."""

    def add(function: Function) -> Function:
        _functions.append((declare(id, severity, section, summary, kind), function))
        return function

    return add


def apply(kind: Kind, subject: object) -> Iterator[Finding]:
    """Yield the findings of all rules of a kind."""
    for known, function in _functions:
        if known.kind == kind:
            for fault in function(subject):
                yield known.finding(fault.message, fault.file, line=fault.line, variable=fault.variable)
