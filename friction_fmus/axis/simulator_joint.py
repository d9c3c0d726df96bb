"""A joint of a simulator with the friction of an identified axis: its parameters, and how its motion differs."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from math import ceil, inf, pi
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from scipy.optimize import nnls

from friction_fmus.axis.servo import AxisPlant
from friction_fmus.axis.servo_loop import COARSER, free_axis, quiet_runs, run_free
from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import BuildError
from friction_fmus.export.axis_fit import AxisFit, rms
from friction_fmus.export.block_fmu import fmu
from friction_fmus.export.identified_axis import Array
from friction_fmus.export.targets import write_file
from friction_fmus.listings import shown
from harness import ExperimentError

if TYPE_CHECKING:
    from friction_fmus.blocks.contact import AxisFriction
    from friction_fmus.export.identified_axis import IdentifiedAxis

#: Function of time and force, shape (n,), held within a step, that returns position and velocity, shape (n,).
Simulator: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]

STEP: Final = 1e-3  # time step of a joint whose friction does not need a shorter one [s]
MOVING: Final = 0.01  # part of the largest speed of the record above which an axis counts as broken away


def contact_of(axis: IdentifiedAxis) -> AxisFriction:
    """Return the friction of an axis that can be a joint, as the file of its block states it."""
    u, declared = axis.words, find(axis.model).about.friction
    if not 0.0 < axis.mass < inf:
        raise BuildError(
            f"The joint of a simulator needs a positive {u.mass}, but that of {axis.name} is {axis.mass:g} {u.kg}; "
            f"identify the axis from a record with position and drive {u.force}."
        )
    if declared is None or axis.parameters.get("shape"):
        raise BuildError(f"{axis.label} states no exponential Stribeck curve; choose another model with --model.")
    return declared.contact(axis.parameters)


def coulomb_law(axis: IdentifiedAxis) -> AxisPlant:
    """Return Coulomb and viscous friction with the least error of the sliding force over the speeds of the motion."""
    contact, v = contact_of(axis), np.abs(AxisFit(axis).motion.rd)
    v = v[v > 0.0]
    sliding = 0.5 * sum(level.at(v) + level.viscous * v for level in contact.levels) + axis.viscous * v
    (Fc, fastest), _ = nnls(np.column_stack([np.ones_like(v), v / np.max(v)]), sliding)
    return AxisPlant("Stribeck", {"Fc": float(Fc), "Fs": float(Fc), "Fv": float(fastest / np.max(v))}, axis.mass)


def stribeck_law(axis: IdentifiedAxis) -> AxisPlant:
    """Return the Stribeck curve of the axis, the mean of both directions."""
    one, two = contact_of(axis).levels
    mean = {name: 0.5 * (getattr(one, name) + getattr(two, name)) for name in ("Fc", "Fs", "delta")}
    # static friction that acts at rest only falls at a speed that no record resolves
    mean["vs"] = 0.5 * ((one.vs or 0.0) + (two.vs or 0.0)) or 1e-3 * axis.speed
    return AxisPlant("Stribeck", {**mean, "Fv": 0.5 * (one.viscous + two.viscous) + axis.viscous}, axis.mass)


def lost(axis: IdentifiedAxis, kept: Collection[str]) -> list[str]:
    """Return which properties of the axis a joint lacks; `kept` are keys of the rows below, or names of terms."""
    u, contact = axis.words, contact_of(axis)
    one, two = contact.levels
    terms = ", ".join(f"{name} = {value:.4g}" for name, value in axis.terms.items() if name not in kept)
    rows = {
        "static": one.Fs != one.Fc and f"{one.Fs:.4g} {u.N} at rest instead of {one.Fc:.4g} {u.N}",
        "presliding": contact.stiffness and f"presliding with a stiffness of {contact.stiffness:.4g} {u.N_m}",
        "directions": one != two and "different friction in both directions, of which this is the mean",
        "terms": terms and f"what acts beside the friction model: {terms}",
        "offset": axis.offset and f"the constant {u.force} {axis.offset:.4g} {u.N}; add it to that of the drive",
        "position": axis.position is not None and f"{u.force} over position",
    }
    return [f"- {text}" for name, text in rows.items() if text and name not in kept]


def simulator(law: AxisPlant, rotary: bool) -> Simulator:
    """Return a simulator with the blocks of this library."""
    contact = fmu(law.friction, domain_of(rotary))

    def run(t: Array, force: Array) -> tuple[Array, Array]:
        system = free_axis(law, t, force, 0.0 * t, rotary=rotary, contact=contact, longest=COARSER)
        with quiet_runs(), system:
            return run_free(system, {}, 0.0, float(t[-1]))

    return run


def equivalence(axis: IdentifiedAxis, joint: Simulator, step: float = STEP) -> tuple[float, float, Array]:
    """Return travel and rms difference under a sine of force [m], and, for axis and joint, the largest friction before
    sliding [N] and the mean speed under 90 % of it [m/s], shape (2, 2); without offset and force over position."""
    p = {name: value for name, value in axis.parameters.items() if name != "Fn0"}  # Fn and Fn0 are 1 N here
    own = simulator(AxisPlant(axis.model, {"Fv": axis.viscous, **p}, axis.mass), axis.rotary)
    largest = float(np.max(np.abs(AxisFit(axis).friction)))
    # a sine of twice the friction reaches about the largest speed of the record
    w = float(np.clip(largest / (axis.mass * axis.speed), 1.0, 0.1 / step))
    t = step * np.arange(ceil(4.0 * pi / w / step) + 1.0)
    x, other = (run(t, 2.0 * largest * np.sin(w * t))[0] for run in (own, joint))
    return float(np.ptp(x)), rms(other - x), np.array([_rest(run, axis, largest, step) for run in (own, joint)])


def _rest(run: Simulator, axis: IdentifiedAxis, largest: float, step: float) -> tuple[float, float]:
    """Return the break-away force on a ramp to twice the largest friction, and the creep speed."""
    t = step * np.arange(ceil(3.0 / step) + 1.0)
    force, half = 2.0 * largest * t / t[-1], len(t) // 2
    v = run(t, force)[1]
    moving = int(np.argmax(np.abs(v) > MOVING * axis.speed)) or None
    level = float(np.max((force[:-1] - axis.mass * np.diff(v) / step)[:moving]))
    x = run(t, 0.9 * level * np.minimum(t, 1.0))[0]
    return level, float((x[-1] - x[half]) / (t[-1] - t[half]))


def about(axis: IdentifiedAxis, kept: Collection[str], joint: Simulator | None, where: str, step: float) -> list[str]:
    """Return the lines that a file states: what the axis has beside, and how both compare."""
    u, left = axis.words, lost(axis, kept)
    lines = [f"{axis.name}: a joint with the friction of {axis.label}, simulated only, not tried on a machine."]
    lines += [f"Record: {axis.citation}"] * bool(axis.citation) + ["Not in this joint:"] * bool(left) + left
    if joint is None:
        return [*lines, f"Not compared with the axis: {where} is not installed."]
    try:
        travel, difference, rests = equivalence(axis, joint, step)
    except ExperimentError as error:
        return [*lines, f"Not compared with the axis, which could not be simulated: {error}"]
    (own, still), (level, creep) = np.round(rests, 12) + 0.0
    return [
        *lines,
        f"Axis as identified, and this joint in {where} with steps of {1e3 * step:g} ms, under the same {u.force}:",
        f"- position: rms difference {shown(difference, u.m)}, travel {shown(travel, u.m)}",
        f"- break-away: {own:.4g} {u.N}, joint {level:.4g} {u.N}",
        f"- creep under 90 % of it: {shown(still, u.m_s)}, joint {shown(creep, u.m_s)}",
    ]


def write_form(
    axis: IdentifiedAxis,
    path: Path,
    law: AxisPlant,
    kind: str,
    form: str = "",
    kept: Collection[str] = (),
    simulate: Callable[[str], Simulator | None] | None = None,
    step: float = STEP,
) -> list[Path]:
    """Fill a form, and write it after a comment; `kind` is its type of the joint, and `simulate` may need the text."""
    known = {"name": re.sub(r"\W+", "_", axis.name, flags=re.ASCII).strip("_") or "axis", "inertia": axis.mass}
    known |= {"mass": 1.0 if axis.rotary else axis.mass, "kind": kind, "u": axis.words, "step": step, **law.values}
    text = Path(__file__).with_name("forms").joinpath(form or path.name).read_text(encoding="utf-8").format(**known)
    joint = simulate(text) if simulate else simulator(law, axis.rotary)
    lines = about(axis, kept, joint, "MuJoCo 4" if simulate else "an exact solver", step)
    lines = [re.sub("-(?=-)", "- ", "".join(filter(str.isprintable, line))) for line in lines]  # a comment has no --
    write_file("\n".join(["<!--", *lines, "-->", text]).encode(), path)
    return [path]
