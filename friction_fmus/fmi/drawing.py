"""Figures by matplotlib as SVG; the same drawing gives the same bytes."""

import io
import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib as mpl
import matplotlib.style
from matplotlib.figure import Figure

STYLE = {"svg.hashsalt": "friction-fmus", "svg.fonttype": "path", "path.simplify_threshold": 0.2}

_STYLED = threading.Lock()  # of the settings of matplotlib, which all threads share


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
