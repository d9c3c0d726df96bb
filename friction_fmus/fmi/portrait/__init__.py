"""Portraits of blocks: an icon and figures, computed with the block's binary."""

from dataclasses import dataclass

import numpy as np

from friction_fmus.blocks.catalogue import Block, icon_files
from friction_fmus.blocks.probe import Description
from friction_fmus.fmi.portrait.drawing import Image, chart, icon, labelled, terminal_icon
from friction_fmus.fmi.portrait.experiments import Bench, Experiment, Panel, experiment
from harness.errors import HarnessError
from harness.parts.fmu import FmuPart

__all__ = ["Figure", "Image", "Portrait", "portray", "terminal_icon"]


@dataclass(frozen=True)
class Figure:
    """A figure of the documentation."""

    svg: bytes  # the SVG file
    caption: str
    alternative: str
    """Caption, which describes the experiment; alternative text for readers who cannot see the figure."""


@dataclass(frozen=True)
class Portrait:
    """Icon and figures of a block; without figures if the block does not run with its start values."""

    icon: Image
    figures: tuple[Figure, ...]


def portray(block: Block, description: Description, part: FmuPart) -> Portrait:
    """Run a block and plot its behaviour."""
    bench = Bench(block, description, part)
    panels = finite_panels(bench, experiment(bench))
    figures = tuple(
        Figure(chart(panel, block.name), panel.caption, f"{labelled(panel.y)} over {labelled(panel.x)}")
        for panel in panels
    )
    files = icon_files(block.path)
    drawn = Image(*(file.read_bytes() for file in files)) if files else icon(block.name, block.kind, panels)
    return Portrait(drawn, figures)


def finite_panels(bench: Bench, chosen: Experiment | None) -> tuple[Panel, ...]:
    """Return the panels of the experiment; none if the block rejects its start values or returns no finite numbers."""
    try:
        panels = chosen(bench) if chosen else ()
    except HarnessError:
        return ()
    finite = all(np.isfinite([curve.x, curve.y]).all() for panel in panels for curve in panel.curves)
    return panels if finite else ()
