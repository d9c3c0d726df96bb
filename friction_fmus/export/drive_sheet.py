"""The sheet of a drive: parameters with units and sources, and the tracking error that they reach in simulation."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from friction_fmus.blocks.catalogue import find
from friction_fmus.errors import BuildError
from friction_fmus.export.axis_fit import AxisFit
from friction_fmus.export.identified_axis import Array, IdentifiedAxis
from friction_fmus.export.targets import write_file
from friction_fmus.listings import shown
from harness.storage.files import atomic_path
from harness.units import in_unit

COMPUTED: Final = "Computed and simulated, not tried on the device. Begin with a low torque limit and a low speed."


class Row(NamedTuple):
    """Parameter of a drive."""

    name: str
    value: str
    unit: str
    where: str
    """Value as it is entered, its unit, and where it is entered."""
    source: tuple[str, ...] = ()  # title and address of the documentation that states its meaning


def text(value: float, step: float = 0.0) -> str:
    """Return a value with the decimals of a step, or with four digits."""
    decimals = len(f"{step:.10f}".rstrip("0").partition(".")[2])
    return f"{value + 0.0:.{decimals}f}" if step else f"{value:.4g}"


def in_percent(
    axis: IdentifiedAxis, rated: str, forces: Mapping[str, float], step: float
) -> tuple[list[float], Array, str]:
    """Return forces by name as rounded percentages of a rated one, again as forces, and a note on them."""
    u = axis.words
    whole = in_unit(rated, u.N, None, "--rated") if rated.strip("+-.0123456789") else None
    if not isinstance(whole, float) or not whole > 0.0:
        raise BuildError(f"The drive takes parts of its rated {u.force}: give it at the axis, --rated '2.4 {u.N}'.")
    found = [step * round(100.0 * force / whole / step) for force in forces.values()]
    for name, value in zip(forces, found, strict=True):
        if abs(value) > 100.0:
            raise BuildError(
                f"{name} would be {value:.4g} % of the rated {u.force}, but the device takes at most 100 %."
            )
    return found, 0.01 * whole * np.array(found), f"Percent of the rated {u.force}, {whole:.4g} {u.N} at the axis."


def lost(axis: IdentifiedAxis, kept: Collection[str] = ()) -> Iterator[str]:
    """Yield what a device cannot express of the friction of an axis, a sentence each."""
    friction, u = find(axis.model).about.friction, axis.words
    if friction is not None:
        contact = friction.contact(axis.parameters)
        level = contact.levels[0]
        if (viscous := level.viscous + axis.viscous) and not {"viscous", "table"} & {*kept}:
            yield f"Viscous friction, {viscous:.4g} {u.Ns_m}, is not compensated in proportion to the velocity."
        if level.vs and level.Fs > level.Fc and "table" not in kept:
            yield f"Static friction, {level.Fs:.4g} {u.N}, which falls with the velocity, is not compensated."
        if contact.stiffness:
            distance = shown(level.Fs / contact.stiffness, u.m)
            yield f"After a reversal, the friction of the axis builds up over {distance} (presliding), unlike here."
    if beside := ", ".join(name for name in axis.terms if not name.startswith("G_")):
        yield f"What the identification found beside the friction model is not compensated: {beside}."
    if axis.position is not None and "position" not in kept:
        yield f"The {u.force} over position is not compensated."


def write_sheet(
    fit: AxisFit, folder: Path, name: str, device: str, rows: Sequence[Row], force: Array, notes: Sequence[str]
) -> list[Path]:
    """Write a sheet as Markdown and its rows as CSV, and return the paths.

    `force`, of shape (n,) [N], is what the device adds to the servo along the reference; `notes` are sentences.
    """
    page, table = folder / f"{name}.md", folder / f"{name}.csv"
    write_file("\n".join(_page(fit, device, rows, force, notes)) + "\n", page)
    with atomic_path(table) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([Row._fields, *([*row[:4], " ".join(row.source)] for row in rows)])
    return [page, table]


def _page(fit: AxisFit, device: str, rows: Sequence[Row], force: Array, notes: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the page."""
    axis, sources = fit.axis, list(dict.fromkeys(row.source for row in rows if row.source))
    yield from (f"# {axis.name}: friction compensation of {device}", "", COMPUTED, "")
    yield from ("| parameter | value | unit | where it is entered | source |", "|---|--:|---|---|---|")
    for row in rows:
        yield f"| {' | '.join(row[:4])} | {f'[{sources.index(row.source) + 1}]' if row.source else ''} |"
    yield from ("", "## Tracking error in simulation", "", *_errors(fit, force), "")
    yield from ("## Assumptions and limits", "", *(f"- {note}" for note in notes))
    if -1.0 not in fit.held or 1.0 not in fit.held:
        yield "- The reference moves in one direction only: the record does not determine the values of the other one."
    yield from ("", "## Sources", "")
    yield from (f"{i}. {title}, <{address}>" for i, (title, address) in enumerate(sources, start=1))
    yield f"{len(sources) + 1}. Identified friction: {axis.label}" + f", {axis.citation}" * bool(axis.citation)


def _errors(fit: AxisFit, force: Array) -> Iterator[str]:
    """Yield the lines with the tracking errors."""
    loop, u = fit.axis.loop, fit.axis.words
    if loop is None:
        yield (
            "Unknown: this needs a study that compares compensators (`friction-fmus study` with a servo). The values "
            f"follow the model at speeds up to {fit.axis.speed:.3g} {u.m_s}."
        )
        return
    reached, law = fit.tracking(force), loop.law
    rows = [
        ("as measured", loop.as_measured, "The servo as it was when the record was taken."),
        ("no compensation", loop.fed, f"The servo with the feedforward of the study, and with the constant {u.force}."),
        ("this sheet", reached, "That servo with the values above, as they are rounded."),
        ("recommended law", loop.recommended, f"That servo with {law}, for controllers that run code."),
    ]
    yield from ("| servo | tracking error, rms | what it is |", "|---|--:|---|")
    for name, value, what in rows[: 3 if law == "none" else 4]:
        yield f"| {name} | {'unstable' if value is None else shown(value, u.m)} | {what} |"
    yield ""
    if loop.fed is not None and reached >= loop.fed:
        yield "This sheet does not reduce the error of the servo without compensation: do not use it."
    elif loop.fed is not None:
        yield f"This sheet leaves {100.0 * reached / loop.fed:.3g} % of the error without compensation."
    if law != "none" and loop.recommended is not None and reached < loop.recommended:
        yield f"{law} is also tuned to axes that differ from the identified one, which the sheet was fitted to."
