"""The axis that a study or an identification found, as the targets of `export` take it, and the loop of a study."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from friction_fmus.blocks.axis_units import Words, words_of
from friction_fmus.errors import BuildError, did_you_mean

if TYPE_CHECKING:
    from friction_fmus.axis.position_map import PositionMap


from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness import Experiment, Part, SeriesPart, System, Wire
from harness.run import Session
from harness.system.wire import parse_wire, split_name

Array: TypeAlias = NDArray[np.float64]

COMPENSATING: Final = ("compensator", "feedforward", "load", "table", "force", "unexplained")
"""Parts of the archive of a study that are beside servo and machine."""

AT_REST: Final = ("axis.v0", "axis.v1_0", "axis.v2_0", "velocity.v0")
"""Start values of an axis that begins at rest on its reference."""


class ReferenceMotion(NamedTuple):
    """Reference and its derivatives at the samples of the servo, each of shape (n,) [m, m/s, m/s2]."""

    r: Array
    rd: Array
    rdd: Array


@dataclass(frozen=True)
class AxisLoop:
    """Servo, mass and friction of a study."""

    archive: str  # path of ``axis.ssp``, the axis with the recommended compensator
    gains: Mapping[str, float]  # gains of the servo without it
    law: str  # name of the recommended compensator; "none" without one
    as_measured: float | None
    fed: float | None
    recommended: float | None
    """Tracking errors, rms, that the study found [m]: servo as measured, servo as in `error` without friction
    compensation, and servo with the recommended compensator; None if the run failed."""

    @cached_property
    def whole(self) -> System:
        """The axis with the recommended compensator."""
        return System.from_ssp(self.archive)

    @property
    def _experiment(self) -> Experiment:
        assert self.whole.experiment is not None
        return self.whole.experiment

    @property
    def sample_time(self) -> float:
        """Sample time of the servo [s]."""
        return self._experiment.step * self._experiment.decimate

    @cached_property
    def motion(self) -> ReferenceMotion:
        """The reference of the study."""
        names = tuple(f"reference.{name}" for name in ReferenceMotion._fields)
        source = System([self.whole.parts["reference"]], experiment=replace(self._experiment, record=names))
        found = Session(source, replace(self._experiment, record=names)).run({})
        return ReferenceMotion(*(found.column(name)[:-1] for name in names))

    def error(self, force: Array, motion: ReferenceMotion | None = None) -> Array:
        """Return the tracking error over the samples, shape (n,) [m], with a force at the output of the servo.

        The servo has the gains of the record, and velocity and acceleration feedforward if the study has them. `force`,
        of shape (n,) [N], stands for all forces beside the servo, the constant one included. `motion` is another
        reference, which begins at rest.
        """
        from friction_fmus.axis.servo_loop import accurate

        whole, t = self.whole, self.sample_time * np.arange(float(len(force)))
        added = {"added": {"F": force}} | ({} if motion is None else {"reference": motion._asdict()})
        parts: list[Part] = [part for name, part in whole.parts.items() if name not in (*COMPENSATING, *added)]
        # all are read at samples; a held output would still have the value of the sample before
        parts += [SeriesPart(name, t, each, beyond="hold") for name, each in added.items()]
        known = {part.name for part in parts}
        wires = [wire for wire in map(parse_wire, whole.wires) if {end[0] for end in wire.ends} <= known]
        wires.append(Wire("added.F", "servo.f"))
        start = {name: value for name, value in whole.start.items() if split_name(name)[0] in known}
        start |= {f"servo.{name}": value for name, value in self.gains.items()}
        start |= {} if motion is None else {name: 0.0 for name in AT_REST if name in start}
        start.pop("servo.f", None)
        experiment = replace(self._experiment, stop=len(force) * self.sample_time)
        _, found = accurate(System(parts, wires, start, experiment, whole.name))
        return (motion or self.motion).r - found.column(experiment.record[1])[:-1]  # the second is the position


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
