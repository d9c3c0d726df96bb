"""Time per sample of every law: as FMU, as exported C in double and in float, in casadi's virtual machine, and of two
laws as C by hand.

Random inputs, states fed back. The FMU's time is that of the whole call sequence of a sample: set all inputs,
fmi2DoStep, get all results; that of C: set all inputs, call the step. All run in turn in one process with the same
compiler flags, in processor time; the fastest round counts. FMU and exported C give the same numbers, C by hand those
of other roundings.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

import tempfile
from collections.abc import Callable, Mapping

import numpy as np

from benchmarks.law_runs import LawBuffer, LawC, LawFmu, casadi_by_rows, rows_of
from benchmarks.law_variants import variants
from benchmarks.rows import Row, arguments, report
from friction_fmus import catalogue
from friction_fmus.codegen.emulation import samples
from friction_fmus.codegen.law_export import make_export

TARGETS = {"LuGreObserver": 1.1, "GMSFeedforward": 1.25}
"""Laws that are written by hand, and what the exported C may take over the faster one by hand."""

N = 2_000  # samples of C: they stay in the cache


def fastest(ways: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """Nanoseconds of every way, the fastest of rounds in which all take their turn."""
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, measure in ways.items():
            seconds[way].append(measure())
    return {way: 1e9 * min(times) for way, times in seconds.items()}


def law_times(name: str, folder: Path, n: int, rounds: int) -> dict[str, float]:
    """Nanoseconds per sample of each way to compute a law."""
    export, single = make_export(name), make_export(name, real="float")
    given, few, few_single = samples(export, n), samples(export, N), samples(single, N)
    rows = rows_of(export, given)
    first = {name: column[: n // 40] for name, column in given.items()}
    fmu, c, c_float = LawFmu(export.law, folder), LawC(export, folder / "c"), LawC(single, folder / "float")
    buffer = LawBuffer(export, folder / "buffer")
    if not np.array_equal(fmu.run(given)[0], c.run(rows, feeds_back=True)):
        raise SystemExit(f"{name}: the FMU and the exported C differ")
    ways: dict[str, Callable[[], float]] = {
        "FMU": lambda: fmu.run(given)[1] / n,
        "C": lambda: c.cost(few, n // N),
        "C in float": lambda: c_float.cost(few_single, n // N),
        "buffer from Python": lambda: buffer.from_python(first),
        "buffer from C": lambda: buffer.from_c(given),
        "map": lambda: casadi_by_rows(export.law, rows)[1] / n,
    }
    return fastest(ways, rounds)


def motion(n: int) -> dict[str, np.ndarray]:
    """Inputs of a sine of 10 mm at 1 Hz that is followed with an error of 0.1 %, sampled at 1 kHz."""
    phase = 2.0 * np.pi * np.arange(n) / 1000.0
    r, rd = 0.01 * np.sin(phase), 0.02 * np.pi * np.cos(phase)
    on, off = np.ones(n), np.zeros(n)
    rdd = -0.04 * np.pi**2 * np.sin(phase)
    commands = {"enable": on, "reset": off, "track": off, "u_track": off}
    return {"r": r, "x": 0.999 * r, "v": 0.999 * rd, "rd": rd, "rdd": rdd, "Fn": on} | commands


def by_hand(name: str, folder: Path, rounds: int) -> list[Row]:
    """The exported C / C by hand and its own variants over it, on random samples and in a motion."""
    export = make_export(name)
    source = Path(__file__).parent / "hand" / f"{name}.c"
    exported = LawC(export, folder / "exported")
    hands = {
        way: LawC(export, folder / way, step=way, source=source, flags=("-Wno-unused-function",))
        for way in ("branching", "branch_free")
    }
    silent = {"track": np.zeros(100_000)}  # C by hand has no track
    rows = rows_of(export, samples(export, 100_000, seed=2) | silent)
    expected = exported.run(rows, feeds_back=True)
    for way, hand in hands.items():
        far = np.abs(hand.run(rows, feeds_back=True) - expected) > 1e-9 * np.sqrt(np.mean(expected**2, axis=0))
        if far.any():
            raise SystemExit(f"{name}: the {way} C by hand gives other numbers in {far.any(axis=1).sum()} samples")

    others = variants(export, folder)
    found = []
    for inputs, given in (("random samples", samples(export, N) | {"track": np.zeros(N)}), ("a motion", motion(N))):
        ways = {way: lambda c=c, given=given: c.cost(given, 5) for way, c in {"C": exported, **hands, **others}.items()}
        times = fastest(ways, 2 * rounds)
        plain, branching = times["branch_free"], times["branching"]
        title = f"{name}, {inputs}"
        found += [
            Row(f"{title}: exported C / C by hand", times["C"] / min(plain, branching), "x", TARGETS[name]),
            Row(f"{title}: C by hand, branch-free relative to branching", plain / branching, "x"),
            *(Row(f"{title}: {way}", times[way] / times["C"], "x") for way in others),
        ]
    return found


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    n, rounds = (2_000, 3) if options.short else (20_000, 15)
    rows: list[Row] = []
    table: dict[str, list[float]] = {}
    for block in catalogue().values():
        if block.is_law:
            with tempfile.TemporaryDirectory() as scratch:
                times = law_times(block.name, Path(scratch), n, rounds)
            rows += [Row(f"{block.name}: {way}", value, "ns") for way, value in times.items()]
            for way, value in times.items():
                table.setdefault(way, []).append(value)
    ways = {way: np.array(values) for way, values in table.items()}
    for name in TARGETS:
        with tempfile.TemporaryDirectory() as scratch:
            rows += by_hand(name, Path(scratch), rounds)
    c = ways["C"]
    for text, way in (("exported C", "C"), ("exported C in float", "C in float"), ("FMU", "FMU")):
        rows.append(Row(f"slowest law as {text} / 1 µs", float(ways[way].max()) / 1e3, "x", 1.0))
    for text, way, target in (
        ("casadi's buffer called from Python", "buffer from Python", 0.1),
        ("casadi's buffer called from C", "buffer from C", None),
        ("casadi's map", "map", None),
    ):
        rows.append(Row(f"exported C / {text}, median of the laws", float(np.median(c / ways[way])), "x"))
        rows.append(Row(f"exported C / {text}, largest of the laws", float((c / ways[way]).max()), "x", target))
    rows += [
        Row("FMU / exported C, median of the laws", float(np.median(ways["FMU"] / c)), "x"),
        Row("FMU / exported C, largest of the laws", float((ways["FMU"] / c).max()), "x"),
        Row("C in float / C in double, median of the laws", float(np.median(ways["C in float"] / c)), "x"),
    ]
    report("Laws, one sample", rows, options.json)


if __name__ == "__main__":
    main()
