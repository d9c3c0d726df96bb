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

RESULTS: Final = ("study.json", "identification.json")
"""Files with identified axes, under the key ``axes``."""


@dataclass(frozen=True)
class IdentifiedAxis:
    """Mass and friction of an axis.

    Numbers are in SI units; for a rotary axis, read m as rad, N as N.m and kg as kg.m2.

    Attributes
    ----------
    name : str
        Name of the record.
    citation : str
        Citation of the record; empty if none was given.
    rotary : bool
        Whether the position is an angle.
    label : str
        Name of the friction model in the result.
    model : str
        Friction block.
    parameters : mapping of str to float
        Parameters of the block.
    viscous : float
        Coefficient of a viscous friction beside the block, which has none [N.s/m].
    mass : float
        Moved mass [kg]; 0 if the record has no drive force.
    offset : float
        Constant force that the drive needs in addition to friction [N].
    position : PositionMap or None
        Force over position.
    speed : float
        Largest speed of the record [m/s]; 0 if it has no position.
    force_limit : float or None
        Largest force of the servo [N]; None without a servo.
    loop : AxisLoop or None
        Servo of the axis; None without a study that compared compensators.
    terms : mapping of str to float
        What acts beside the friction model, see `TERMS` of `friction_fmus.identification.fit.axis_terms`.
    """

    name: str
    citation: str
    rotary: bool
    label: str
    model: str
    parameters: Mapping[str, float]
    viscous: float
    mass: float
    offset: float
    position: PositionMap | None
    speed: float
    force_limit: float | None = None
    loop: AxisLoop | None = None
    terms: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> Words:
        """Nouns and units of the axis."""
        return words_of(self.rotary)


def read_axis(path: Path, model: str = "") -> IdentifiedAxis:
    """Return the best axis in the result of a study or an identification, or the one with a friction model.

    Parameters
    ----------
    path : Path
        Folder that ``friction-fmus study`` or ``identify`` wrote, or a file in it.
    model : str
        Name of the friction model in the result; empty for the best one.

    Returns
    -------
    IdentifiedAxis
        The axis.

    Raises
    ------
    BuildError
        If there is no such result or model, or if the result is not in SI units or cannot be trusted.
    """
    if not path.exists():
        raise BuildError(f"There is no {path}; give the folder that friction-fmus study or identify wrote with -o.")
    folder = path if path.is_dir() else path.parent
    own = [path] if path.name in RESULTS else [folder / name for name in RESULTS]
    file = next((each for each in own if each.is_file()), None)
    if file is None:
        raise BuildError(
            f"{folder} has neither {' nor '.join(RESULTS)}; give the folder that friction-fmus study or identify wrote "
            "with -o."
        )
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))["axes"]
        axes = [_axis(row, folder) for row in rows]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BuildError(
            f"{file} has no identified axes: it is damaged, or of an earlier version. Run the command again that wrote "
            "it."
        ) from error
    if not axes:
        raise BuildError(
            f"{file} has no axis to export: no model was identified, the result is not in SI units, or a finding says "
            "that it must not be used. Run the command again and read its messages."
        )
    found = {axis.label: axis for axis in reversed(axes)}
    if model and model not in found:
        names = [axis.label for axis in axes]
        raise BuildError(f"{file} has no model {model!r}{did_you_mean(model, names)}; choose from {', '.join(names)}.")
    return found[model] if model else axes[0]


def _axis(row: Mapping[str, Any], folder: Path) -> IdentifiedAxis:
    """Return the axis in a file of the folder."""
    from friction_fmus.axis.position_map import Grid, PositionMap

    table, loop = row["position"], row["loop"]
    if table is not None:
        values = {name: tuple(table[name]) for name in ("cogging", "friction")}
        table = PositionMap(Grid(**table["grid"]), **values, v_sign=table["v_sign"])
    if loop is not None:
        loop = AxisLoop(**loop)
        archive = folder / loop.archive
        loop = replace(loop, archive=str(archive)) if archive.is_file() else None
    return IdentifiedAxis(**{**row, "position": table, "loop": loop})
