"""What a communication step costs: the engine, the same loop by hand in C, and the same system in other masters.

Times are those of the processor, as others may use the machine, too.
"""

from __future__ import annotations

import ctypes
import subprocess
import time
from pathlib import Path

import numpy as np

from benchmarks.pairs import PAIRS, STEP, Built, Pair, Values
from benchmarks.peers import PEERS
from benchmarks.rows import Row
from harness import Tap
from harness.compiling.toolchain import FLAGS, compiler, header_folder

_COUNT, _POINTER = ctypes.c_size_t, ctypes.c_void_p


class Description(ctypes.Structure):
    """``Description`` of c_loop.c."""

    _fields_ = (
        *((name, ctypes.c_char_p) for name in ("path", "guid")),
        *(("input", ctypes.c_uint), ("outputs", ctypes.c_uint * 2), ("output_count", _COUNT)),
        *(("starts", _POINTER), ("start", _POINTER), ("start_count", _COUNT)),
    )


class CLoop:
    """The loop by hand.

    Parameters
    ----------
    folder : Path
        Where to compile it, with the flags of the FMUs.
    """

    def __init__(self, folder: Path) -> None:
        """Compile c_loop.c."""
        target = folder / "c_loop.so"
        flags = [flag for flag in FLAGS if flag != "-std=c99"]  # clock_gettime
        source = Path(__file__).parent / "c_loop.c"
        subprocess.run(
            [
                *(*compiler(), "-std=gnu99", *flags, "-fvisibility=default", "-Wno-missing-prototypes"),
                *("-I", str(header_folder()), str(source), "-o", str(target), "-shared", "-lm", "-ldl"),
            ],
            check=True,
        )
        self.run_pair = ctypes.CDLL(str(target)).run_pair
        self.run_pair.restype = ctypes.c_double

    def __call__(self, built: Built, n: int) -> tuple[float, Values]:
        """Seconds for n steps, and the rows."""
        descriptions, kept = [], []
        for member in built.pair.members:
            at = [built.references[f"{member.name}.{name}"] for name in (member.input, *member.outputs)]
            starts = np.array([built.references[f"{member.name}.{name}"] for name in member.start], dtype=np.uint32)
            values = np.array(list(member.start.values()), dtype=np.float64)
            kept += [starts, values]
            names = str(built.library(member)).encode(), built.descriptions[member.name].guid.encode()
            outputs = (ctypes.c_uint * 2)(*at[1:])
            pointers = starts.ctypes.data, values.ctypes.data, len(starts)
            descriptions.append(Description(*names, at[0], outputs, len(member.outputs), *pointers))
        rows = np.empty((n + 1, len(built.pair.recorded)))
        pointers = [ctypes.byref(description) for description in descriptions]
        numbers = ctypes.c_bool(built.pair.closed), ctypes.c_long(n), ctypes.c_double(STEP)
        seconds = float(self.run_pair(*pointers, *numbers, _POINTER(rows.ctypes.data)))
        if seconds < 0.0:
            raise SystemExit(f"{built.pair.title} does not run through in C")
        return seconds, rows


def ratio_rows(name: str, over: list[float], under: list[float], target: float | None = None) -> list[Row]:
    """A ratio of the fastest rounds, and the median of the ratios of the rounds."""
    median = float(np.median(np.array(over) / np.array(under)))
    return [Row(name, min(over) / min(under), "x", target), Row(f"{name}, median round", median, "x")]


def pair_rows(pair: Pair, folder: Path, loop: CLoop, rounds: int, n: int) -> list[Row]:
    """The rows of one pair; all in turn, round by round.

    Raises
    ------
    SystemExit
        If one of them computes something else.
    """
    built, few = Built(pair, folder), max(100, n // 250)
    by_hand: list[float] = []
    engine: list[float] = []
    whole: list[float] = []
    others: dict[str, list[float]] = {name: [] for name, peer in PEERS.items() if peer.installed}
    with built.system() as system:
        for _ in range(rounds):
            seconds, rows = loop(built, n)
            by_hand.append(seconds / n)
            times: list[float] = []  # at the start, in the middle and at the end: the second half is the loop alone
            watch = Tap(lambda t, values, times=times: times.append(time.thread_time()), names=(), every=n // 2)
            begin = time.thread_time()
            result = system.run(stop=n * STEP, step=STEP, record=pair.recorded, taps=[watch])
            whole.append((time.thread_time() - begin) / n)
            engine.append((times[2] - times[1]) / (n // 2))
            if not all(np.array_equal(result[name], rows[:, column]) for column, name in enumerate(pair.recorded)):
                raise SystemExit(f"{pair.title}: the engine and the loop in C compute different values")
            for name, taken in others.items():
                seconds, last = PEERS[name].run(built, few)
                if not np.allclose(last, rows[few], rtol=0.02, atol=2e-6):
                    raise SystemExit(f"{pair.title}: {name} ends with {last}, not {rows[few]}")
                taken.append(seconds / few)
    titled = f"{pair.title}: engine /"
    result_rows = [Row(f"{pair.title}: step of the engine", 1e9 * min(engine), "ns")]
    result_rows += ratio_rows(f"{titled} the loop in C", engine, by_hand, 1.25)
    result_rows += ratio_rows(f"{pair.title}: whole run with its Dataset / the loop in C", whole, by_hand)
    for name, times in others.items():
        result_rows += ratio_rows(f"{titled} {name}", engine, times, PEERS[name].target or pair.fmpy)
    return result_rows


def step_cost_rows(folder: Path, short: bool) -> list[Row]:
    """The rows of all pairs."""
    loop = CLoop(folder)
    rounds, n = (3, 50_000) if short else (60, 200_000)  # short rounds, for some to run undisturbed
    return [row for pair in PAIRS for row in pair_rows(pair, folder, loop, rounds, n)]
