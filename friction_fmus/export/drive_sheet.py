"""The sheet of a drive: parameters with units and sources, and the tracking error that they reach in simulation."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from friction_fmus.errors import BuildError
from friction_fmus.export.axis_fit import AxisFit
from friction_fmus.export.axis_loop import Array
from friction_fmus.listings import shown
from harness.storage.files import atomic_path, make_folder

HEADINGS: Final = ("parameter", "value", "unit", "where", "source")
COMPUTED: Final = "Computed and simulated, not tried on the device. Try it at low speed first, with a low torque limit."


class Source(NamedTuple):
    """Documentation of a maker."""

    title: str
    address: str


class Row(NamedTuple):
    """Parameter of a drive."""

    name: str
    value: str  # as it is entered
    unit: str
    where: str = ""  # where it is entered
    source: Source | None = None  # documentation that states its meaning


@dataclass(frozen=True)
class Sheet:
    """Contents of a sheet."""

    device: str
    rows: Sequence[Row]
    force: Array | None  # force of the drive beside its servo with these values, shape (n,) [N]; None if not modelled
    notes: Sequence[str] = ()  # what was assumed, and what the device cannot express


def number(value: float, step: float, least: float, most: float, name: str) -> float:
    """Return a value rounded to the step of a device; raise BuildError if it is outside of the range."""
    rounded = step * round(value / step)
    if not least <= rounded <= most:
        raise BuildError(
            f"{name} is {value:.4g}, outside of the range of the device, {least:g} to {most:g}; the axis needs another "
            "drive or target."
        )
    return rounded


def digits(value: float, step: float = 0.0) -> str:
    """Return a value with the decimals of a step, or with four digits."""
    decimals = max(0, len(f"{step:.10f}".rstrip("0").partition(".")[2]))
    return f"{value + 0.0:.{decimals}f}" if step else f"{value:.4g}"


def write_sheet(sheet: Sheet, fit: AxisFit, folder: Path, name: str) -> list[Path]:
    """Write a sheet as Markdown and its rows as CSV, and return the paths."""
    make_folder(folder)
    page, table = folder / f"{name}.md", folder / f"{name}.csv"
    with atomic_path(page) as temporary:
        temporary.write_text("\n".join(_page(sheet, fit)) + "\n", encoding="utf-8", newline="\n")
    with atomic_path(table) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(HEADINGS)
        writer.writerows([*row[:4], "" if row.source is None else " ".join(row.source)] for row in sheet.rows)
    return [page, table]


def _page(sheet: Sheet, fit: AxisFit) -> list[str]:
    """Return the lines of the page."""
    axis = fit.axis
    lines = [f"# {axis.name}: friction compensation of {sheet.device}", "", COMPUTED, ""]
    lines += ["| parameter | value | unit | where it is entered | source |", "|---|--:|---|---|---|"]
    sources = list(dict.fromkeys(row.source for row in sheet.rows if row.source is not None))
    for row in sheet.rows:
        cited = "" if row.source is None else f"[{sources.index(row.source) + 1}]"
        lines.append(f"| {row.name} | {row.value} | {row.unit} | {row.where} | {cited} |")
    lines += ["", "## Tracking error in simulation", "", *errors_of(sheet, fit), ""]
    if sheet.notes:
        lines += ["## What to know", "", *(f"- {note}" for note in sheet.notes), ""]
    lines += ["## Sources", "", *(f"{i}. {each.title}, <{each.address}>" for i, each in enumerate(sources, start=1))]
    lines.append(f"{len(sources) + 1}. Identified friction: {axis.label}" + f", {axis.citation}" * bool(axis.citation))
    return lines


def errors_of(sheet: Sheet, fit: AxisFit) -> list[str]:
    """Return the lines with the tracking errors."""
    loop, u = fit.axis.loop, fit.axis.words
    if loop is None:
        return [
            "The tracking error is unknown: it needs the servo of the axis, and a study that compares compensators "
            "(`friction-fmus study`). The values follow the friction of the model over the speeds up to "
            f"{fit.axis.speed:.3g} {u.m_s}."
        ]
    reached = None if sheet.force is None else fit.tracking(sheet.force)
    servo = "The same servo with velocity and acceleration feedforward and the constant force"
    rows = (
        ("as measured", loop.as_measured, "The servo as it was when the record was taken."),
        ("without friction compensation", loop.fed, f"{servo}."),
        ("with this sheet", reached, "That servo with the values above, as they are rounded."),
        ("with the recommended law", loop.recommended, f"That servo with {loop.law}, for drives that run C code."),
    )
    lines = ["| servo | tracking error, rms | what it is |", "|---|--:|---|"]
    lines += [f"| {name} | {'–' if value is None else shown(value, u.m)} | {what} |" for name, value, what in rows]
    if reached is None:
        return [*lines, "", "The device was not simulated: see below."]
    verdict = "This sheet does not reduce the tracking error of the servo without friction compensation: do not use it."
    if loop.fed is not None and reached < loop.fed:
        verdict = f"This sheet leaves {100.0 * reached / loop.fed:.3g} % of the error without friction compensation"
        beside = loop.recommended and f", and {reached / loop.recommended:.3g} times the error of the recommended law."
        verdict += beside or "."
    return [*lines, "", verdict]
