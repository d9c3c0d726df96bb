"""Time per fmi2DoStep of every friction model, beside the same law as a plain C function compiled with the same flags.

Held velocities along a sinusoid through presliding and sliding, h = 0.1 ms. The FMU and the plain law run in turn, in
one process, and give the same forces; the minimum over the rounds counts. ``casadi.integrator('cvodes')`` solves LuGre
and ElastoPlastic at the accuracy of the FMU over the same steps.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

import ctypes
import math
import subprocess
import tempfile
import time
from typing import Any

import casadi as ca
import fmpy
import numpy as np

from benchmarks.rows import Row, arguments, report
from friction_fmus import Block, build, catalogue
from harness.compiling.toolchain import FLAGS, compiler, header_folder

STEP = 1e-4
SINGLE_STATE = ("Dahl", "LuGre", "ElastoPlastic", "ResetIntegrator", "RateAndState", "Leuven")
"""The laws for which the target of 1.5 times the plain law is meant."""

RANDOM = ("Bristle",)
"""The plain law draws other random numbers, its force is not compared."""


class Timer:
    """Runs an FMU or a plain law over the velocities.

    Parameters
    ----------
    folder : Path
        Where to compile.
    velocities : float64 array, shape (n,)
        The inputs, each held for a step.
    """

    def __init__(self, folder: Path, velocities: np.ndarray) -> None:
        """Compile loops.c with the flags of the FMUs."""
        target = folder / "loops.so"
        flags = [flag for flag in FLAGS if flag != "-std=c99"]  # M_PI and clock_gettime
        source = Path(__file__).parent / "loops.c"
        subprocess.run(
            [
                *(*compiler(), "-std=gnu99", *flags, "-fvisibility=default", "-Wno-missing-prototypes"),
                *("-I", str(header_folder()), str(source), "-o", str(target), "-shared", "-lm", "-ldl"),
            ],
            check=True,
        )
        self.library = ctypes.CDLL(str(target))
        self.library.run_plain.restype = ctypes.c_double
        self.library.run_fmu.restype = ctypes.c_bool
        self.library.parameters_of.restype = ctypes.c_char_p
        self.velocities = velocities
        self.n = len(velocities)
        self.forces = {"fmu": np.zeros(self.n), "plain": np.zeros(self.n)}

    def fmu(self, folder: Path, description: Any) -> tuple[float, float]:
        """Seconds for all steps of the FMU, driven by its first input, its first output read, and without the steps."""
        name = description.coSimulation.modelIdentifier
        path = folder / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"
        u, y = (
            next(v for v in description.modelVariables if v.causality == causality and v.type == "Real")
            for causality in ("input", "output")
        )
        total = (ctypes.c_double * 2)()
        references = ctypes.c_uint(u.valueReference), ctypes.c_uint(y.valueReference)
        arrays = self.velocities.ctypes, self.forces["fmu"].ctypes
        pointers = [ctypes.c_void_p(array.data) for array in arrays]
        identity = str(path).encode(), description.guid.encode()
        if not self.library.run_fmu(
            *identity, *references, *pointers, ctypes.c_long(self.n), ctypes.c_double(STEP), total
        ):
            raise SystemExit(f"{name} does not run through")
        return total[0], total[1]

    def parameters(self, name: str, start: dict[str, float]) -> list[float] | None:
        """Values of the parameters of a plain law, None if there is no plain law."""
        names = self.library.parameters_of(name.encode())
        return None if names is None else [start[parameter] for parameter in names.decode().split()]

    def plain(self, name: str, parameters: list[float]) -> float:
        """Seconds for the plain law."""
        p = (ctypes.c_double * len(parameters))(*parameters)
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (self.velocities, self.forces["plain"])]
        return float(self.library.run_plain(name.encode(), p, *pointers, ctypes.c_long(self.n), ctypes.c_double(STEP)))

    def check(self, name: str) -> None:
        """The FMU and the plain law are the same law: their forces agree; the plain law rounds events to steps."""
        fmu, plain = self.forces["fmu"], self.forces["plain"]
        if name not in RANDOM and not np.allclose(fmu, plain, rtol=0.0, atol=1e-3 * np.abs(fmu).max()):
            worst = int(np.argmax(np.abs(fmu - plain)))
            raise SystemExit(f"{name}: the FMU gives {fmu[worst]} and the plain law {plain[worst]} in step {worst}")


def cvodes_seconds(name: str, start: dict[str, float], velocities: np.ndarray) -> float:
    """Seconds that CVODES takes for the same steps, with the tolerances that give the FMU's accuracy."""
    z, v = ca.SX.sym("z"), ca.SX.sym("v")
    p = start
    g = p["Fc"] + (p["Fs"] - p["Fc"]) * ca.exp(-((ca.fabs(v) / p["vs"]) ** p["delta"]))
    slip = p["sigma0"] * ca.fabs(v) / g * z
    if name == "ElastoPlastic":
        z_max, z_ba = g / p["sigma0"], p["z_ba"]
        blend = 0.5 + 0.5 * ca.sin(ca.pi * (ca.fabs(z) - 0.5 * (z_max + z_ba)) / (z_max - z_ba))
        alpha = ca.if_else(ca.fabs(z) <= z_ba, 0.0, ca.if_else(ca.fabs(z) >= z_max, 1.0, blend))
        slip = ca.if_else(z * v > 0.0, alpha, 0.0) * slip
    options = {"reltol": 1e-9, "abstol": 1e-14}
    solver = ca.integrator("solver", "cvodes", {"x": z, "p": v, "ode": v - slip}, 0.0, STEP, options)
    state, begin = 0.0, time.process_time()
    for velocity in velocities:
        state = solver(x0=state, p=velocity)["xf"]
    return time.process_time() - begin


def block_rows(block: Block, timer: Timer, folder: Path, rounds: int) -> list[Row]:
    """The rows of one block: its step, the plain law, and their ratio."""
    path = build(block.name, folder)
    description = fmpy.read_model_description(str(path))
    unzipped = Path(fmpy.extract(str(path), str(folder / block.name)))
    start = {v.name: float(v.start) for v in description.modelVariables if v.start and v.type in ("Real", "Integer")}
    parameters = timer.parameters(block.name, start)
    whole, without, plain = [], [], []
    for _ in range(rounds):
        for times, seconds in zip((whole, without), timer.fmu(unzipped, description), strict=True):
            times.append(seconds)
        if parameters is not None:
            plain.append(timer.plain(block.name, parameters))
    fmu = min(whole) - min(without)
    rows = [Row(f"{block.name}: fmi2DoStep", 1e9 * fmu / timer.n, "ns")]
    if plain:
        timer.check(block.name)
        target = 1.5 if block.name in SINGLE_STATE else None
        rows.append(Row(f"{block.name}: plain law", 1e9 * min(plain) / timer.n, "ns"))
        rows.append(
            Row(f"{block.name}: time of fmi2DoStep relative to a plain C function", fmu / min(plain), "x", target)
        )
    if block.name in ("LuGre", "ElastoPlastic"):
        few = timer.velocities[:: timer.n // 1000]
        ratio = (fmu / timer.n) / (cvodes_seconds(block.name, start, few) / len(few))
        rows.append(Row(f"{block.name}: fmi2DoStep / CVODES", ratio, "x", 0.1))
    return rows


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    rounds, n = (3, 5_000) if options.short else (15, 50_000)
    velocities = 5e-3 * np.sin(2.0 * math.pi * np.arange(n) * STEP)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as scratch:
        timer = Timer(Path(scratch), velocities)
        for block in catalogue().values():
            if block.kind == "friction":
                rows += block_rows(block, timer, Path(scratch), rounds)
    steps = {row.name: row.value for row in rows}
    rows.append(Row("GMS(10) / LuGre", steps["GMS: fmi2DoStep"] / steps["LuGre: fmi2DoStep"], "x", 4.0))
    report(f"Friction blocks, held v, h = {1e3 * STEP:g} ms", rows, options.json)


if __name__ == "__main__":
    main()
