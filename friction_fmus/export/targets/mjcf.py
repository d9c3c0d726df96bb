"""A joint of MuJoCo: friction loss and damping or, for a model with presliding, LuGre friction of MuJoCo 4."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.axis.servo import AxisPlant
    from friction_fmus.axis.simulator_joint import Simulator
    from friction_fmus.export.identified_axis import Array, IdentifiedAxis

SHORTEST: Final = 1e-4  # time step for bristles [s]
EXPLICIT: Final = 0.2  # time step over the time constants of bristles, in which MuJoCo is explicit


def write(axis: IdentifiedAxis, folder: Path) -> list[Path]:
    """Write the model."""
    from friction_fmus.axis.simulator_joint import contact_of, coulomb_law, write_form

    path, kind = folder / "mjcf.xml", "hinge" if axis.rotary else "slide"
    if not (stiffness := contact_of(axis).stiffness):
        return write_form(axis, path, coulomb_law(axis), kind, simulate=mujoco_simulator)
    law, step = bristles(axis)
    kept = ["static"] + ["presliding"] * (law.values["sigma0"] == stiffness)
    return write_form(axis, path, law, kind, "mjcf-lugre.xml", kept, mujoco_simulator, step)


def bristles(axis: IdentifiedAxis) -> tuple[AxisPlant, float]:
    """Return LuGre friction and a time step for its bristles [s]; their stiffness is limited for the shortest one."""
    from friction_fmus.axis.servo import AxisPlant
    from friction_fmus.axis.simulator_joint import STEP, contact_of, stribeck_law

    contact, p = contact_of(axis), stribeck_law(axis).values
    viscous, stiffness = p["Fv"], contact.stiffness
    damping = contact.damping or 2.0 * EXPLICIT * (stiffness * axis.mass) ** 0.5  # a fifth of the critical damping
    longest = EXPLICIT * min((damping + viscous) / stiffness, axis.mass / damping)
    step = min(max(float(f"{longest:.0e}"), SHORTEST), STEP)
    stiffness = min(stiffness, axis.mass * (EXPLICIT / step) ** 2)
    damping = min(max(damping, step * stiffness / EXPLICIT - viscous), EXPLICIT * axis.mass / step)
    known = {name: p[name] for name in ("Fc", "Fs", "vs")}
    return AxisPlant("LuGre", {"sigma0": stiffness, "sigma1": damping, "sigma2": viscous, **known}, axis.mass), step


def mujoco_simulator(text: str) -> Simulator | None:
    """Return a simulator of a model in MuJoCo, whose motor has the force; None if it is not installed."""
    try:
        import mujoco
        import numpy as np
        from mujoco import rollout

        model = mujoco.MjModel.from_xml_string(text)
    except (ImportError, ValueError):  # ValueError: an earlier version, without dcmotor
        return None

    def run(t: Array, force: Array) -> tuple[Array, Array]:
        state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        later, _ = rollout.rollout(model, mujoco.MjData(model), state, force[None, :-1, None])
        found = np.vstack([state, later[0]])  # time, position, velocity, bristles
        return found[:, 1], found[:, 2]

    return run


TARGET = Target("a joint of MuJoCo", "axis", write)
