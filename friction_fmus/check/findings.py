"""What a check finds, and the rules by which it looks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

Severity = Literal["error", "warning", "note"]
"""The standard is violated; importers will have trouble; advice."""

Kind = Literal["archive", "description", "binary"]
"""What a rule looks at."""

DESCRIPTION: Final = "modelDescription.xml"

LONGEST: Final = 2000
"""Characters of a text in a finding."""


@dataclass(frozen=True)
class Rule:
    """One thing that is looked for.

    Parameters
    ----------
    id : str
        Its name in reports, such as ``start-outside-limits``.
    severity : {"error", "warning", "note"}
        Only notes leave the exit status at 0.
    section : str
        Where FMI 2.0.5 says so.
    summary : str
        One sentence: what is wrong when it is found.
    kind : {"archive", "description", "binary"}
        What it looks at.
    """

    id: str
    severity: Severity
    section: str
    summary: str
    kind: Kind

    def finding(self, message: str, file: str = "", *, line: int | None = None, variable: str | None = None) -> Finding:
        """A finding by this rule, with the middle of long texts left out."""
        short = None if variable is None else _shortened(variable)
        return Finding(self.id, self.severity, _shortened(message), _shortened(file), line, short)


@dataclass(frozen=True)
class Finding:
    """A fault, and where it is.

    Parameters
    ----------
    rule : str
        Name of the rule.
    severity : {"error", "warning", "note"}
        That of the rule.
    message : str
        What is wrong and what to do.
    file : str
        Member of the archive; empty for the archive itself.
    line : int, optional
        Line in that file.
    variable : str, optional
        Name of the variable.
    """

    rule: str
    severity: Severity
    message: str
    file: str = ""
    line: int | None = None
    variable: str | None = None

    @property
    def place(self) -> str:
        """File and line, such as ``modelDescription.xml:12``."""
        return f"{self.file}:{self.line}" if self.line else self.file

    def __str__(self) -> str:
        """One line of text."""
        place = f"{self.place}: " if self.file else ""
        return f"{place}{self.severity} {self.rule}: {self.message}"


@dataclass(frozen=True)
class Fault:
    """What a rule's function yields; the rule makes a `Finding` of it.

    Parameters
    ----------
    message, file, line, variable
        As of `Finding`.
    """

    message: str
    line: int | None = None
    variable: str | None = None
    file: str = DESCRIPTION


def _shortened(text: str) -> str:
    """Names, paths and values may be of any length; the end of a message says what to do."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


Function = Callable[[Any], Iterator[Fault]]

RULES: Final[dict[str, Rule]] = {}
"""All rules by name."""

_functions: Final[list[tuple[Rule, Function]]] = []


def declare(id: str, severity: Severity, section: str, summary: str, kind: Kind) -> Rule:
    """Add a rule that some other part of the check looks for."""
    RULES[id] = Rule(id, severity, section, summary, kind)
    return RULES[id]


def rule(
    id: str, severity: Severity, section: str, summary: str, kind: Kind = "description"
) -> Callable[[Function], Function]:
    """Add a rule with the function that looks for it: from what it looks at to `Fault` objects."""

    def add(function: Function) -> Function:
        _functions.append((declare(id, severity, section, summary, kind), function))
        return function

    return add


def apply(kind: Kind, subject: object) -> Iterator[Finding]:
    """What all rules of a kind find."""
    for known, function in _functions:
        if known.kind == kind:
            for fault in function(subject):
                yield known.finding(fault.message, fault.file, line=fault.line, variable=fault.variable)
