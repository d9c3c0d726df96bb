"""Findings as text, JSON and SARIF 2.1.0 (OASIS, Static Analysis Results Interchange Format)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rich.console import Console
from rich.table import Table
from rich.text import Text

from friction_fmus.check.findings import RULES, Finding
from friction_fmus.version import VERSION

Results = Mapping[Path, Sequence[Finding]]
"""Findings of each FMU."""

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
    return ", ".join(parts) or "no findings"


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
            artifacts.append({"location": {"uri": _quoted(file)}, "parentIndex": indices[path, ""]})
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
            "artifactLocation": {"uri": _quoted(finding.file), "index": indices[path, finding.file]}
        }
        if finding.line:
            physical["region"] = {"startLine": finding.line}
        result["relatedLocations"] = [{"id": 1, "physicalLocation": physical, "message": {"text": "in the FMU"}}]
    return result


def _uri(path: Path) -> str:
    return path.absolute().as_uri() if path.is_absolute() else _quoted(path.as_posix())


def _quoted(path: str) -> str:
    return quote(path)


def rules_table() -> Table:
    """Return all rules as a table for a terminal."""
    table = Table(box=None, pad_edge=False)
    for heading in ("rule", "severity", "section", "error"):
        table.add_column(heading)
    for rule in RULES.values():
        table.add_row(rule.id, Text(rule.severity, _STYLE[rule.severity]), rule.section, rule.summary)
    return table
