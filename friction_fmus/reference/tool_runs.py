"""Run the cases of a set in a tool, and compare its results with the reference."""

from __future__ import annotations

import math
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any, Final

import numpy as np
import pandas as pd

from friction_fmus.errors import FrictionError
from friction_fmus.reference.case import BOUND, INPUTS, REFERENCE, ReferenceCase
from harness.storage.files import reason

TOOLS: Final = {
    name: f"{{python}} -m friction_fmus.reference.tools {name} {{case}} {{output}}" for name in ("fmpy", "harness")
}
"""Command lines of the tools that are installed with this package."""

SKIPPED: Final = 77  # exit status of a tool that does not support a case

PASSED, INACCURATE, FAILED, UNSUPPORTED = "passed", "inaccurate", "failed", "not supported"

SAME: Final = 1e-6  # distance of times that count as equal, in communication steps


@dataclass(frozen=True)
class Verdict:
    """What a tool made of a case."""

    case: str
    state: str  # passed, inaccurate, failed or not supported
    detail: str  # largest deviation over its bound, or the reason
    seconds: float = 0.0  # duration


@dataclass(frozen=True)
class ReferenceTool:
    """A tool, given by its command line, or by the results that it has written."""

    name: str
    command: str = ""  # with places such as {fmu}, see docs/reference-set.md
    results: Path | None = None  # folder with NAME.csv
    lacks: Collection[str] = ()  # needs of cases that it does not meet
    time_limit: float = 30.0  # for a case [s]


def run_case(case: ReferenceCase, tool: ReferenceTool, folder: Path) -> Verdict:
    """Run a case, with its results in a folder, and compare them."""
    begin = monotonic()
    output = ((tool.results or folder) / f"{case.name}.csv").resolve()
    unmet = {*tool.lacks}
    if tool.results is None and "{case}" not in tool.command:  # it cannot tell the tool
        unmet |= {"start", "call", *({"inputs"} if "{inputs}" not in tool.command else ())}
    lacks = [need for need in case.all_needs if need in unmet]
    if lacks:
        state, detail = UNSUPPORTED, f"needs {', '.join(lacks)}"
    elif tool.results is not None and not output.is_file():
        state, detail = UNSUPPORTED, "there is no result"
    else:
        state, detail = ("", "") if tool.results is not None else _run(case, tool, output)
        if not state:
            state, detail = compare(case, output)
    return Verdict(case.name, state, detail, monotonic() - begin)


def _run(case: ReferenceCase, tool: ReferenceTool, output: Path) -> tuple[str, str]:
    """Run the tool; return the verdict and its reason, empty if there are results to compare."""
    output.unlink(missing_ok=True)
    folder = case.folder.resolve()
    places = {"case": folder, "fmu": folder / case.file.name, "output": output, "python": sys.executable}
    places |= {name: repr(value) for name, value in vars(case.experiment).items()}
    places["inputs"] = folder / INPUTS if case.inputs else ""
    try:
        process = subprocess.Popen(
            _command(tool.command, places),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise FrictionError(f"the command {tool.command!r} cannot be run ({reason(error)}); correct it") from error
    said = b""
    with process:
        try:
            said, _ = process.communicate(timeout=tool.time_limit)
        except subprocess.TimeoutExpired:
            return FAILED, f"it did not end within {tool.time_limit:g} s"
        finally:
            if process.poll() is None:  # with what it has started
                os.killpg(process.pid, signal.SIGKILL) if os.name == "posix" else process.kill()
    last = [*said.decode(errors="replace").strip().splitlines(), "it printed nothing"][-2:][0][:300]
    status = process.returncode
    if status == SKIPPED:
        return UNSUPPORTED, last
    if status < 0:
        return FAILED, f"it crashed ({signal.Signals(-status).name}): {last}"
    if status and case.may_refuse:
        return PASSED, f"it refuses, as it may: {last}"
    if status or not output.is_file():
        return FAILED, f"exit status {status}: {last}" if status else f"it wrote no {output.name}: {last}"
    return "", ""


def _command(template: str, places: Mapping[str, Any]) -> list[str]:
    """Return a command line; without inputs, their place is left out with the option before it."""
    words: list[str] = []
    for word in shlex.split(template):
        if "{inputs}" not in word or places["inputs"]:
            words.append(word.format_map(places))
        elif word == "{inputs}" and words[-1].startswith("-"):
            words.pop()
    return words


def read_results(path: Path) -> pd.DataFrame:
    """Read a CSV file with the time and variables, perhaps with units in its heading."""
    table = pd.read_csv(path, skipinitialspace=True, keep_default_na=False, na_values=["nan", "NaN"], low_memory=False)
    return table.rename(columns=lambda name: str(name).strip().partition(" [")[0])


def compare(case: ReferenceCase, output: Path) -> tuple[str, str]:
    """Return the verdict on results, and its reason."""
    reference, bound = read_results(case.folder / REFERENCE), read_results(case.folder / BOUND)
    wanted, slack = reference["time"].to_list(), SAME * case.experiment.step
    try:
        found = read_results(output)
        times = np.array(found["time"], dtype=float)
        missing = [name for name in case.outputs if name not in found]
    except (OSError, ValueError, KeyError) as error:
        return FAILED, f"its results cannot be read ({reason(error)})"
    if missing:
        return FAILED, f"its results have no {', '.join(missing)}"
    if case.call and len(times) != len(wanted):
        return FAILED, f"its results have {len(times)} rows, not {len(wanted)}"
    if not case.call and not (np.diff(times) >= -slack).all():
        return FAILED, "its times decrease"
    if times.size and times.max() > case.experiment.stop + slack:
        return FAILED, f"it runs to {times.max():.12g} s, beyond the stop time"
    worst, detail = 0.0, ""
    for row, t in enumerate(wanted):
        if case.call:
            alike, rows = [row], [row] * int(abs(times[row] - t) <= slack)
        else:
            alike = [other for other in range(row - 1, row + 2) if 0 <= other < len(wanted) and wanted[other] == t]
            rows = [*range(*np.searchsorted(times, [t - slack, t + slack]))]
        if not rows:
            return FAILED, f"its results have no row for {t:.12g} s"
        for name in case.outputs:
            values = found[name].to_numpy(), reference[name].to_numpy(), bound[name].to_numpy()
            ratio, i, k = min((_ratio(values[0][i], values[1][k], values[2][k]), i, k) for i in rows for k in alike)
            if ratio > worst:
                worst = ratio
                detail = f"{name} is {values[0][i]} at {t:.12g} s, not {values[1][k]} with the bound {values[2][k]}"
    if math.isinf(worst):
        return FAILED, detail
    state = PASSED if worst <= 1.0 else INACCURATE
    return state, f"{worst:.2g} times the bound{f': {detail}' if worst > 1.0 else ''}"


_TRUTHS: Final = {"true": 1.0, "false": 0.0}


def _ratio(value: Any, expected: Any, bound: Any) -> float:
    """Return a deviation over its bound; infinite if it is not a number, or has to be exact and is not."""
    if str(expected) == "":  # not compared
        return 0.0
    try:
        number, wanted, allowed = (
            float(_TRUTHS.get(str(each).lower(), each)) for each in (value, expected, bound or 0)
        )
    except ValueError:
        return 0.0 if str(value) == str(expected) else math.inf
    error = abs(number - wanted)
    if error == 0.0 or (math.isnan(number) and math.isnan(wanted)):
        return 0.0
    return error / allowed if allowed > 0.0 and math.isfinite(error) else math.inf
