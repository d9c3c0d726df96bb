"""The page of documentation inside an FMU, made from the block itself."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import groupby

from markdown_it import MarkdownIt
from markdown_it.token import Token

from friction_fmus.blocks.catalogue import FEATURES, Block, package_text
from friction_fmus.blocks.comment import Paragraph, paragraphs
from friction_fmus.blocks.probe import Description
from friction_fmus.blocks.variable_table import variable_groups
from friction_fmus.conditions import quotes
from friction_fmus.fmi.model_description import CAPABILITIES
from friction_fmus.fmi.portrait import Figure
from friction_fmus.fmi.terminals import Terminal
from friction_fmus.version import VERSION

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a; }
h1 { overflow-wrap: anywhere; }
h1 small { font-weight: normal; color: #595959; font-size: 1rem; }
pre, .wide { overflow-x: auto; }
pre { background: #f5f6f8; padding: .8rem; font-size: .9rem; }
table { border-collapse: collapse; font-size: .9rem; }
caption { text-align: left; padding: .25rem 0; color: #595959; }
th, td { text-align: left; padding: .25rem .7rem; border-bottom: 1px solid #ddd; vertical-align: top; }
tbody th { font-weight: normal; }
td:last-child { min-width: 12rem; }
tbody th[scope=rowgroup] { font-weight: bold; padding-top: .8rem; }
summary { cursor: pointer; font-weight: bold; padding: .4rem 0; }
.icon { float: right; width: 9rem; height: auto; margin: 0 0 1rem 1rem; }
.figures { display: flex; flex-wrap: wrap; gap: 1rem; clear: both; }
figure { margin: 0; flex: 1 1 19rem; max-width: 29rem; }
figure img { width: 100%; height: auto; }
figcaption { font-size: .9rem; color: #404040; }
"""


def index_page(block: Block, description: Description, figures: Sequence[Figure], connected: Sequence[Terminal]) -> str:
    """documentation/index.html: what the block is, its equations, behaviour, conditions, variables and source.

    Parameters
    ----------
    block, description : Block, Description
        What it is.
    figures : sequence of Figure
        Beside the page as ``figure1.svg`` and so on.
    connected : sequence of Terminal
        Its terminals.
    """
    sections = (
        _behaviour(figures),
        _features(block),
        _conditions(block),
        _variables(description),
        _terminals(connected),
        _capabilities(description),
        _source(block),
        f"<h2>Changes</h2>\n<details><summary>Change log of the library</summary>\n{_changes()}</details>\n",
    )
    name = escape(block.name)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{name}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
        f"<h1>{name} <small>{escape(block.kind)}</small></h1>\n"
        f'<img class="icon" src="../model.png" alt="Icon of {name}" width="200" height="200">\n'
        f"<p><strong>{escape(block.summary)}.</strong></p>\n{notes_as_html(block.notes)}\n"
        f"{''.join(sections)}</main>\n"
        f'<footer>\n<p>Made by friction-fmus {VERSION}; <a href="licenses/license.txt">MIT licence</a>.</p>\n'
        "</footer>\n</body>\n</html>\n"
    )


def _behaviour(figures: Sequence[Figure]) -> str:
    """The figures, or why there are none."""
    shown = "".join(
        f'<figure>\n<img src="figure{number}.svg" alt="{escape(figure.alternative)}" width="403" height="288">\n'
        f"<figcaption>{escape(figure.caption)}</figcaption>\n</figure>\n"
        for number, figure in enumerate(figures, start=1)
    )
    text = (
        f'<p>Run from the binary of this FMU, with its start values.</p>\n<div class="figures">\n{shown}</div>'
        if shown
        else "<p>With its start values it does not run by itself, so there is no figure.</p>"
    )
    return f"<h2>Behaviour</h2>\n{text}\n"


def _features(block: Block) -> str:
    """What a friction model shows, of the words of the catalogue."""
    items = "".join(f"<li>{escape(name)}: {escape(FEATURES[name])}</li>\n" for name in block.features)
    return f"<h2>Features</h2>\n<ul>\n{items}</ul>\n" if items else ""


def _conditions(block: Block) -> str:
    """The conditions under which the block works in a loop, as `friction_fmus.conditions` states them."""
    items = "".join(f"<li>{escape(text)} (<code>{name}</code>)</li>\n" for name, text in quotes(block.about.quotes))
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


def _table(caption: str, heads: Sequence[str], body: str) -> str:
    """A table that scrolls by itself where the screen is narrow."""
    cells = "".join(f'<th scope="col">{name}</th>' for name in heads)
    return (
        f'<div class="wide">\n<table>\n<caption>{caption}</caption>\n<thead>\n<tr>{cells}</tr>\n</thead>\n'
        f"{body}</table>\n</div>\n"
    )


def _row(first: str, *cells: str) -> str:
    return f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in cells)}</tr>\n'


def _variables(description: Description) -> str:
    """The table of variables, each group below its title."""
    body = ""
    for title, entries in variable_groups(description).items():
        rows = [_row(e.name, e.unit, ", ".join(e.starts), e.limits, e.text) for e in entries]
        head = f'<tr><th colspan="5" scope="rowgroup">{escape(title)}</th></tr>\n'
        body += f"<tbody>\n{head}{''.join(rows)}</tbody>\n"
    heads = ("name", "unit", "start", "range", "meaning")
    return f"<h2>Variables</h2>\n{_table('Variables and their start values', heads, body)}"


def _terminals(connected: Sequence[Terminal]) -> str:
    """What can be connected at once."""
    rows = "".join(
        _row(each.name, each.rule, ", ".join(f"{m.name} = {m.variable} ({m.kind})" for m in each.members))
        for each in connected
    )
    if not rows:
        return ""
    table = _table("Terminals: variables that are connected together", ("name", "rule", "members"), rows)
    return f"<h2>Terminals</h2>\n{table}"


def _capabilities(description: Description) -> str:
    """What the FMU can do, by the words of the standard."""
    steps = (
        "It takes samples at multiples of Ts; between them its outputs are held."
        if description.sampled
        else "It is continuous in time; a communication step is integrated inside the FMU."
    )
    rows = "".join(_row(name, value, text) for name, (value, text) in CAPABILITIES.items())
    table = _table("Capability flags", ("attribute", "value", "meaning"), rows)
    return f"<h2>FMI features</h2>\n<p>FMI 2.0 for co-simulation, with sources. {steps}</p>\n{table}"


def _source(block: Block) -> str:
    entries = "".join(f"<pre>{escape(entry)}</pre>\n" for entry in block.bibtex)
    code = f"<details><summary>C code of the block</summary>\n<pre>{escape(block.code)}</pre>\n</details>\n"
    return f"<h2>Source</h2>\n<p>{escape(block.origin)}</p>\n{entries}{code}"


def _changes() -> str:
    """CHANGELOG.md below a heading of second order; links into the repository, which is not here, are text."""
    parser = MarkdownIt()
    tokens = parser.parse(package_text("CHANGELOG.md"))
    for token in tokens:
        if token.type.startswith("heading"):
            token.tag = f"h{int(token.tag[1]) + 1}"
        token.children = _without_links(token.children) if token.children else token.children
    first = next(k for k, token in enumerate(tokens) if token.type == "heading_close") + 1
    return str(parser.renderer.render(tokens[first:], parser.options, {}))


def _without_links(tokens: Sequence[Token]) -> list[Token]:
    """Without the links to files; those to other sites stay."""
    kept: list[Token] = []
    local = False
    for token in tokens:
        if token.type == "link_open":
            local = not str(token.attrs["href"]).startswith("http")
        if not (local and token.type in ("link_open", "link_close")):
            kept.append(token)
    return kept
