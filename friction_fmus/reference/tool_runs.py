"""Run the cases of a set in a tool, and compare its results with the reference."""

from __future__ import annotations

import math
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from time import monotonic
from typing import Any, Final

import numpy as np
import pandas as pd

from friction_fmus.errors import FrictionError
from friction_fmus.reference.case import BOUND, REFERENCE, ReferenceCase
from harness.storage.files import make_folder, reason

TOOLS: Final = {
    name: f"{{python}} -m friction_fmus.reference.tools.{name}_tool {{case}} {{output}}" for name in ("fmpy", "harness")
}
"""Command line templates of tools that are installed with this package."""

SKIPPED: Final = 77  # exit status of a tool that does not support a case

PASSED, INACCURATE, FAILED, UNSUPPORTED = "passed", "inaccurate", "failed", "not supported"

SAME_TIME: Final = 1e-6  # largest distance of times that count as equal, in communication steps


@dataclass(frozen=True)
class Verdict:
    """What a tool made of a case."""

    case: str
    title: str
    state: str  # passed, inaccurate, failed or not supported
    detail: str = ""  # largest deviation over its bound, or the reason
    ratio: float = 0.0  # largest deviation over its bound
    seconds: float = 0.0  # duration


@dataclass(frozen=True)
class Tool:
    """A tool, given by its command line, or by results that it has written."""

    name: str
    command: str = ""
    """Template with {fmu}, {case}, {output}, {inputs}, {start}, {stop}, {step}, {tolerance}, {python}."""
    results: Path | None = None  # folder with NAME.csv of cases
    lacks: Collection[str] = ()  # needs of cases that it does not meet
    time_limit: float = 30.0  # of a case [s]


def run_case(case: ReferenceCase, tool: Tool, folder: Path) -> Verdict:
    """Run a case and compare; the results are written to ``NAME.csv`` in a folder."""
    begin = monotonic()
    lacks = sorted(case.all_needs & {*tool.lacks, *_inexpressible(tool)})
    if lacks:
        return Verdict(case.name, case.title, UNSUPPORTED, f"needs {', '.join(lacks)}")
    output = (tool.results or folder) / f"{case.name}.csv"
    if tool.results is not None:
        state, detail, ratio = compare(case, output) if output.is_file() else (UNSUPPORTED, "no result", 0.0)
    else:
        output.unlink(missing_ok=True)
        state, detail = _run(case, tool, output.resolve())
        ratio = 0.0
        if not state:
            state, detail, ratio = compare(case, output)
    return Verdict(case.name, case.title, state, detail, ratio, monotonic() - begin)


def _inexpressible(tool: Tool) -> set[str]:
    """Return what a command line without a place for it cannot pass on."""
    if tool.results is not None or "{case}" in tool.command:
        return set()
    return {"start", "call", *({"inputs"} if "{inputs}" not in tool.command else ())}


def _run(case: ReferenceCase, tool: Tool, output: Path) -> tuple[str, str]:
    """Run the tool; return the verdict if there is nothing to compare, and the reason."""
    times = case.experiment
    places = {
        "fmu": case.file.resolve(),
        "case": case.folder.resolve(),
        "inputs": (case.folder / "inputs.csv").resolve() if case.inputs else "",
        "output": output,
        "python": sys.executable,
        **{name: repr(getattr(times, name)) for name in ("start", "stop", "step", "tolerance")},
    }
    try:
        with subprocess.Popen(
            _command(tool.command, places),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        ) as process:
            try:
                said, _ = process.communicate(timeout=tool.time_limit)
            except BaseException as error:
                _end(process)
                if not isinstance(error, subprocess.TimeoutExpired):
                    raise
                return FAILED, f"it did not end within {tool.time_limit:g} s"
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise FrictionError(f"the command {tool.command!r} cannot be run ({reason(error)}); correct it") from error
    lines = said.decode(errors="replace").strip().splitlines()
    last = lines[-1][:300] if lines else "it printed nothing"
    status = process.returncode
    if status == SKIPPED:
        return UNSUPPORTED, last
    if status < 0:
        return FAILED, f"it crashed ({signal.Signals(-status).name}): {last}"
    if status:
        return (PASSED, "it refuses, as it may") if case.may_refuse else (FAILED, f"exit status {status}: {last}")
    return ("", "") if output.is_file() else (FAILED, f"it wrote no {output.name}: {last}")


def _command(template: str, places: Mapping[str, object]) -> list[str]:
    """Return a command line; without inputs, their place is left out with the option before it."""
    words: list[str] = []
    for word in shlex.split(template):
        if "{inputs}" in word and not places["inputs"]:
            words = words[:-1] if words[-1:] and words[-1].startswith("-") and word == "{inputs}" else words
        else:
            words.append(word.format_map(places))
    return words


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a tool and what it has started."""
    if os.name == "posix":
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def read_table(path: Path) -> pd.DataFrame:
    """Read results: a CSV file with the time and variables, perhaps with units in its heading."""
    table = pd.read_csv(path, skipinitialspace=True, keep_default_na=False, na_values=["nan", "NaN"], low_memory=False)
    return table.rename(columns={name: str(name).strip().partition(" [")[0] for name in table.columns})


def compare(case: ReferenceCase, output: Path) -> tuple[str, str, float]:
    """Compare results with the reference; return the verdict, its reason, and the largest deviation over its bound."""
    reference, bound = read_table(case.folder / REFERENCE), read_table(case.folder / BOUND)
    try:
        found = read_table(output)
    except (OSError, ValueError) as error:
        return FAILED, f"its results cannot be read ({reason(error)})", math.inf
    missing = [name for name in ("time", *case.outputs) if name not in found]
    if missing:
        return FAILED, f"its results have no {', '.join(missing)}", math.inf
    times = pd.to_numeric(found["time"], errors="coerce").to_numpy(dtype=float)
    wanted = reference["time"].to_list()
    slack = SAME_TIME * case.experiment.step
    groups: list[tuple[float, list[int], list[int]]] = []
    if case.call:
        if len(times) != len(reference):
            return FAILED, f"its results have {len(times)} rows in place of {len(reference)}", math.inf
        groups = [(t, [row], [row] * int(abs(times[row] - t) <= slack)) for row, t in enumerate(wanted)]
    else:
        if not (np.diff(times) >= -slack).all():
            return FAILED, "its times are not numbers that increase", math.inf
        if len(times) and times[-1] > case.experiment.stop + slack:
            return FAILED, f"it runs to {times[-1]:.12g} s, beyond the stop time", math.inf
        for t in sorted({*wanted}):
            first, last = np.searchsorted(times, [t - slack, t + slack])
            groups.append((t, [k for k, same in enumerate(wanted) if same == t], [*range(first, last)]))
    worst, detail = 0.0, ""
    for t, expected, rows_found in groups:
        if not rows_found:
            return FAILED, f"its results have no row for {t:.12g} s", math.inf
        for name in case.outputs:
            pairs = [
                (_ratio(found[name].iat[i], reference[name].iat[k], bound[name].iat[k]), i, k)
                for i in rows_found
                for k in expected
            ]
            ratio, i, k = min(pairs)
            if ratio > worst:
                got, wanted_value, allowed = (
                    str(each[name].iat[n]) for each, n in ((found, i), (reference, k), (bound, k))
                )
                worst, detail = ratio, f"{name} is {got} at {t:.12g} s, not {wanted_value} with the bound {allowed}"
                if math.isinf(ratio):
                    return FAILED, detail, ratio
    if worst > 1.0:
        return INACCURATE, f"{worst:.3g} times the bound: {detail}", worst
    return PASSED, f"largest deviation {worst:.2g} of the bound", worst


def _ratio(value: Any, expected: Any, bound: Any) -> float:
    """Return a deviation over its bound; infinite where it is not a number or has to be exact, and is not."""
    if str(expected) == "":  # not compared
        return 0.0
    try:
        number, wanted, allowed = float(_BOOLEANS.get(str(value).lower(), value)), float(expected), float(bound or 0.0)
    except ValueError:
        return 0.0 if str(value) == str(expected) else math.inf
    if math.isnan(wanted):
        return 0.0 if math.isnan(number) else math.inf
    error = abs(number - wanted)
    if error == 0.0:
        return 0.0
    return error / allowed if allowed > 0.0 and math.isfinite(error) else math.inf


_BOOLEANS: Final[Mapping[str, float]] = {"true": 1.0, "false": 0.0}


def as_records(verdicts: Collection[Verdict]) -> list[dict[str, Any]]:
    """Return verdicts for JSON."""
    return [asdict(verdict) for verdict in verdicts]


def result_folder(folder: Path, tool: str) -> Path:
    """Make the folder for the results of a tool in a set."""
    target = folder / "results" / tool
    make_folder(target)
    return target
