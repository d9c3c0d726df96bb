"""Parameters of the friction models M1 to M5 of BAM (Better Actuator Models)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from friction_fmus.export.targets import Target, write_file

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import IdentifiedAxis

LOAD: Final = {"a": "base", "a_drive": "motor", "a_external": "external"}  # names of the terms and in BAM


def write(axis: IdentifiedAxis, folder: Path) -> list[Path]:
    """Write the parameters, with the names of `bam.model.Model`."""
    from friction_fmus.axis.simulator_joint import STEP, about, simulator, stribeck_law

    law, u = stribeck_law(axis), axis.words
    load = {side: axis.terms[name] for name, side in LOAD.items() if name in axis.terms}
    p, rise = law.values, law.values["Fs"] - law.values["Fc"]
    content: dict[str, Any] = {"model": ("m2" if rise else "m1", "m4" if rise else "m3", "m5")[len(load)]}
    content |= {"friction_base": p["Fc"], "friction_viscous": p["Fv"], "armature": axis.mass}
    content |= {f"load_friction_{side}": value for side, value in load.items()}
    if rise or len(load) == 2:
        content |= {"friction_stribeck": rise, "dtheta_stribeck": p["vs"], "alpha": p["delta"]}
        for side, value in load.items():  # the load raises the whole curve of the friction
            content[f"load_friction_{side}_stribeck".replace("_base", "")] = value * rise / max(p["Fc"], 1e-12)
    content["about"] = [
        f"Units {u.N}, {u.m_s} and {u.kg}; https://bam.readthedocs.io/en/latest/theory/models.html",
        "Add actuator, kt and R, which were not identified: BAM does not load the file without the name of an actuator",
        "and takes its defaults for what is missing. Subtract from armature what the bodies of your model have.",
        *about(axis, ("static", *LOAD), simulator(law, axis.rotary), "an exact solver without load", STEP),
    ]
    write_file(f"{json.dumps(content, indent=2)}\n".encode(), folder / "bam.json")
    return [folder / "bam.json"]


TARGET = Target("friction parameters of BAM (Better Actuator Models)", "axis", write)
