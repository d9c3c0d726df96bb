"""casadi's DaeBuilder, which integrates model exchange by its CVODES."""

from __future__ import annotations

import os
import shutil
import tempfile
import zipfile
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import casadi as ca
import numpy as np
from adapter import AdaptedCase, Rows, UnsupportedError, main

LACKS = ("call", "cs", "ssp")


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    folder = Path(tempfile.mkdtemp(prefix="casadi"))
    with tempfile.TemporaryFile("w+") as said:
        before = os.dup(2)
        os.dup2(said.fileno(), 2)
        try:
            rows = list(integrated(case, folder))
        finally:
            os.dup2(before, 2)
            shutil.rmtree(folder)
        said.seek(0)
        if "not implemented" in said.read():
            raise UnsupportedError("it warns that next event times are not implemented")
    return rows


def integrated(case: AdaptedCase, folder: Path) -> Rows:
    """Integrate from node to node."""
    with zipfile.ZipFile(case.file) as archive:
        archive.extractall(folder)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    if root.get("numberOfEventIndicators", "0") != "0" or root.find("ModelStructure/EventIndicator") is not None:
        raise UnsupportedError("it has no events")
    dae = ca.DaeBuilder("fmu", str(folder), {"debug": False})
    kinds = case.types()
    for name, value in case.values.items():
        if isinstance(value, list) or kinds[name] == "String":
            raise UnsupportedError("its interface sets numbers only")
        dae.set(name, float(value))
    inputs = case.inputs()
    if inputs.held:
        raise UnsupportedError("inputs of its integrator are real numbers")
    chosen = [name for name in dae.y() if name in case.outputs]
    for name in case.outputs:
        if name not in chosen and name not in dae.x():
            raise UnsupportedError(f"{name} is no state and no output of type Real")
    x, u = list(dae.x()), list(dae.u())
    times = case.times()
    nodes = sorted({*times, *(t for t in inputs.kinks() if times[0] < t < times[-1])})
    f = dae.create("f", ["t", "x", "u"], ["ode", "y"], {"enable_fd": True, "enable_forward": False})
    start = ca.vertcat(*(float(np.array(dae.get(name)).item()) for name in u)) if u else ca.DM.zeros(0)
    given = [name for name in u if name in inputs.columns]
    X, U0, U1, A, B = (
        ca.MX.sym("x", len(x)),
        ca.MX.sym("a", len(u)),
        ca.MX.sym("b", len(u)),
        ca.MX.sym("A"),
        ca.MX.sym("B"),
    )
    s = ca.MX.sym("s")
    t = A + s * (B - A)
    ode = f(t, X, U0 + s * (U1 - U0))[0] * (B - A)
    problem = {"t": s, "x": X, "p": ca.vertcat(A, B, U0, U1), "ode": ode}
    options = {"reltol": 1e-10, "abstol": 1e-12, "max_num_steps": 100000}
    integrate = ca.integrator("integrate", "cvodes", problem, 0.0, 1.0, options) if x else None

    def at(t: float, left: bool) -> ca.DM:
        values = inputs.at(t, left=left)
        return ca.vertcat(*(values[name] if name in given else start[i] for i, name in enumerate(u)))

    state = ca.DM([float(np.array(dae.start(name)).item()) for name in x])

    def row(t: float) -> list[float]:
        y = f(t, state, at(t, True))[1]
        everything = dict(zip(dae.y(), np.array(y).ravel(), strict=True))
        everything |= dict(zip(x, np.array(state).ravel(), strict=True))
        return [t, *(float(everything[name]) for name in case.outputs)]

    yield row(times[0])
    for a, b in pairwise(nodes):
        if integrate is not None:
            state = integrate(x0=state, p=ca.vertcat(a, b, at(a, False), at(b, True)))["xf"]
        if b in times:
            yield row(b)


if __name__ == "__main__":
    main(run, LACKS, lambda: str(ca.__version__))
