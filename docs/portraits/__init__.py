"""Figures of the pages of blocks: pictures, and the experiments behind them for pages that repeat them."""

from __future__ import annotations

from typing import Any

from portraits.by_ports import finite_panels
from portraits.chart import chart
from portraits.experiments import shown
from portraits.recorded import RecordedBench, opened, recorded_figures

__all__ = ["about_block", "opened", "pictures"]


def pictures(bench: RecordedBench) -> list[bytes]:
    """Return the figures of a block with its start values as SVG."""
    bench.values = {}
    panels = finite_panels(bench, shown(bench))
    bench.values = bench.begin
    return [chart(panel, bench.block.name) for panel in panels]


def about_block(bench: RecordedBench) -> dict[str, Any]:
    """Return what a page says of a block beside its variables: texts, and experiments to repeat."""
    block = bench.block
    return {
        "summary": block.summary,
        "source": block.origin,
        "bibtex": "\n\n".join(block.bibtex),
        "features": list(block.features),
        **recorded_figures(bench),
    }
