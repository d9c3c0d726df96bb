"""Drawings by matplotlib for FMUs: the same drawing gives the same bytes."""

from __future__ import annotations

import io
import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import matplotlib as mpl
import matplotlib.style
from matplotlib.figure import Figure

STYLE = {"svg.hashsalt": "friction-fmus", "svg.fonttype": "path", "path.simplify_threshold": 0.2}


@dataclass(frozen=True)
class Image:
    """An image in pixel and in vector format."""

    png: bytes
    svg: bytes
    """The files."""


#: Guards the settings of matplotlib, which all threads share, as several threads may build blocks.
_STYLED = threading.Lock()


@contextmanager
def plain_style(**other: str) -> Iterator[None]:
    """Use matplotlib's default style, independent of user settings."""
    with _STYLED, mpl.style.context(["default", STYLE | other]):
        yield


def svg_of(figure: Figure, title: str) -> bytes:
    """Return the figure as SVG, without a date and a DOCTYPE, with paths rounded to a hundredth of a point."""
    stream = io.BytesIO()
    warnings.filterwarnings("ignore", "Glyph", UserWarning)  # a text in SVG is shown in fonts of the reader
    figure.savefig(stream, format="svg", metadata={"Title": title, "Date": None, "Creator": None})
    text = re.sub(rb"<!DOCTYPE.*?>\n", b"", stream.getvalue(), flags=re.S)
    return re.sub(rb' d="[^"]*"', lambda path: re.sub(rb"(\.\d\d)\d+", rb"\1", path.group()), text)


def png_of(figure: Figure) -> bytes:
    """Return the figure as PNG, without a date."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()
