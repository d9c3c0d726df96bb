"""The harness: what a communication step costs beside other masters, and how right its masters are.

Two pairs of FMUs are timed in the compiled engine, in a loop by hand in C, in one with fmpy, in ecos and in libcosim;
all in turn in one process, all record the same variables, the start is not timed. The fastest round of each counts,
and the median of the ratios of the rounds. The errors of the masters are against closed forms and tight references.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

import logging
import tempfile

from benchmarks.linear_loops import linear_rows
from benchmarks.rows import arguments, report
from benchmarks.sampled_loop import sampled_rows
from benchmarks.step_cost import step_cost_rows
from benchmarks.stick_slip_errors import period_rows, stiff_rows


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    logging.getLogger("harness").addHandler(logging.NullHandler())  # runs beyond the limits of a master warn
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        rows = step_cost_rows(folder, options.short)
        rows += [*period_rows(folder), *stiff_rows(folder), *sampled_rows(folder), *linear_rows()]
    report("Co-simulation", rows, options.json)


if __name__ == "__main__":
    main()
