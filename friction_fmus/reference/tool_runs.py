"""Runs of the cases of a set in a tool: results compared with the reference, verdicts as JUnit and as a page."""

from __future__ import annotations

import math
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any, Final

import numpy as np
from lxml import etree

from friction_fmus.errors import FrictionError
from friction_fmus.export.targets import write_file
from friction_fmus.fmi.html_page import STYLE, row, table
from friction_fmus.reference.case import BOUND, INPUTS, REFERENCE, ReferenceCase
from harness.storage.files import read_csv, reason

TOOLS: Final = ("fmpy", "harness")  # tools that are installed with this package, see tools.py

SKIPPED: Final = 77  # exit status of a tool that does not support a case

PASSED, INACCURATE, FAILED, UNSUPPORTED = "passed", "inaccurate", "failed", "not supported"


@dataclass(frozen=True)
class Verdict:
    """What a tool made of a case."""

    case: str
    state: str  # passed, inaccurate, failed or not supported
    detail: str  # largest deviation over its bound, or the reason
    seconds: float = 0.0  # duration


def run_case(
    case: ReferenceCase,
    command: str,
    folder: Path,
    *,
    results: Path | None = None,  # folder of results that need no run
    lacks: Collection[str] = (),  # needs of cases that the tool does not meet
    time_limit: float | None = None,  # in place of that of the case [s]
) -> Verdict:
    """Run a case by a tool or command line, with its results in a folder, or compare results that are there."""
    begin = monotonic()
    if command in TOOLS:
        command = f"{{python}} -m friction_fmus.reference.tools {command} {{case}} {{output}}"
    output = ((results or folder) / f"{case.name}.csv").resolve()
    unmet = {*lacks}
    if results is None and "{case}" not in command:  # it cannot tell the tool
        unmet |= {"start", "call", *({"inputs"} if "{inputs}" not in command else ())}
    state, detail = "", ""
    if needs := [need for need in case.all_needs if need in unmet]:
        state, detail = UNSUPPORTED, f"needs {', '.join(needs)}"
    elif results is None:
        state, detail = _run(case, command, output, time_limit or case.time_limit)
    elif not output.is_file():
        state, detail = UNSUPPORTED, "there is no result"
    if not state:
        state, detail = compare(case, output)
    return Verdict(case.name, state, detail, monotonic() - begin)


def _run(case: ReferenceCase, command: str, output: Path, limit: float) -> tuple[str, str]:
    """Run the tool; return the verdict and its reason, empty if there are results to compare."""
    output.unlink(missing_ok=True)
    folder = case.folder.resolve()
    paths = {"case": folder, "fmu": folder / case.file.name, "inputs": folder / INPUTS, "output": output}
    places = {**paths, **{name: repr(value) for name, value in vars(case.experiment).items()}, "python": sys.executable}
    try:
        given = [word for word in shlex.split(command) if case.inputs or "{inputs}" not in word]
        words = [word.format_map(places) for word in given]
        pipes: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        process = subprocess.Popen(words, **pipes, start_new_session=True)
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise FrictionError(f"the command {command!r} cannot be run ({reason(error)}); correct it") from error
    said = b""
    with process:
        try:
            said, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            return FAILED, f"it did not end within {limit:g} s"
        finally:
            if process.poll() is None:  # with what it has started
                os.killpg(process.pid, signal.SIGKILL) if os.name == "posix" else process.kill()
    last = [*said.decode(errors="replace").strip().splitlines(), "it printed nothing"][-2:][0][:300]
    status = process.returncode
    if status == SKIPPED:
        return UNSUPPORTED, last
    if status < 0:
        return FAILED, f"it crashed ({signal.Signals(-status).name}): {last}"
    if status:
        return (PASSED, f"it refuses, as it may: {last}") if case.may_refuse else (FAILED, f"status {status}: {last}")
    return ("", "") if output.is_file() else (FAILED, f"it wrote no {output.name}: {last}")


def read_results(path: Path) -> dict[str, list[str]]:
    """Return the columns of a CSV file with the time and variables, perhaps with units in its heading."""
    heading, *rows = read_csv(path)
    names = [name.strip().partition(" [")[0] for name in heading]
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)) if rows else {name: [] for name in names}


def compare(case: ReferenceCase, output: Path) -> tuple[str, str]:
    """Return the verdict on results, and its reason."""
    reference, bound = read_results(case.folder / REFERENCE), read_results(case.folder / BOUND)
    wanted, slack = np.array(reference["time"], dtype=float), 1e-6 * case.experiment.step  # of times
    try:
        found = read_results(output)
        times = np.array(found["time"], dtype=float)
    except (OSError, ValueError, KeyError) as error:
        return FAILED, f"its results cannot be read ({reason(error)})"
    if missing := [name for name in case.outputs if name not in found]:
        return FAILED, f"its results have no {', '.join(missing)}"
    if case.call and len(times) != len(wanted):
        return FAILED, f"its results have {len(times)} rows, not {len(wanted)}"
    if not case.call and not (np.diff(times) >= -slack).all():
        return FAILED, "its times decrease"
    if times.size and times.max() > wanted.max() + slack:
        return FAILED, f"it runs to {times.max():.12g} s, and has to end at {wanted.max():.12g} s"
    worst, detail = 0.0, ""
    for place, t in enumerate(wanted):
        if case.call:
            alike, rows = [place], [place] * int(abs(times[place] - t) <= slack)
        else:
            alike, rows = [*np.flatnonzero(wanted == t)], [*range(*np.searchsorted(times, [t - slack, t + slack]))]
        for name in case.outputs:
            values, right, allowed = found[name], reference[name], bound[name]
            if right[place] == "":  # not compared
                continue
            if not rows:
                return FAILED, f"its results have no row for {t:.12g} s"
            ratio, i, k = min((_ratio(values[i], right[k], allowed[k]), i, k) for i in rows for k in alike)
            if ratio > worst:
                worst = ratio
                detail = f"{name} is {values[i]} at {t:.12g} s, not {right[k]} with the bound {allowed[k]}"
    if math.isinf(worst):
        return FAILED, detail
    state = PASSED if worst <= 1.0 else INACCURATE
    return state, f"{worst:.2g} times the bound{f': {detail}' if worst > 1.0 else ''}"


def _ratio(value: str, right: str, bound: str) -> float:
    """Return a deviation over its bound; infinite if it is not a number, or has to be exact and is not."""
    try:
        expected, allowed = float(right), float(bound or "0")
        number = float({"true": "1", "false": "0"}.get(value.lower(), value))
    except ValueError:
        return 0.0 if value == right else math.inf
    error = abs(number - expected)
    return 0.0 if error == 0.0 else error / allowed if allowed > 0.0 and math.isfinite(error) else math.inf


COLOURS: Final = """
.passed { background: #00c80026; }
.inaccurate { background: #e6c80040; }
.failed { background: #ff000026; }
@media (prefers-color-scheme: dark) {
  :root { color-scheme: dark; }
  body { color: #e6e6e6; }
  caption { color: #b0b0b0; }
}
"""


def write_junit(verdicts: Sequence[Verdict], tool: str, folder: Path) -> None:
    """Write the verdicts of a tool to the folder of its results."""
    suite = etree.Element("testsuite", name=f"reference set in {tool}", tests=str(len(verdicts)))
    suite.set("failures", str(sum(verdict.state in (FAILED, INACCURATE) for verdict in verdicts)))
    suite.set("skipped", str(sum(verdict.state == UNSUPPORTED for verdict in verdicts)))
    for verdict in verdicts:
        test = etree.SubElement(suite, "testcase", classname=tool, name=verdict.case, time=f"{verdict.seconds:.3f}")
        detail = "".join(letter if letter.isprintable() else " " for letter in f"{verdict.state}: {verdict.detail}")
        kind = {PASSED: "system-out", UNSUPPORTED: "skipped"}.get(verdict.state, "failure")
        etree.SubElement(test, kind, {} if kind == "system-out" else {"message": detail}).text = detail
    write_file(etree.tostring(suite, xml_declaration=True, encoding="UTF-8", pretty_print=True), folder / "junit.xml")


def read_junit(folder: Path) -> dict[str, dict[str, str]]:
    """Return the verdicts of each tool in a set, by case, each as one text that begins with the state."""
    files = sorted((folder / "results").glob("*/junit.xml"))
    return {
        file.parent.name: {str(test.get("name")): str(test[0].text) for test in etree.parse(file).iter("testcase")}
        for file in files
    }


def write_page(cases: Sequence[ReferenceCase], folder: Path) -> Path:
    """Write the table of all cases and all tools that were run on a set."""
    tools = read_junit(folder)
    rows = [row(case.name, case.title, *(found.get(case.name, "") for found in tools.values())) for case in cases]
    body = table("Cases and tools", ("case", "title", *tools), "".join(rows))
    body = re.sub(f"<td>({PASSED}|{INACCURATE}|{FAILED}|{UNSUPPORTED}): ", r'<td class="\1"><b>\1</b><br>', body)
    body = re.sub(r'<th scope="row">(\w+)', r'<th scope="row"><a href="../\1/README.md">\1</a>', body)
    title, path = "Reference set for tools that import FMUs", folder / "results" / "index.html"
    head = f'<head>\n<meta charset="utf-8">\n<title>{title}</title>\n<style>{STYLE}{COLOURS}</style>\n</head>'
    page = f'<!DOCTYPE html>\n<html lang="en">\n{head}\n<body>\n<h1>{title}</h1>\n{body}</body>\n</html>\n'
    write_file(page, path)
    return path
