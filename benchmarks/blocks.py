"""Time per fmi2DoStep of every friction model, beside the same law as a plain C loop compiled with the same flags.

Held velocities along a sinusoid through presliding and sliding, h = 0.1 ms. The FMU and the loop run in turn, in one
process; the minimum over the rounds counts. ``casadi.integrator('cvodes')`` solves LuGre and ElastoPlastic at the
accuracy of the FMU over the same steps.
"""

from __future__ import annotations

import ctypes
import math
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from rows import Row, arguments, report

from friction_fmus import build, catalogue
from harness.toolchain import FLAGS, compiler, header_folder

STEP = 1e-4
PLAIN_TARGET = {"Coulomb": None, "Stribeck": None, "MaxwellSlip": None, "GMS": None}
"""Plain loops without the target of 1.5: no state, or ten of them (GMS has its own)."""

PARAMETERS = {
    "Coulomb": ("Fc",),
    "Stribeck": ("Fc", "Fs", "vs", "delta", "Fv"),
    "Dahl": ("sigma", "Fc", "n"),
    "LuGre": ("Fc", "Fs", "vs", "delta", "sigma0", "sigma1", "sigma2"),
    "BlimanSorine": ("f1", "f2", "eta", "eps"),
    "ResetIntegrator": ("sigma0", "z0", "a", "beta"),
    "MaxwellSlip": ("N", *(f"k[{i}]" for i in range(1, 11)), *(f"W[{i}]" for i in range(1, 11))),
    "GMS": (
        *("Fc", "Fs", "vs", "delta", "C", "sigma2", "N"),
        *(f"k[{i}]" for i in range(1, 11)),
        *(f"alpha[{i}]" for i in range(1, 11)),
    ),
}
"""Parameters of the plain loops in loops.c, in their order."""


def compiled(folder: Path) -> ctypes.CDLL:
    """loops.c, with the flags of the FMUs."""
    target = folder / "loops.so"
    flags = [flag for flag in FLAGS if not flag.startswith("-W") and flag != "-std=c99"]
    source = Path(__file__).parent / "loops.c"
    subprocess.run(
        [
            *(*compiler(), "-std=gnu99", *flags, "-fvisibility=default", "-I", str(header_folder()), str(source)),
            *("-o", str(target), "-shared", "-lm", "-ldl"),
        ],
        check=True,
    )
    library = ctypes.CDLL(str(target))
    library.run_plain.restype = ctypes.c_double
    library.run_fmu.restype = ctypes.c_bool
    return library


class Timer:
    """Runs an FMU or a plain loop over the velocities."""

    def __init__(self, library: ctypes.CDLL, velocities: np.ndarray) -> None:
        """Keep the loops and the velocities."""
        self.library = library
        self.n = len(velocities)
        self.v = velocities.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    def fmu(self, folder: str, description: Any) -> float:
        """Seconds for all fmi2DoStep of the FMU."""
        references = {v.name: v.valueReference for v in description.modelVariables}
        name = description.coSimulation.modelIdentifier
        path = Path(folder) / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"
        total = (ctypes.c_double * 2)()
        guid = description.guid.encode()
        vr, step = (ctypes.c_uint(references["v"]), ctypes.c_uint(references["F"])), ctypes.c_double(STEP)
        if not self.library.run_fmu(str(path).encode(), guid, *vr, self.v, ctypes.c_long(self.n), step, total):
            raise SystemExit(f"{name} does not run through")
        return total[1]

    def plain(self, name: str, parameters: list[float]) -> float:
        """Seconds for the plain loop."""
        p, total = (ctypes.c_double * len(parameters))(*parameters), ctypes.c_double()
        step = ctypes.c_double(STEP)
        return float(self.library.run_plain(name.encode(), p, self.v, ctypes.c_long(self.n), step, ctypes.byref(total)))


def cvodes_seconds(name: str, start: dict[str, float], velocities: np.ndarray) -> float:
    """Seconds that CVODES takes for the same steps, with the tolerances that give the FMU's accuracy."""
    import casadi as ca

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
    import time

    state, begin = 0.0, time.perf_counter()
    for velocity in velocities:
        state = solver(x0=state, p=velocity)["xf"]
    return time.perf_counter() - begin


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    rounds, n = (3, 20_000) if options.short else (9, 100_000)
    velocities = 5e-3 * np.sin(2.0 * math.pi * np.arange(n) * STEP)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as scratch:
        timer = Timer(compiled(Path(scratch)), velocities)
        for block in catalogue().values():
            if block.kind != "friction":
                continue
            path = build(block.name, Path(scratch))
            description = fmpy.read_model_description(str(path))
            names = {v.name: v for v in description.modelVariables}
            if not {"v", "F"} <= names.keys() or names["v"].causality != "input":
                continue
            folder = fmpy.extract(str(path), str(Path(scratch) / block.name))
            start = {name: float(v.start) for name, v in names.items() if v.start and v.type in ("Real", "Integer")}
            parameters = [start[name] for name in PARAMETERS.get(block.name, ())]
            fmu, plain = [], []
            for _ in range(rounds):
                fmu.append(timer.fmu(folder, description))
                if parameters:
                    plain.append(timer.plain(block.name, parameters))
            rows.append(Row(f"{block.name}: fmi2DoStep", 1e9 * min(fmu) / n, "ns"))
            if plain:
                rows.append(Row(f"{block.name}: plain loop", 1e9 * min(plain) / n, "ns"))
                target = PLAIN_TARGET.get(block.name, 1.5)
                rows.append(Row(f"{block.name}: fmi2DoStep over plain loop", min(fmu) / min(plain), "x", target))
            if block.name in ("LuGre", "ElastoPlastic"):
                few = velocities[:: n // 1000]
                ratio = (min(fmu) / n) / (cvodes_seconds(block.name, start, few) / len(few))
                rows.append(Row(f"{block.name}: fmi2DoStep over CVODES", ratio, "x", 0.1))
    steps = {row.name: row.value for row in rows}
    if {"GMS: fmi2DoStep", "LuGre: fmi2DoStep"} <= steps.keys():
        rows.append(Row("GMS(10) over LuGre", steps["GMS: fmi2DoStep"] / steps["LuGre: fmi2DoStep"], "x", 4.0))
    report(f"Friction blocks, held v, h = {1e3 * STEP:g} ms", rows, options.json)


if __name__ == "__main__":
    main()
