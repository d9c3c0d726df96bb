"""Pictures of a study: the record over time, velocity and position, with the simulations of the best models."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from friction_fmus.axis.loop_assembly import block, typed, viscous_beside
from friction_fmus.identification import LINEAR, ROTARY, Array, AxisUnits, Record
from friction_fmus.identification.fit.idim import decimate, filtered_motion
from friction_fmus.identification.fit.scores import rms
from friction_fmus.study.model_ranking import IdentifiedModel
from friction_fmus.study.study_result import Picture, StudyCurve, curve, thinned
from harness import Experiment, FmuPart, SeriesPart, System

DRAWN: Final = 4  # number of models to plot, best first
CLOUD: Final = 2000  # approximate number of points of a scatter plot
LOOP: Final = 3.0  # longest section of the record plotted as a loop [s]


def series(data: Sequence[Record], models: Sequence[IdentifiedModel]) -> tuple[Picture, ...]:
    """Return the record over time, together with the simulations of the best models."""
    record = max(data, key=len)
    units = record.units
    drawn = [found for found in models[:DRAWN] if found.row.rank]

    def picture(name: str, unit: str, columns: Mapping[str, Array | None], lines: Mapping[str, StudyCurve]) -> Picture:
        shown = {key: thinned(record.t, column) for key, column in columns.items() if column is not None}
        return Picture("time", name, "s", unit, shown, lines)

    pictures = []
    if record.q is not None:
        pictures.append(picture("position", units.position, {"measured": record.q, "reference": record.reference}, {}))
        errors = {found.row.name: found.position for found in drawn if found.position is not None}
        if record.reference is not None:
            error = {"measured, reference − position": record.reference - record.q}
            pictures.append(picture("position error", units.position, error, {}))
        if errors:
            pictures.append(Picture("time", "simulated − measured position", "s", units.position, {}, errors))
    if record.v is not None:
        pictures.append(picture("velocity", units.velocity, {"measured": record.v}, {}))
    if record.force is not None:
        pictures.append(picture(f"drive {units.words.force}", units.force, {"measured": record.force}, {}))
        forces = {found.row.name: found.force for found in drawn if found.force is not None}
        if forces:
            pictures.append(Picture("time", f"simulated − measured {units.words.force}", "s", units.force, {}, forces))
    if record.friction is not None:
        over = record.normal if record.normal is not None and np.all(record.normal > 0.0) else None
        column = record.friction if over is None else record.friction / over
        lines = {found.row.name: found.predicted for found in drawn if found.predicted is not None}
        name, unit = ("friction", units.force) if over is None else ("friction coefficient", "1")
        pictures.append(picture(name, unit, {"measured": column}, lines))
    return tuple(pictures)


def residuals(record: Record, models: Sequence[IdentifiedModel]) -> tuple[Picture, ...]:
    """Return the force residual of the co-simulated servo with the best models, over velocity and over position."""
    forces = {found.row.name: found.force for found in models[:DRAWN] if found.row.rank and found.force is not None}
    if not forces or record.q is None:
        return ()
    motion = filtered_motion(record)
    t, units = record.t - record.t[0], record.units

    def over(name: str, unit: str, column: Array) -> Picture:
        curves = {
            model: StudyCurve(tuple(np.interp(line.x, t, column).tolist()), line.y) for model, line in forces.items()
        }
        return Picture(name, f"simulated − measured {units.words.force}", unit, units.force, {}, curves)

    return over("velocity", units.velocity, motion.v), over("position", units.position, motion.q)


def friction_of(record: Record, found: IdentifiedModel) -> tuple[Array, Array, Array] | None:
    """Return position, filtered velocity and friction of a record; None if it has neither friction nor force."""
    if record.q is None:
        return None
    motion = filtered_motion(record)
    if record.friction is not None:
        return record.q, motion.v, record.friction
    if record.force is None:
        return None
    table = found.position_map
    beside = 0.0 if table is None else table.grid.weights(record.q) @ np.array(table.cogging)
    return record.q, motion.v, record.force - found.mass * motion.a - found.offset + beside


def over_velocity(record: Record, models: Sequence[IdentifiedModel]) -> Picture | None:
    """Return friction over velocity: points of the record, and curves of the models on a slow velocity sweep."""
    best = [found for found in models if found.row.rank]
    behind = friction_of(record, best[0]) if best else None
    if behind is None:
        return None
    _, v, friction = behind
    smooth, level = decimate(v, 10), decimate(friction, 10)
    few = slice(50, -50, max(1, len(smooth) // CLOUD)) if len(smooth) > 300 else slice(None)
    fastest = 1.05 * float(np.max(np.abs(v)))
    at = np.linspace(-fastest, fastest, 800)  # an even number: no point is at the jump at rest
    curves = {}
    for found in best[:DRAWN]:
        kept = ("F_t",) if found.plant.loaded else ("F_t", "Fn")
        load = {name: np.full(800, rms(own)) for name, own in load_along(found, record).items() if name in kept}
        F = driven_friction(found, record.units, 5.0 * np.arange(800.0) / 800.0, at, load)
        curves[found.row.name] = curve(at[1:], F[1:])
    points = curve(smooth[few], level[few])
    units = record.units
    return Picture("velocity", "friction", units.velocity, units.force, {"record": points}, curves)


def over_position(record: Record, models: Sequence[IdentifiedModel]) -> Picture | None:
    """Return friction over position around the reversal nearest to the middle of the record, measured and simulated."""
    best = [found for found in models if found.row.rank]
    behind = friction_of(record, best[0]) if best else None
    if behind is None:
        return None
    q, v, friction = behind
    turns = np.flatnonzero(np.diff(np.sign(v)) != 0)
    turns = turns[(turns > 100) & (turns < len(v) - 100)]
    if not turns.size:
        return None
    centre = int(turns[np.argmin(np.abs(turns - len(v) // 2))])
    half = min(round(0.5 * LOOP / record.Ts), len(v) // 4)
    section = slice(max(0, centre - half), centre + half)
    # start earlier: a bristle that starts in motion takes some time to deflect
    lead = min(section.start, half)
    driven = slice(section.start - lead, section.stop)
    t = record.Ts * np.arange(float(len(v[driven])))
    few = max(1, len(v[section]) // 600)
    loops = {}
    for found in best[:DRAWN]:
        load = {name: values[driven] for name, values in load_along(found, record).items()}
        F = driven_friction(found, record.units, t, v[driven], load)[lead:]
        loops[found.row.name] = curve(q[section][::few], F[::few])
    points = curve(q[section][::few], friction[section][::few])
    units = record.units
    return Picture("position", "friction", units.position, units.force, {"record": points}, loops)


def driven_friction(found: IdentifiedModel, units: AxisUnits, t: Array, v: Array, load: Mapping[str, Array]) -> Array:
    """Return the friction force of a model's FMU driven by a velocity and further inputs, shape (n,)."""
    step = float(t[1] - t[0])
    contact = FmuPart("friction", block(found.block, units.rotary))
    inputs = {port.name for port in contact.inputs}
    columns = {"v": v, **{name: values for name, values in load.items() if name in inputs}}
    own = ROTARY if units.rotary else LINEAR  # the units of the block, in which it takes numbers of any scale
    known = {"v": own.velocity, "Fn": "N", "F_t": own.force}
    sweep = SeriesPart("sweep", t, columns, {name: known[name] for name in columns})
    start: dict[str, float | int | bool | str] = {f"friction.{k}": v for k, v in typed(contact, found.values).items()}
    start |= {"friction.F_ext": 0.0} if "F_ext" in inputs else {}
    start |= {"friction.Fn": found.values.get("Fn0", 1.0)} if "Fn" in inputs and "Fn" not in columns else {}
    experiment = Experiment(stop=step * (len(t) - 1), step=step, record=("friction.F",))
    wires = [f"sweep.{name} -> friction.{name}" for name in columns]
    with System([sweep, contact], wires, start, experiment, "curve") as system:
        F = np.asarray(system.run()["friction.F"].to_numpy(), dtype=np.float64)
        F += viscous_beside(contact, found.plant) * v
        return F


def load_along(found: IdentifiedModel, record: Record) -> dict[str, Array]:
    """Return normal and transmitted force along a record, as far as they are known."""
    known = {} if record.force is None else {"F_t": record.force}
    if record.normal is not None:
        known["Fn"] = np.full(len(record), np.mean(record.normal))
    if not found.plant.loaded:
        return known
    table, q = found.position_map, record.column("q")
    external = -found.offset + (0.0 if table is None else table.force(q, np.zeros(len(q))))
    load: Array = found.terms["a_external"] * external - found.terms["a_drive"] * record.column("force")
    return {**known, "Fn": found.values["Fn0"] + np.abs(load)}
