"""Conditions of co-simulation: how long a communication step a stiff contact and sampled laws stand."""

from __future__ import annotations

import math

from friction_fmus.conditions.condition import Condition, at_most, below

_EXPLICIT = ("gauss-seidel", "jacobi")


def longest_step(master: str, m: float, s0: float, c: float) -> float:
    """The communication step above which an explicit master makes a mass on a stuck contact unstable [s].

    The mass is exact for a held force, the contact for a held velocity, F = s0 z + c v. Their coupling gives

        gauss-seidel:  (l - 1)^2   + H c/m (l - 1) + H^2 s0/m l = 0,  H < (sqrt(c^2 + 4 m s0) - c)/s0
        jacobi:        (l - 1)^2 l + H c/m (l - 1) + H^2 s0/m l = 0,  H < c/(s0 + c^2/m)

    and the bounds are those for which all l are within the unit circle (Jury).

    Parameters
    ----------
    master : str
        ``gauss-seidel`` or ``jacobi`` without extrapolation; others have no limit of this kind: infinity.
    m, s0, c : float
        Mass [kg], stiffness [N/m] and damping [N.s/m] of the contact; of LuGre c = sigma1 + sigma2.
    """
    if master not in _EXPLICIT:
        return math.inf
    return 4.0 * m / (math.sqrt(c**2 + 4.0 * m * s0) + c) if master == "gauss-seidel" else c / (s0 + c**2 / m)


def contact_step(master: str, step: float, m: float, s0: float, c: float) -> Condition:
    """The communication step of a mass and a stuck contact, against `longest_step`.

    Parameters
    ----------
    master, m, s0, c : str, float
        As in `longest_step`.
    step : float
        Communication step [s].
    """
    bound = longest_step(master, m, s0, c)
    shorter = f", or a step well below {bound:.4g} s" if bound > 0.0 else ""
    return Condition(
        name="contact stiffness",
        ok=below(step, bound),
        value=step,
        bound=bound,
        wrong=f"the communication step is {step:.4g} s; {master} is stable below {bound:.4g} s for {m:.4g} kg on a "
        f"contact of {s0:.4g} N/m and {c:.4g} N.s/m",
        why="mass and contact exchange held values: at rest they shake each other, bounded by sliding, and the result "
        "may look smooth and be wrong",
        change=f"use the master newton{shorter}",
        source="Kuebler, Schiehlen, Math. Comput. Modelling Dyn. Syst. 6(2), 2000 (co-simulation of loops); the bounds "
        "derived here",
    )


def sample_step(Ts: float, step: float) -> Condition:
    """A sampled part takes its samples at the ends of communication steps: Ts is a whole multiple of the step.

    Parameters
    ----------
    Ts : float
        Sample time [s].
    step : float
        Time between two communications of that part [s].
    """
    ratio = min(Ts / step, 1e15)  # beyond that doubles know no fractions
    whole = max(round(ratio), 1)
    if ratio < 1.0 - 1e-9:
        why = "several samples fall into one step and all read the inputs of its beginning"
    else:
        why = "samples fall into a step and read the inputs of its beginning: the delay changes from sample to sample"
    return Condition(
        name="sample time",
        ok=abs(ratio - whole) <= 1e-9 * whole,
        value=Ts,
        bound=step,
        wrong=f"Ts = {Ts:.6g} s is no whole multiple of the communication step, {step:.6g} s",
        why=why,
        change=f"use a communication step of {Ts / max(math.ceil(ratio - 1e-9), 1):.6g} s",
        source="sampling of this library's laws, docs/harness.md",
    )


def fresh(late: float, Ts: float, source: str, target: str) -> Condition:
    """What a sampled part computes reaches the next part in the same step, or after a tenth of its sample time.

    Parameters
    ----------
    late : float
        How much later it arrives [s].
    Ts : float
        Sample time [s].
    source, target : str
        The two ends, for the text.
    """
    return Condition(
        name="stepping order",
        ok=at_most(late, 0.1 * Ts),
        value=late,
        bound=0.1 * Ts,
        wrong=f"{target} takes its step before it has the new output of {source}: it gets one that is {late:.4g} s old",
        why="the hold of a sample delays by half of Ts, this adds a whole step; with the step Ts the residual of an "
        "exact feedforward is three times as large, and a feedback loop loses phase",
        change="use gauss-seidel, newton or adaptive with the stepping order that the harness finds: sampled parts, "
        f"then plants; or a step well below Ts = {Ts:.4g} s",
        source="zero-order hold: Ts/2 becomes 3 Ts/2; Astrom, Wittenmark: Computer-Controlled Systems, 1997",
    )
