"""The report of a study: one HTML page with template, style, plots and the plotting library."""

import base64
import gzip
import re
from functools import cache
from hashlib import sha256
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from friction_fmus.listings import percent
from friction_fmus.report.formatting import brief, label, number, quantity, unit, with_error
from friction_fmus.report.live_panel import live_panel
from friction_fmus.report.sections import SECTIONS, Section
from friction_fmus.study.study_result import StudyResult
from friction_fmus.study.what_if import WhatIf
from harness.storage.files import atomic_path

__all__ = ["report_html", "write_report"]

FOLDER = Path(__file__).parent


def write_report(study: StudyResult, path: Path, panel: WhatIf | str = "") -> None:
    """Write the report of a study as one HTML file; an incomplete file never appears.

    Parameters
    ----------
    study : StudyResult
        Result of the study.
    path : Path
        Path of the file; its folder must exist.
    panel : WhatIf or str
        Axis for the what-if panel, or a sentence that says why there is none.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(report_html(study, panel), encoding="utf-8", newline="\n")


def report_html(study: StudyResult, panel: WhatIf | str = "") -> str:
    """Return the report of a study as one HTML page.

    Parameters
    ----------
    study : StudyResult
        Result of the study.
    panel : WhatIf or str
        Axis for the what-if panel, or a sentence that says why there is none.

    Returns
    -------
    str
        HTML 5 without references to other files; equal studies give equal pages. Texts of the study are escaped, and
        the content security policy only allows the scripts and the style sheet of the page.
    """
    script = (FOLDER / "page.js").read_text(encoding="utf-8")
    live = None if isinstance(panel, str) else live_panel(study, panel)
    style = (FOLDER / "page.css").read_text(encoding="utf-8") + (live["style"] if live else "")
    environment = _environment()
    environment.globals["words"] = study.units.words

    def body(name: str, section: Section) -> Markup:
        template = environment.get_template(f"sections/{name}.html")
        return Markup(template.render(study=study, panel=live or panel, **section.values(study)))

    return environment.get_template("page.html").render(
        study=study,
        style=style,
        style_hash=_hash(style),
        unused_styles=re.findall(r'getElementById\("([0-9a-f]{64})"\)', get_plotlyjs()),
        script=script,
        live=live,
        library=_library(),
        hashes=[_hash(text) for text in (script, get_plotlyjs(), *([live["script"]] if live else []))],
        sections=[
            {"name": name, "title": section.title, "folded": section.folded, "body": body(name, section)}
            for name, section in SECTIONS.items()
            if study.compensators or not section.compares
        ],
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
    filters = (brief, label, number, percent, quantity, unit)
    environment.filters |= {each.__name__: each for each in filters}
    environment.globals |= {"with_error": with_error}
    return environment


@cache
def _library() -> str:
    """Return plotly.js compressed to 2 MB instead of 4.8 MB; the package contains no smaller build."""
    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), 9, mtime=0)).decode("ascii")


def _hash(text: str) -> str:
    """Return the source expression that allows one script or style sheet in a policy (CSP level 3, 2.3.1)."""
    return f"'sha256-{base64.b64encode(sha256(text.encode()).digest()).decode('ascii')}'"
