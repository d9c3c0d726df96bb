"""Conditions on the communication step of a co-simulation: stiff contacts, sample times and delayed outputs."""

import math

from friction_fmus.conditions.condition import Condition, at_most, below, compared
from harness.masters import find_master


def longest_step(master: str, m: float, s0: float, c: float) -> float:
    """Return the communication step above which an explicit master makes a mass on a stuck contact unstable.

    The mass is solved exactly for a held force, the contact F = s0 z + c v for a held velocity. The coupled system has
    the characteristic equation

        gauss-seidel:  (l - 1)^2   + H c/m (l - 1) + H^2 s0/m l = 0,  H < (sqrt(c^2 + 4 m s0) - c)/s0
        jacobi:        (l - 1)^2 l + H c/m (l - 1) + H^2 s0/m l = 0,  H < c/(s0 + c^2/m)

    and below the bound on the right all l are within the unit circle (Jury).

    Parameters
    ----------
    master : str
        Name of the master, without extrapolation; the result is infinite if it is implicit.
    m, s0, c : float
        Mass [kg], stiffness [N/m] and damping [N.s/m] of the contact; for LuGre, c = sigma1 + sigma2.

    Returns
    -------
    float
        Communication step [s].
    """
    traits = find_master(master)
    if traits.implicit:
        return math.inf
    return c / (s0 + c**2 / m) if traits.together else 4.0 * m / (math.sqrt(c**2 + 4.0 * m * s0) + c)


def contact_step(master: str, step: float, m: float, s0: float, c: float) -> Condition:
    """Check that the communication step of a mass and a stuck contact is below `longest_step`.

    Parameters
    ----------
    master : str
        Master algorithm.
    step : float
        Communication step [s].
    m, s0, c : float
        Mass [kg], stiffness [N/m] and damping [N.s/m] of the contact.

    Returns
    -------
    Condition
        Its value is the step, its bound the longest stable step [s].
    """
    bound = longest_step(master, m, s0, c)
    shorter = f", or a step well below {bound:.4g} s" if bound > 0.0 else ""
    return Condition(
        "contact stiffness",
        *compared(below, step, bound),
        wrong=f"the communication step is {step:.4g} s; {master} is stable below {bound:.4g} s for {m:.4g} {{kg}} on a "
        f"contact of {s0:.4g} {{N_m}} and {c:.4g} {{Ns_m}}",
        why="{mass} and contact exchange held values: at rest the coupling oscillates, limited only by sliding; the "
        "result may look smooth and still be wrong",
        change=f"use the master newton{shorter}",
        source="Kuebler, Schiehlen, Math. Comput. Modelling Dyn. Syst. 6(2), 2000 (co-simulation of loops); bounds "
        "derived here",
    )


def sample_step(Ts: float, step: float) -> Condition:
    """Check that a sampled part samples at communication points: Ts is an integer multiple of the step.

    Parameters
    ----------
    Ts : float
        Sample time [s].
    step : float
        Time between two communication points of that part [s].

    Returns
    -------
    Condition
        Its value is Ts, its bound the step [s].
    """
    ratio = min(Ts / step, 1e15)  # larger doubles have no fractional part
    whole = max(round(ratio), 1)
    if ratio < 1.0 - 1e-9:
        why = "several samples fall into one step, and all of them use the inputs at its start"
    else:
        why = "samples within a step use the inputs at its start: the delay varies from sample to sample"
    return Condition(
        name="sample time",
        ok=abs(ratio - whole) <= 1e-9 * whole,
        value=Ts,
        bound=step,
        wrong=f"Ts = {Ts:.6g} s is not an integer multiple of the communication step, {step:.6g} s",
        why=why,
        change=f"use a communication step of {Ts / max(math.ceil(ratio - 1e-9), 1):.6g} s",
        source="sampling of this library's laws, docs/harness.md",
    )


def output_delay(late: float, Ts: float, source: str, target: str) -> Condition:
    """Check that the output of a sampled part reaches the next part within the same step, or within Ts/10.

    Parameters
    ----------
    late : float
        Delay of the output [s].
    Ts : float
        Sample time [s].
    source, target : str
        Names of the two parts, for the text.

    Returns
    -------
    Condition
        Its value is the delay, its bound Ts/10 [s].
    """
    return Condition(
        "stepping order",
        *compared(at_most, late, 0.1 * Ts),
        wrong=f"{target} is stepped before {source} and uses an output that is {late:.4g} s old",
        why="the zero-order hold delays the output by Ts/2, the stepping order adds a whole step; with the step Ts the "
        "residual of an exact feedforward is three times as large, and a feedback loop loses phase",
        change="use gauss-seidel, newton or adaptive with the default stepping order (sampled parts, then plants), or "
        f"a step well below Ts = {Ts:.4g} s",
        source="zero-order hold: Ts/2 becomes 3 Ts/2; Astrom, Wittenmark: Computer-Controlled Systems, 1997",
    )
