"""The documentation inside an FMU: index.html and the picture, both made from the block itself."""

from __future__ import annotations

import io
import math
from html import escape
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from fmpy.fmi2 import FMU2Slave
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from friction_fmus.catalogue import Block
from friction_fmus.conditions import quotes
from friction_fmus.describe import INPUT, OUTPUT, STATE_OUTPUT, Description
from friction_fmus.model_description import ROLE
from friction_fmus.notes import Paragraph, paragraphs
from friction_fmus.variable_table import variable_groups
from friction_fmus.version import VERSION

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a; }
h1 small { font-weight: normal; color: #666; font-size: 1rem; }
pre { background: #f5f6f8; padding: .8rem; overflow-x: auto; font-size: .9rem; }
table { border-collapse: collapse; font-size: .9rem; }
th, td { text-align: left; padding: .25rem .7rem; border-bottom: 1px solid #ddd; vertical-align: top; }
img { float: right; width: 14rem; margin: 0 0 1rem 1rem; }
"""


def index_page(block: Block, description: Description, identifier: str) -> str:
    """documentation/index.html: what the block is, its equations, conditions, variables and source."""
    heads = "".join(f"<th>{name}</th>" for name in ("name", "unit", "start", "range", "meaning"))
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{escape(identifier)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n<body>\n'
        f"<h1>{escape(identifier)} <small>{escape(block.kind)}</small></h1>\n"
        f'<img src="../model.png" alt="{escape(block.summary)}">\n'
        f"{notes_as_html(block.notes)}\n"
        f"{_conditions(block.name)}"
        f"<h2>Variables</h2>\n<table>\n<tr>{heads}</tr>\n{_variable_rows(description)}</table>\n"
        f"<h2>Source</h2>\n<p>{escape(block.source)}</p>\n"
        f"<pre>{escape(block.code)}</pre>\n"
        f"<p>Made by friction-fmus {VERSION}; MIT licence, see licenses/license.txt.</p>\n</body>\n</html>\n"
    )


def _conditions(block: str) -> str:
    """The conditions under which the block works in a loop, as `friction_fmus.conditions` states them."""
    items = "".join(f"<li>{escape(text)} (<code>{name}</code>)</li>\n" for name, text in quotes(block))
    if not items:
        return ""
    return (
        f"<h2>Conditions</h2>\n<ul>\n{items}</ul>\n<p>Functions of <code>friction_fmus.conditions</code>; "
        "<code>friction-fmus doctor SYSTEM</code> evaluates them for a concrete loop.</p>\n"
    )


def notes_as_html(notes: str) -> str:
    """Paragraphs, lists, and equations in their own layout."""
    parts: list[str] = []
    for item, together in groupby(paragraphs(notes), lambda paragraph: paragraph.item):
        shown = [_html(paragraph) for paragraph in together]
        parts += ["<ul>", *shown, "</ul>"] if item else shown
    return "\n".join(parts)


def _html(paragraph: Paragraph) -> str:
    tag = "pre" if paragraph.equations else "li" if paragraph.item else "p"
    lead = f"<b>{paragraph.lead}</b> " if paragraph.lead else ""
    return f"<{tag}>{lead}{escape(paragraph.text)}</{tag}>"


def _variable_rows(description: Description) -> str:
    """Rows of the table of variables, each group below its title."""
    rows = []
    for title, entries in variable_groups(description).items():
        rows.append(f'<tr><th colspan="5">{escape(title)}</th></tr>\n')
        for entry in entries:
            cells = (entry.name, entry.unit, ", ".join(entry.starts), entry.limits, entry.text)
            rows.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>\n")
    return "".join(rows)


def picture(block: Block, description: Description, identifier: str, folder: Path) -> bytes:
    """model.png: the friction loop or the signal of that very block, run from its binary, or its name.

    Parameters
    ----------
    folder : Path
        Unzipped FMU with a binary for this platform.
    """
    figure = Figure(figsize=(3.0, 3.0), dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.08, 0.08, 0.84, 0.74))
    figure.text(
        0.5,
        0.9,
        identifier,
        ha="center",
        va="center",
        fontsize=min(18.0, 260.0 / len(identifier)),
        weight="bold",
    )
    names = {v.name: v for v in description.variables}
    if block.kind == "friction" and "v" in names and names["v"].role == INPUT and "F" in names:
        _draw_loop(axes, description, identifier, folder)
    elif block.kind == "signal" and not any(ROLE[v.role][0] == "input" for v in names.values()):
        first = next(v for v in description.variables if v.role in (OUTPUT, STATE_OUTPUT))
        times = np.linspace(0.0, 1.0, 401)
        values = _run(description, identifier, folder, times, None, first.reference)
        axes.plot(times, values, color="tab:blue", lw=2)
        axes.set_ylabel(f"{first.name} [{first.unit}]", labelpad=2)
    else:
        _draw_ports(axes, description)
    axes.set_xticks([])
    axes.set_yticks([])
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def _draw_ports(axes, description: Description) -> None:  # type: ignore[no-untyped-def]
    """Inputs on the left, outputs on the right, as in a block diagram."""
    for causality, x, side in (("input", 0.05, "left"), ("output", 0.95, "right")):
        names = [v.name for v in description.variables if ROLE[v.role][0] == causality]
        for k, name in enumerate(names):
            y = 1.0 - (k + 0.5) / len(names)
            axes.text(x, y, name, ha=side, va="center", fontsize=13, color="tab:blue", transform=axes.transAxes)


def _draw_loop(axes, description: Description, identifier: str, folder: Path) -> None:  # type: ignore[no-untyped-def]
    """Friction against velocity over a slow and a fast period of a sinusoid, around the Stribeck velocity."""
    names = {v.name: v for v in description.variables}
    peak = 4.0 * names["vs"].start if "vs" in names else 1e-3
    for frequency, colour in ((1.0, "tab:blue"), (20.0, "tab:orange")):
        times = np.linspace(0.0, 2.0 / frequency, 1601)
        velocity = peak * np.sin(2.0 * math.pi * frequency * times)
        force = _run(description, identifier, folder, times, velocity, names["F"].reference)
        axes.plot(velocity[801:], force[801:], color=colour, lw=1.8)
    axes.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    axes.axvline(0.0, color="0.8", lw=0.8, zorder=0)
    axes.set_xlabel("velocity", labelpad=2)
    axes.set_ylabel("friction force", labelpad=2)


def _run(
    description: Description,
    identifier: str,
    folder: Path,
    times: np.ndarray,
    velocity: np.ndarray | None,
    output: int,
) -> np.ndarray:
    fmu = FMU2Slave(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName=identifier
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=float(times[0]))
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    reference = next((v.reference for v in description.variables if v.name == "v"), 0)
    values = [fmu.getReal([output])[0]]
    for k, (begin, end) in enumerate(pairwise(times)):
        if velocity is not None:
            fmu.setReal([reference], [float(velocity[k + 1])])
        fmu.doStep(float(begin), float(end - begin))
        values.append(fmu.getReal([output])[0])
    fmu.terminate()
    fmu.freeInstance()
    return np.array(values)
