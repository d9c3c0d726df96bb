"""The report of a study: one HTML page that needs no other file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from string import Template

from matplotlib.figure import Figure

from .figures import LABEL, data_uri
from .summary import Identified, Summary, number

PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root { color-scheme: light; }
body { font: 16px/1.55 system-ui, sans-serif; color: #222; background: #fff; max-width: 54rem; margin: 0 auto;
       padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .5rem 0; }
h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; border-bottom: 1px solid #ddd; padding-bottom: .2rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid #e5e5e5; text-align: left; }
td.n, th.n { text-align: right; white-space: nowrap; }
figure { margin: 1rem 0; overflow-x: auto; }
img { width: 100%; min-width: 36rem; height: auto; }
figcaption { color: #555; font-size: .93rem; }
code, pre { font-family: ui-monospace, monospace; font-size: .92em; background: #f4f4f4; }
code { padding: 0 .2em; }
pre { padding: .7rem; overflow-x: auto; }
.cite { border-left: 4px solid #0072B2; padding: .2rem .8rem; background: #f3f8fb; }
</style>
</head>
<body>
$body
</body>
</html>
""")


@dataclass(frozen=True, eq=False)
class Illustration:
    """A figure of the report.

    Attributes
    ----------
    section : str
        Heading it stands under: "closed loop", "friction" or "compensation".
    figure : matplotlib.figure.Figure
        The figure.
    caption : str
        What it shows, also the text for those who cannot see it.
    """

    section: str
    figure: Figure
    caption: str


def report_html(summary: Summary, illustrations: Sequence[Illustration], command: str) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    summary : Summary
        The figures of the study.
    illustrations : sequence of Illustration
        Its pictures, embedded as PNG.
    command : str
        What to type to get the report again.

    Returns
    -------
    str
        HTML 5, all texts escaped, without scripts and without references to other files.
    """
    pictures: dict[str, str] = {}
    for shown in illustrations:
        pictures[shown.section] = pictures.get(shown.section, "") + _picture(shown)
    coulomb, stribeck = (summary.closed_loop[name] for name in ("coulomb", "stribeck"))
    gain = summary.compensation
    servos = list(dict.fromkeys(row.servo for row in gain.rows))

    body = [
        f"<h1>Measured axis {escape(summary.record)}: friction identified, servo co-simulated, friction "
        "compensated</h1>",
        f'<p class="cite">Data: {escape(summary.citation)}</p>',
        "<p>The mass and the friction of the axis are identified from its record. FMUs that carry these "
        "parameters are wired to the servo the record was taken with, and the closed loop is co-simulated "
        f"beside the measurement: it stays within {coulomb.position_rms_um:.2f} µm rms of the measured "
        f"position with Coulomb and viscous friction, and within {stribeck.position_rms_um:.2f} µm with a "
        "Stribeck curve. The simulation then shows what a friction feedforward gains: "
        + " and ".join(
            f"{gain.rms_um(servo, 'none'):.1f} → {gain.rms_um(servo, 'stribeck'):.1f} µm rms for the servo "
            f"{escape(servo)}"
            for servo in servos
        )
        + ".</p>",
        "<h2>Identified parameters</h2>",
        "<p>Inverse model <i>F</i> = <i>M</i> <i>q″</i> + <i>Fv</i> <i>q′</i> + <i>Fc</i> sgn(<i>q′</i>) + "
        "<i>OF</i>, least squares on the filtered and decimated record with the settings of the authors.</p>",
        _parameters("Inverse model (IDIM-LS)", summary.identified),
        "<p>Stribeck friction <i>F</i> = (<i>Fc</i> + (<i>Fs</i> − <i>Fc</i>) exp(−|<i>q′</i>/<i>vs</i>|"
        "<sup><i>δ</i></sup>)) sgn(<i>q′</i>) + <i>Fv</i> <i>q′</i> + <i>OF</i>, least squares of the "
        "co-simulated against the measured position, all other things in the loop as they are. Its "
        "standard errors allow for residuals that are correlated in time, so they are wider than those of "
        "the inverse model, which are computed as published. Where <i>Fs</i> is smaller than <i>Fc</i> "
        "the axis rubs harder when it moves.</p>",
        _parameters("Stribeck fit in closed loop", summary.stribeck),
        pictures.get("friction", ""),
        "<h2>Co-simulated closed loop against the record</h2>",
        _table(
            "Simulated minus measured",
            ("friction", "position, rms [µm]", "force, rms [% of measured]"),
            [
                (LABEL.get(name, name), f"{figures.position_rms_um:.3f}", f"{figures.force_percent:.2f}")
                for name, figures in summary.closed_loop.items()
            ],
        ),
        pictures.get("closed loop", ""),
        "<h2>Friction compensation</h2>",
        "<p>The same co-simulated servo with a feedforward of the friction that the model expects at the "
        "reference velocity. The axis in these runs is the Stribeck model, so the row <i>Stribeck</i> is "
        "what a perfect model gains and the row <i>Coulomb + viscous</i> what the simpler one gains on "
        "it. The servo as measured has no feedforward of the reference velocity, and lags behind by the "
        "velocity divided by its position gain; friction feedforward cannot remove this. With feedforward "
        "of velocity and inertia what is left over is friction.</p>",
        _table(
            "Tracking error (reference minus position)",
            ("servo", "friction feedforward", "rms [µm]", "largest [µm]"),
            [
                (
                    row.servo,
                    LABEL.get(row.feedforward, row.feedforward),
                    f"{row.rms_um:.2f}",
                    f"{row.max_um:.1f}",
                )
                for row in gain.rows
            ],
            texts=2,
        ),
        pictures.get("compensation", ""),
        "<h2>Settings</h2>",
        _table("", ("what", "value"), list(summary.notes.items()), texts=2),
        "<h2>Again</h2>",
        f"<pre>{escape(command)}</pre>",
        "<p>Files beside this page:</p>",
        "<ul>" + "".join(f"<li><code>{escape(file)}</code></li>" for file in summary.files) + "</ul>",
    ]
    return PAGE.substitute(title=escape(f"Measured axis {summary.record}"), body="\n".join(body))


def _parameters(caption: str, parameters: Mapping[str, Identified]) -> str:
    rows: list[tuple[str, ...]] = []
    for name, parameter in parameters.items():
        deviation = parameter.deviation_percent
        rows.append(
            (
                name,
                parameter.meaning,
                number(parameter.value),
                number(parameter.standard_error),
                "" if parameter.unit == "1" else parameter.unit,
                number(parameter.published),
                "–" if deviation is None else f"{round(deviation, 3) + 0.0:+.3f} %",
            )
        )
    heads: tuple[str, ...] = ("", "parameter", "value", "standard error", "unit", "published", "difference")
    if all(parameter.published is None for parameter in parameters.values()):
        rows = [row[:5] for row in rows]
        heads = heads[:5]
    return _table(caption, heads, rows, texts=2)


def _table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]], texts: int = 1) -> str:
    """Return a table whose first `texts` columns are text and whose others are numbers."""

    def cell(tag: str, column: int, text: str) -> str:
        kind = "" if column < texts else ' class="n"'
        return f"<{tag}{kind}>{escape(text)}</{tag}>"

    def line(tag: str, cells: Sequence[str]) -> str:
        return "<tr>" + "".join(cell(tag, column, text) for column, text in enumerate(cells)) + "</tr>"

    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    content = "\n".join(line("td", row) for row in rows)
    head = line("th", heads)
    return f'<div class="scroll"><table>{title}<thead>{head}</thead>\n<tbody>{content}</tbody></table></div>'


def _picture(shown: Illustration) -> str:
    caption = escape(shown.caption)
    image = f'<img alt="{caption}" src="{data_uri(shown.figure)}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
