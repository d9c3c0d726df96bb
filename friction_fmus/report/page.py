"""The page of the report: template, style, plots and the plotting library in one file."""

from __future__ import annotations

import base64
import gzip
from functools import cache
from hashlib import sha256
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.study.models import ALIKE
from friction_fmus.study.ranking import worst_case
from friction_fmus.study.result import StudyResult
from harness.storage.atomic import atomic_path

from . import numbers, views

FOLDER = Path(__file__).parent


def write_report(study: StudyResult, path: Path) -> None:
    """Write the report of a study as one HTML file; an incomplete file never appears.

    Parameters
    ----------
    study : StudyResult
        Result of the study.
    path : Path
        Path of the file; its folder must exist.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(report_html(study), encoding="utf-8", newline="\n")


def report_html(study: StudyResult) -> str:
    """Return the report of a study as one HTML page.

    Parameters
    ----------
    study : StudyResult
        Result of the study.

    Returns
    -------
    str
        HTML 5 without references to other files; equal studies give equal pages. Texts of the study are escaped, and
        the content security policy only allows the two scripts of the page.
    """
    ranked = views.ranked(study)
    unit, factor = views.error_unit(study)
    script = (FOLDER / "page.js").read_text(encoding="utf-8")
    template = _environment().get_template("page.html")
    return template.render(
        study=study,
        alike=ALIKE,
        style=(FOLDER / "page.css").read_text(encoding="utf-8"),
        script=script,
        library=_library(),
        hashes=[_hash(text) for text in (script, get_plotlyjs())],
        scores=views.scores(study.models),
        best=next((row for row in study.models if row.rank == 1), None),
        record_plots=views.record_plots(study),
        friction_plots=views.friction_plots(study),
        friction_table=None if study.friction is None else views.friction_table(study.friction),
        plots=views.compensator_plots(study),
        ranked=ranked,
        error_unit=unit,
        factor=factor,
        not_compared=views.not_compared(study),
        off=next(filter(None, map(worst_case, study.compensators)), ""),
        without=next((row for row in study.compensators if row.name == views.NONE), None),
        sources=_sources(study),
    )


def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "brief": numbers.brief,
        "number": numbers.number,
        "quantity": numbers.quantity,
        "unit": numbers.unit,
        "label": views.label,
    }
    environment.globals |= {"with_error": numbers.with_error}
    return environment


@cache
def _library() -> str:
    """Return plotly.js compressed to 2 MB instead of 4.8 MB; the package contains no smaller build."""
    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), 9, mtime=0)).decode("ascii")


def _hash(script: str) -> str:
    """Return the source expression that allows one script in a content security policy (CSP level 3, 2.3.1)."""
    return f"'sha256-{base64.b64encode(sha256(script.encode()).digest()).decode('ascii')}'"


def _sources(study: StudyResult) -> list[tuple[str, str]]:
    """Return name and source of each block of the catalogue used by the study."""
    known = catalogue()
    names = [row.name for row in study.models if row.rank is not None] + [
        row.name for row in study.compensators if row.applies
    ]
    return [(name, known[name].source) for name in dict.fromkeys(names) if name in known]
