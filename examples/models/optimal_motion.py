"""The motion with the least force needs the friction model

A force moves a mass of 1 kg by 0.3 m from rest to rest in 1 s; the integral of its square is to be minimal. Without
friction, this force falls linearly from 1.8 N to -1.8 N. On LuGre friction, it hardly moves the mass. The optimal force
with LuGre friction is higher and brakes less, because friction brakes too.

CasADi evaluates the model-exchange FMU of LuGre and gets its first derivatives from the FMU; the equations of the mass
are CasADi expressions. IPOPT solves the direct collocation and approximates second derivatives. The motions in the
figure are co-simulations of two FMUs with the resulting forces. With Coulomb and viscous friction, the optimal force is
a + b exp(d t/m), with a and b from the two conditions at the end.

Source: Waechter, Biegler, Mathematical Programming 106, 2006 (the method of IPOPT).
"""

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import fmpy
import numpy as np
from numpy.typing import NDArray

from _common import BLACK, BLUE, GREY, RED, command_line, panels, save, with_mass
from friction_fmus import fmu

Array = NDArray[np.float64]

M, TARGET, STOP = 1.0, 0.3, 1.0  # mass [kg], distance [m], time [s]
DEFLECTION = 1e-5  # scale of the bristle deflection [m]
FORCES, INTERVALS, DEGREE = 20, 60, 3  # intervals of the force, which is linear in each, and of the collocation
FC, VISCOUS = 1.0, 0.4  # start values of LuGre [N], [N s/m]
NODES = np.linspace(0.0, STOP, FORCES + 1)  # [s]
WITHOUT_FRICTION = 6.0 * M * TARGET / STOP**2 * (1.0 - 2.0 * NODES / STOP)  # [N]


def optimal_force() -> Array:
    """Return the optimal force at the nodes [N]."""
    with TemporaryDirectory() as folder:
        contact = ca.DaeBuilder("LuGre", str(fmpy.extract(str(fmu("LuGre")), folder)))
        # its forward derivatives are wrong for directions of zeros
        friction = contact.create("friction", ["x", "u"], ["ode", "y"], {"enable_forward": False})
        return _collocate(friction)


def _collocate(friction: ca.Function) -> Array:
    s = np.linspace(-1.0, 1.0, INTERVALS + 1)
    edges = 0.5 * STOP * (1.0 + np.sign(s) * (1.0 - (1.0 - np.abs(s)) ** 3))  # fine where it breaks away and stops
    h, points = np.diff(edges), ca.collocation_points(DEGREE, "radau")
    derivative, _, weights = ca.collocation_coeff(points)
    at = (edges[:-1, None] + h[:, None] * np.array(points)).ravel()
    hats = np.array([np.interp(at, NODES, unit) for unit in np.eye(NODES.size)])

    problem = ca.Opti()
    x = problem.variable(3, at.size + 1)  # position, speed, bristle deflection / DEFLECTION
    force = problem.variable(1, NODES.size)
    drive, inputs = force @ hats, ca.vertcat(x[1, 1:], np.ones((1, at.size)))  # speed and normal force of the contact
    slope, F = friction.map(at.size)(x[2, 1:] * DEFLECTION, inputs)
    rates = ca.vertcat(x[1, 1:], (drive - F) / M, slope / DEFLECTION)
    for k in range(INTERVALS):
        own = slice(DEGREE * k, DEGREE * (k + 1))
        problem.subject_to(ca.vec(x[:, own.start : own.stop + 1] @ derivative - h[k] * rates[:, own]) == 0)
    problem.subject_to(x[:, 0] == 0)
    problem.subject_to(x[:2, -1] == [TARGET, 0.0])
    problem.minimize(drive**2 @ np.outer(h, weights.full()).ravel())

    r = np.concatenate([[0.0], at]) / STOP  # the search starts at the motion without friction, in steady sliding
    problem.set_initial(x[0, :], TARGET * (3.0 - 2.0 * r) * r**2)
    problem.set_initial(x[1, :], 6.0 * TARGET / STOP * r * (1.0 - r))
    problem.set_initial(x[2, 1:], 1.0)
    problem.set_initial(force, FC + WITHOUT_FRICTION)
    options: dict[str, Any] = {"hessian_approximation": "limited-memory", "tol": 1e-8, "print_level": 0, "sb": "yes"}
    problem.solver("ipopt", {"print_time": False}, options)
    return np.asarray(problem.solve().value(force))


def closed_form() -> Array:
    """Return the optimal force on Coulomb and viscous friction at the nodes [N]."""
    rate = VISCOUS / M
    lag = 1.0 - np.exp(-rate * STOP)
    # v(STOP) = 0 and x(STOP) = TARGET of M dv/dt = a + b exp(rate t) - FC - VISCOUS v, x = (impulse - M v) / VISCOUS
    speed = [lag / VISCOUS, np.sinh(rate * STOP) / VISCOUS]
    impulse = [STOP, np.expm1(rate * STOP) / rate]
    a, b = np.linalg.solve([speed, impulse], [FC * speed[0], FC * STOP + VISCOUS * TARGET])
    return np.asarray(a + b * np.exp(rate * NODES))


def main(folder: Path) -> str:
    """Draw both forces and motions, check the end of the motion and the force against the closed form."""
    optimal = optimal_force()
    figure, (force, position) = panels("The motion with the least force needs the friction model", 2, 1, (8.0, 5.0))
    end = {}
    for name, colour, nodes in (("without friction", BLUE, WITHOUT_FRICTION), ("with LuGre", RED, optimal)):
        push = partial(np.interp, xp=NODES, fp=nodes, left=0.0, right=0.0)
        result = with_mass("LuGre", STOP + 0.1, 1e-4, push=push)
        force.plot([*NODES, STOP, STOP + 0.1], [*nodes, 0.0, 0.0], color=colour, lw=1.4, label=f"optimal {name}")
        position.plot(result["time"], 1e3 * result["mass.x"], color=colour, lw=1.4)
        end[name] = float(result["mass.x"][-1])
    force.plot(NODES, closed_form(), color=BLACK, lw=1.2, ls=":", label="optimal with Coulomb and viscous friction")
    position.axhline(1e3 * TARGET, color=GREY, ls="--", lw=1.2, label="target")
    force.set(ylabel="force [N]")
    position.set(ylabel="position on LuGre [mm]", xlabel="time [s]")
    force.legend(loc="upper right", fontsize=9)
    position.legend(loc="center left", fontsize=9)
    save(figure, __file__, folder)

    # it soon falls below the Coulomb force of 1 N, and in the end it exceeds the static friction of 1.5 N backwards
    assert end["without friction"] < 0.1 * TARGET
    # the motion of the collocation is the co-simulated one
    assert abs(end["with LuGre"] - TARGET) < 1e-4
    sliding = NODES >= 0.2  # far above the Stribeck velocity of 1 mm/s
    other = float(np.abs(optimal - closed_form())[sliding].max())
    assert other < 0.01
    return (
        f"The optimal force without friction moves the mass by {1e3 * end['without friction']:.0f} mm, with LuGre by "
        f"{1e3 * end['with LuGre']:.1f} mm. After 0.2 s, the latter force differs by less than 0.01 N from the "
        f"optimal force with Coulomb and viscous friction."
    )


if __name__ == "__main__":
    command_line(main)
