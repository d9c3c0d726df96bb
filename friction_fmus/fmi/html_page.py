"""Documentation pages inside FMUs."""

from collections.abc import Sequence
from html import escape

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
"""


def table(caption: str, heads: Sequence[str], body: str) -> str:
    """Return a table that scrolls on narrow screens."""
    cells = "".join(f'<th scope="col">{name}</th>' for name in heads)
    return (
        f'<div class="wide">\n<table>\n<caption>{caption}</caption>\n<thead>\n<tr>{cells}</tr>\n</thead>\n'
        f"{body}</table>\n</div>\n"
    )


def row(first: str, *cells: str) -> str:
    """Return a row of a table; the texts are plain."""
    return f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in cells)}</tr>\n'


def page(identifier: str, kind: str, summary: str, body: str, footer: str) -> str:
    """Return documentation/index.html; body and footer are HTML, the other texts are plain."""
    name = escape(identifier)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{name}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{name} <small>{escape(kind)}</small></h1>\n"
        f'<img class="icon" src="../model.png" alt="Icon of {name}" width="200" height="200">\n'
        f"<p><strong>{escape(summary)}.</strong></p>\n{body}</main>\n"
        f"<footer>\n<p>{footer}</p>\n</footer>\n</body>\n</html>\n"
    )
