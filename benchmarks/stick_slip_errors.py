"""Stick-slip of a mass on LuGre friction: errors of the masters and of MuJoCo against a tight reference.

1 kg, pulled by a spring of 2 N/m whose end moves at 0.1 m/s: figure 6 of Canudas de Wit, Olsson, Astrom, Lischinsky,
IEEE TAC 40(3), 1995, with its parameters.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from benchmarks.pairs import Values
from benchmarks.peers import importable
from benchmarks.rows import Row
from friction_fmus import build
from harness import FmuPart, System

PERIOD = 6.36271982  # [s], by scipy's LSODA at 1e-12, as tests/models/test_benchmarks.py computes it
STOP = 34.0  # [s], five slips
PULL, SPRING = 0.1, 2.0  # [m/s], [N/m]
LUGRE = {"sigma0": 1e5, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3}
WIRES = ("mass.v -> friction.v", "friction.F -> mass.F_friction")

MUJOCO = f"""
<mujoco>
  <option timestep="{{step}}" integrator="{{integrator}}" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="x" type="slide" axis="1 0 0" stiffness="{SPRING}"/>
      <geom size="0.1" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <dcmotor joint="x" motorconst="0" resistance="1" input="none" damping="{LUGRE["sigma2"]}"
      lugre="{LUGRE["sigma0"]} {LUGRE["sigma1"]} {LUGRE["Fc"]} {LUGRE["Fs"]} {LUGRE["vs"]}"/>
  </actuator>
</mujoco>
"""


def stick_slip(folder: Path, stiffness: float = LUGRE["sigma0"]) -> System:
    """The system, with sigma1 = sqrt(sigma0)."""
    contact = LUGRE | {"sigma0": stiffness, "sigma1": math.sqrt(stiffness)}
    start = {"mass.F_drive": 0.0, "mass.k": SPRING, "mass.v_support": PULL}
    start |= {f"friction.{name}": value for name, value in contact.items()}
    parts = [FmuPart("mass", build("Mass", folder)), FmuPart("friction", build("LuGre", folder))]
    return System(parts, WIRES, start)


def period_error(t: Values, v: Values) -> float:
    """Relative error of the mean period between the slips, which are where v rises through half of the pull's speed."""
    level = 0.5 * PULL
    slips = []
    for k in np.flatnonzero((v[:-1] < level) & (v[1:] >= level)):
        around = slice(k - 1, k + 3)
        roots = CubicSpline(t[around], v[around] - level).roots(extrapolate=False)
        slips.append(roots[(roots >= t[k]) & (roots <= t[k + 1])][0])
    return float(np.mean(np.diff(slips))) / PERIOD - 1.0


def run_period(system: System, steps: int, master: str) -> tuple[float, int]:
    """Error of the period, and calls of fmi2DoStep, roll-backs counted."""
    result = system.run(stop=STOP, step=STOP / steps, master=master, record=["mass.v"])
    evaluations = int(result.attrs.get("evaluations", steps))
    return period_error(result["time"].to_numpy(), result["mass.v"].to_numpy()), len(system.parts) * evaluations


def calls_for(system: System, master: str, error: float, order: float) -> int:
    """Calls of fmi2DoStep with the longest steps, to 1 %, whose period has this error or less."""
    steps = round(STOP / 1e-3)
    reached, calls = run_period(system, steps, master)
    if abs(reached) > error:
        steps = round(0.97 * steps * (abs(reached) / error) ** (1.0 / order))
        reached, calls = run_period(system, steps, master)
    while abs(reached) > error:
        steps = round(1.01 * steps)
        reached, calls = run_period(system, steps, master)
    return calls


def reference(stiffness: float, t: Values) -> Values:
    """x at the times t, by scipy as one system; sigma0 z is the third state, as z would be of another size."""
    damping = math.sqrt(stiffness)

    def level(v: float) -> float:
        return LUGRE["Fc"] + (LUGRE["Fs"] - LUGRE["Fc"]) * math.exp(-((v / LUGRE["vs"]) ** 2))

    def rate(time: float, y: Values) -> list[float]:
        x, v, bristles = y
        slip = v - abs(v) * bristles / level(v)
        force = bristles + damping * slip + LUGRE["sigma2"] * v
        return [v, SPRING * (PULL * time - x) - force, stiffness * slip]

    solution = solve_ivp(rate, (0.0, t[-1]), np.zeros(3), "Radau", t, rtol=1e-10, atol=[1e-15, 1e-14, 1e-12])
    assert solution.success, solution.message
    return np.asarray(solution.y[0])


def mujoco_error(step: float, integrator: str) -> float:
    """Error of the period with MuJoCo's own LuGre friction, a purely passive DC motor on a sliding joint.

    The joint's spring ends at x = 0; what the moving end adds is a force on the joint, its mean over each step.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(MUJOCO.format(step=step, integrator=integrator))
    data = mujoco.MjData(model)
    v = np.zeros(round(STOP / step) + 1)
    for k in range(1, len(v)):
        data.qfrc_applied[0] = SPRING * PULL * (k - 0.5) * step
        mujoco.mj_step(model, data)
        v[k] = data.qvel[0]
    return period_error(step * np.arange(len(v)), v)


@contextmanager
def warnings_of(logger: str) -> Iterator[list[str]]:
    """The warnings of a logger."""
    seen: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            seen.append(record.getMessage())

    listener = Listener(logging.WARNING)
    logging.getLogger(logger).addHandler(listener)
    try:
        yield seen
    finally:
        logging.getLogger(logger).removeHandler(listener)


def period_rows(folder: Path) -> list[Row]:
    """Period of the published contact."""
    with stick_slip(folder) as system:
        newton = {step: abs(run_period(system, round(STOP / step), "newton")[0]) for step in (5e-4, 1e-3, 2e-3, 5e-3)}
        held, _ = run_period(system, round(STOP / 1e-3), "gauss-seidel")
        few, many = calls_for(system, "newton", 1e-5, 2.0), calls_for(system, "gauss-seidel", 1e-5, 1.0)
    order = math.log(newton[2e-3] / newton[5e-4]) / math.log(
        4.0
    )  # at 3 ms or more, step checks divide some of the steps
    rows = [
        Row("Stick-slip: error of the period at 1 ms, newton", 100.0 * newton[1e-3], "%", 0.003),
        Row("Stick-slip: error of the period at 5 ms, newton", 100.0 * newton[5e-3], "%", 0.06),
        Row("Stick-slip: order of newton (0.5 to 2 ms), away from 2", abs(order - 2.0), "", 0.1),
        Row("Stick-slip: error of the period at 1 ms, gauss-seidel", 100.0 * abs(held), "%"),
        Row("Stick-slip: fmi2DoStep calls for 0.001 %, newton / gauss-seidel", few / many, "x", 0.2),
    ]
    if importable("mujoco"):
        for integrator, note in (("Euler", "its default"), ("RK4", "four evaluations a step")):
            error = abs(mujoco_error(1e-3, integrator))
            rows.append(Row(f"Stick-slip: error of the period at 1 ms, MuJoCo {integrator}", 100.0 * error, "%"))
            name = f"Stick-slip: error of the period at 1 ms, newton / MuJoCo {integrator} ({note})"
            rows.append(Row(name, newton[1e-3] / error, "x", 0.1))
    return rows


def stiff_rows(folder: Path) -> list[Row]:
    """Position on stiffer contacts, at 1 ms over 20 s.

    Raises
    ------
    SystemExit
        If Gauss-Seidel does not warn of the wire that it gets wrong.
    """
    rows = []
    for stiffness, target in ((1e7, 1e-4), (1e8, 1e-3)):
        with stick_slip(folder, stiffness) as system, warnings_of("harness") as warnings:
            results = [
                system.run(stop=20.0, step=1e-3, master=master, record=["mass.x"])
                for master in ("newton", "gauss-seidel")
            ]
        exact = reference(stiffness, results[0]["time"].to_numpy())
        worst = [float(np.abs(result["mass.x"].to_numpy() - exact).max()) for result in results]
        if not (len(warnings) == 1 and warnings[0].startswith("friction.F -> mass.F_friction")):
            raise SystemExit(f"Gauss-Seidel is wrong by {worst[1]:.2g} m and warns: {warnings}")
        where = f"Stick-slip, sigma0 = {1e-6 * stiffness:g} N/µm: error of x at 1 ms"
        rows += [
            Row(f"{where}, newton", worst[0], "m", target),
            Row(f"{where}, gauss-seidel, warned of", worst[1], "m"),
        ]
    return rows
