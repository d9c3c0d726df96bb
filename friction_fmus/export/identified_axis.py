"""The axis that a study or an identification found, as the targets of `export` take it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from friction_fmus.blocks.axis_units import Words, words_of
from friction_fmus.errors import BuildError, did_you_mean
from friction_fmus.export.axis_loop import AxisLoop

if TYPE_CHECKING:
    from friction_fmus.axis.position_map import PositionMap

RESULTS: Final = ("study.json", "identification.json")  # files with identified axes, under the key ``axes``
GIVE: Final = "give the folder that friction-fmus study or identify wrote with -o."


@dataclass(frozen=True)
class IdentifiedAxis:
    """Mass and friction of an axis in SI units; for a rotary axis, read m as rad, N as N.m and kg as kg.m2."""

    name: str
    citation: str
    """Name of the record, and its citation, empty if there is none."""
    rotary: bool  # whether the position is an angle
    label: str  # name of the friction model in the result
    model: str  # friction block
    parameters: Mapping[str, float]  # its parameters
    viscous: float  # coefficient of a viscous friction beside a block without one [N.s/m]
    mass: float  # moved mass [kg]; 0 if the record has no drive force
    offset: float  # constant force that the drive needs in addition to friction [N]
    position: PositionMap | None  # force over position
    speed: float  # largest speed of the record [m/s]; 0 if it has no position
    force_limit: float | None = None  # largest force of the servo [N]; None without a servo
    loop: AxisLoop | None = None  # servo of the axis; None without a study that compared compensators
    terms: Mapping[str, float] = field(default_factory=dict)  # what acts beside the model, see `axis_terms.TERMS`

    @property
    def words(self) -> Words:
        """Nouns and units of the axis."""
        return words_of(self.rotary)


def read_axis(path: Path, model: str = "") -> IdentifiedAxis:
    """Return the axis with the best friction model in a folder of results or a file in it, or with a named model."""
    folder = path if path.is_dir() else path.parent
    names = [path.name] if path.name in RESULTS else RESULTS
    file = next((folder / name for name in names if (folder / name).is_file()), None)
    if file is None or not path.exists():
        raise BuildError(f"{path} is no result, which has {' or '.join(RESULTS)}; {GIVE}")
    try:
        axes = [in_folder(axis_from(row), folder) for row in json.loads(file.read_text(encoding="utf-8"))["axes"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BuildError(
            f"{file} has no axes: it is damaged, or of an earlier version. Repeat the study or identification."
        ) from error
    if not axes:
        raise BuildError(
            f"{file} has no axis to export: no model was identified, the result is not in SI units, or a finding says "
            "that it must not be used. Repeat the study or identification and read its messages."
        )
    found = {axis.label: axis for axis in reversed(axes)}
    if model and model not in found:
        hint, labels = did_you_mean(model, found), ", ".join(axis.label for axis in axes)
        raise BuildError(f"{file} has no model {model!r}{hint}; choose from {labels}.")
    return found[model] if model else axes[0]


def axis_from(row: Mapping[str, Any]) -> IdentifiedAxis:
    """Return the axis that a file contains."""
    from friction_fmus.axis.position_map import Grid, PositionMap

    table, loop = row["position"], row["loop"] and AxisLoop(**row["loop"])
    if table is not None:
        table = PositionMap(Grid(**table["grid"]), tuple(table["cogging"]), tuple(table["friction"]), table["v_sign"])
    return IdentifiedAxis(**{**row, "position": table, "loop": loop})


def in_folder(axis: IdentifiedAxis, folder: Path) -> IdentifiedAxis:
    """Return an axis whose loop is in the folder of a study; without the loop if its archive is gone."""
    archive = folder / axis.loop.archive if axis.loop is not None else folder
    return replace(axis, loop=replace(axis.loop, archive=str(archive)) if axis.loop and archive.is_file() else None)
