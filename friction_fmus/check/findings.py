"""Findings of a check, the rules, and reports."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal
from urllib.parse import quote

from rich.console import Console
from rich.table import Table
from rich.text import Text

from friction_fmus.version import VERSION

Severity = Literal["error", "warning", "note"]
"""Severities: a violation of the standard; a likely problem with importers; advice."""

Kind = Literal["archive", "both", "description", "binary", "fmi3", "ssp"]
"""Kinds of rules: the part of the FMU that a rule examines. "description" is modelDescription.xml of FMI 2.0, "fmi3"
that of FMI 3.0, "both" that of both versions; "ssp" is an SSP."""

DESCRIPTION: Final = "modelDescription.xml"

LONGEST: Final = 2000  # largest length of a text in a finding [characters]


@dataclass(frozen=True)
class Rule:
    """A rule."""

    id: str  # name in reports, such as ``start-outside-limits``
    severity: Severity  # severity; only notes leave the exit status at 0
    section: str  # section of FMI 2.0.5; of FMI 3.0.2 for the kind "fmi3", of SSP 1.0 for "ssp"
    summary: str  # one sentence that describes the error
    kind: Kind  # the examined part of the FMU

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
    """An error in an FMU, and its place."""

    rule: str
    severity: Severity
    message: str
    """Description of the error, and its remedy."""
    file: str = ""  # member of the archive; empty for the archive itself
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
        place = f"{self.place}: " if self.file else ""
        return f"{place}{self.severity} {self.rule}: {self.message}"


@dataclass(frozen=True)
class Fault:
    """An error yielded by a rule's function, from which the rule makes a `Finding`."""

    message: str
    line: int | None = None  # see `Finding`
    variable: str | None = None  # see `Finding`
    file: str = DESCRIPTION


def _shortened(text: str) -> str:
    """Return a text without its middle if it is long; the end of a message contains the remedy."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


def at(v: Any, message: str) -> Fault:
    """Return a fault of a variable of a model description."""
    return Fault(message, v.line, v.name)


Function = Callable[[Any], Iterator[Fault]]
Messages = Callable[[Any, Any], Iterator[str]]

RULES: Final[dict[str, Rule]] = {}  # all rules by name

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


def for_each(
    id: str, severity: Severity, section: str, summary: str, kind: Kind = "description"
) -> Callable[[Messages], Messages]:
    """Add a rule with a function that maps a model description and each of its variables to messages."""

    def add(function: Messages) -> Messages:
        @rule(id, severity, section, summary, kind)
        def faults(model: Any) -> Iterator[Fault]:
            return (at(v, message) for v in model.variables for message in function(model, v))

        return function

    return add


def apply(kind: Kind, subject: object) -> Iterator[Finding]:
    """Yield the findings of all rules of a kind."""
    for known, function in _functions:
        if known.kind == kind:
            for fault in function(subject):
                yield known.finding(fault.message, fault.file, line=fault.line, variable=fault.variable)


Results = Mapping[Path, Sequence[Finding]]  # findings of each FMU

_STYLE = {"error": "bold red", "warning": "yellow", "note": "cyan"}


def failed(results: Results) -> bool:
    """Return whether there are findings other than notes."""
    return any(finding.severity != "note" for findings in results.values() for finding in findings)


def as_text(results: Results, console: Console) -> None:
    """Print one line for each finding, and a summary of each FMU."""
    for path, findings in results.items():
        for finding in findings:
            line = Text(f"{path}: {finding.place}: " if finding.file else f"{path}: ")
            line.append(finding.severity, _STYLE[finding.severity])
            line.append(f" [{finding.rule}] {finding.message} ({finding.source})")
            console.print(line, soft_wrap=True)
        console.print(Text(f"{path}: {_summary(findings)}"), soft_wrap=True)


def _summary(findings: Sequence[Finding]) -> str:
    counted = Counter[str](finding.severity for finding in findings)
    parts = [f"{n} {severity}{'' if n == 1 else 's'}" for severity in _STYLE if (n := counted[severity])]
    verdict = "conforms to every rule that was checked"
    if counted["error"]:
        verdict = "does not conform to the standard"
    elif counted["warning"]:
        verdict = "conforms to the standard, but some importers will have problems"
    return ": ".join([verdict, *([", ".join(parts)] if parts else [])])


def as_json(results: Results) -> str:
    """Return a JSON list of FMUs with their findings."""
    content = [{"file": str(path), "findings": [asdict(f) for f in findings]} for path, findings in results.items()]
    return json.dumps(content, indent=2)


def as_sarif(results: Results) -> str:
    """Return one SARIF run; a finding refers to a file inside its FMU and a line there."""
    artifacts, indices = _artifacts(results)
    rules = list(RULES.values())
    positions = {rule.id: index for index, rule in enumerate(rules)}
    driver = {
        "name": "friction-fmus check",
        "version": VERSION,
        "rules": [
            {
                "id": rule.id,
                "shortDescription": {"text": rule.summary},
                "help": {"text": f"See section {rule.section} of {rule.standard}."},
                "defaultConfiguration": {"level": rule.severity},
                "properties": {"tags": [rule.kind]},
            }
            for rule in rules
        ],
    }
    found = [_result(path, f, indices, positions) for path, findings in results.items() for f in findings]
    run = {"tool": {"driver": driver}, "artifacts": artifacts, "results": found, "columnKind": "utf16CodeUnits"}
    log = {"$schema": "https://json.schemastore.org/sarif-2.1.0.json", "version": "2.1.0", "runs": [run]}
    return json.dumps(log, indent=2)


def _artifacts(results: Results) -> tuple[list[dict[str, Any]], dict[tuple[Path, str], int]]:
    """Return the FMUs and the files in them that have findings, and the index of each."""
    artifacts: list[dict[str, Any]] = []
    indices: dict[tuple[Path, str], int] = {}
    for path, findings in results.items():
        indices[path, ""] = len(artifacts)
        artifacts.append({"location": {"uri": _uri(path)}})
        for file in dict.fromkeys(finding.file for finding in findings if finding.file):
            indices[path, file] = len(artifacts)
            artifacts.append({"location": {"uri": quote(file)}, "parentIndex": indices[path, ""]})
    return artifacts, indices


def _result(
    path: Path, finding: Finding, indices: Mapping[tuple[Path, str], int], positions: Mapping[str, int]
) -> dict[str, Any]:
    inside = f" ({finding.place})" if finding.file else ""
    # the location is the FMU, a file of the repository; tools with nested artifacts find the inner file by its index
    location: dict[str, Any] = {
        "physicalLocation": {"artifactLocation": {"uri": _uri(path), "index": indices[path, ""]}}
    }
    if finding.variable:
        location["logicalLocations"] = [{"name": finding.variable, "kind": "member"}]
    result: dict[str, Any] = {
        "ruleId": finding.rule,
        "ruleIndex": positions[finding.rule],
        "level": finding.severity,
        "message": {"text": f"{finding.message}{inside}"},
        "locations": [location],
    }
    if finding.file:
        physical: dict[str, Any] = {
            "artifactLocation": {"uri": quote(finding.file), "index": indices[path, finding.file]}
        }
        if finding.line:
            physical["region"] = {"startLine": finding.line}
        result["relatedLocations"] = [{"id": 1, "physicalLocation": physical, "message": {"text": "in the FMU"}}]
    return result


def _uri(path: Path) -> str:
    return path.absolute().as_uri() if path.is_absolute() else quote(path.as_posix())


def rules_table() -> Table:
    """Return all rules as a table for a terminal."""
    table = Table(box=None, pad_edge=False)
    for heading in ("rule", "severity", "section", "error"):
        table.add_column(heading)
    for rule in RULES.values():
        table.add_row(rule.id, Text(rule.severity, _STYLE[rule.severity]), rule.section, rule.summary)
    return table
