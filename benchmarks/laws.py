"""Time per sample of every law: as FMU, as exported C in double and in float, and in casadi's virtual machine.

Random inputs, states fed back (casadi: unconnected samples, called from C++). The FMU's time is that of the whole call
sequence of a sample: set all inputs, fmi2DoStep, get all results. All run in turn in one process with the same compiler
flags, in processor time; the fastest round counts. FMU and exported C give the same numbers.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

import tempfile

import numpy as np

from benchmarks.law_runs import LawC, LawFmu, casadi_by_rows, rows_of
from benchmarks.rows import Row, arguments, report
from friction_fmus import catalogue
from friction_fmus.codegen.export import make_export
from friction_fmus.codegen.program import samples


def law_times(name: str, folder: Path, n: int, rounds: int) -> dict[str, float]:
    """Nanoseconds per sample of each way to compute a law."""
    export, single = make_export(name), make_export(name, real="float")
    given = samples(export, n)
    rows = rows_of(export, given)
    fmu, c, c_float = LawFmu(export.law, folder), LawC(export, folder / "c"), LawC(single, folder / "float")
    if not np.array_equal(fmu.run(given)[0], c.run(rows, feeds_back=True)[0]):
        raise SystemExit(f"{name}: the FMU and the exported C differ")
    seconds: dict[str, list[float]] = {"FMU": [], "C": [], "C in float": [], "casadi": []}
    for _ in range(rounds):
        seconds["FMU"].append(fmu.run(given)[1])
        seconds["C"].append(c.run(rows, feeds_back=True)[1])
        seconds["C in float"].append(c_float.run(rows, feeds_back=True)[1])
        seconds["casadi"].append(casadi_by_rows(export.law, rows)[1])
    return {way: 1e9 * min(times) / n for way, times in seconds.items()}


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    n, rounds = (2_000, 3) if options.short else (20_000, 15)
    rows, ratios = [], []
    for block in catalogue().values():
        if block.kind == "law":
            with tempfile.TemporaryDirectory() as scratch:
                times = law_times(block.name, Path(scratch), n, rounds)
            rows += [Row(f"{block.name}: {way}", value, "ns") for way, value in times.items()]
            ratios.append((times["FMU"] / times["C"], times["casadi"] / times["C"], times["C in float"] / times["C"]))
    fmu, casadi, single = np.array(ratios).T
    rows += [
        Row("FMU over exported C, median of the laws", float(np.median(fmu)), "x"),
        Row("FMU over exported C, largest of the laws", float(fmu.max()), "x"),
        Row("casadi over exported C, median of the laws", float(np.median(casadi)), "x"),
        Row("casadi over exported C, smallest of the laws", float(casadi.min()), "x"),
        Row("C in float over C in double, median of the laws", float(np.median(single)), "x"),
    ]
    report("Laws, one sample", rows, options.json)


if __name__ == "__main__":
    main()
