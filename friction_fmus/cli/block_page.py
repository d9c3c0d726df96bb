"""The page that ``friction-fmus show`` prints about a block."""

from itertools import zip_longest

from rich.console import Console
from rich.table import Table
from rich.text import Text

from friction_fmus.blocks.catalogue import FEATURES, Block
from friction_fmus.blocks.macros import INDENT, Paragraph, paragraphs
from friction_fmus.blocks.probe import BlockVariables, VariableRow, variable_groups

WIDE = 100  # width of the terminal, in characters, from which the table of variables includes ranges


def show_block(console: Console, block: Block, rows: BlockVariables) -> None:
    """Print summary, use, limits, equations and variables of a block."""
    first, *rest = paragraphs(block.notes) or (Paragraph((block.summary,)),)
    kind = " ".join(filter(None, (block.kind, block.family and f"({block.family})")))
    console.print(Text.assemble((block.name, "bold"), f", {kind}: {block.summary}"), end="\n\n")
    _print_paragraphs(console, [first])
    console.print(_choice(block, [p for p in rest if p.lead]))
    console.print(Text("\nEquations\n", "bold"))
    _print_paragraphs(console, [p for p in rest if not p.lead])
    console.print(_variables(rows, ranges=console.width >= WIDE))


def _print_paragraphs(console: Console, parts: list[Paragraph]) -> None:
    """Print text and lists wrapped to the terminal, and equations unchanged."""
    for part, following in zip_longest(parts, parts[1:]):
        if part.equations:
            for line in part.lines:
                console.print(Text(INDENT + line), soft_wrap=True)
        elif part.item:
            grid = Table.grid(padding=(0, 1))
            grid.add_row("-", Text(part.text))
            console.print(grid)
        else:
            console.print(Text(part.text))
        if not (part.item and following and following.item):
            console.print()


def _choice(block: Block, leads: list[Paragraph]) -> Table:
    """Return use, limits, features and source as a table."""
    grid = Table(box=None, show_header=False, pad_edge=False, padding=(0, 3, 1, 0))
    grid.add_column(style="bold", no_wrap=True)
    grid.add_column()
    for paragraph in leads:
        grid.add_row(paragraph.lead.rstrip(":"), Text(paragraph.text))
    if block.features:
        grid.add_row("Features", Text("\n".join(f"{name}: {FEATURES[name]}" for name in block.features)))
    cite = f"\nBibTeX: friction-fmus cite {block.name}" if block.bibtex else ""
    grid.add_row("Source", Text(block.origin + cite))
    return grid


def _variables(rows: BlockVariables, ranges: bool) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for heading in ("Variables", "start", "unit"):
        table.add_column(heading, justify="right" if heading == "start" else "left", no_wrap=True)
    for heading in ("range", "meaning") if ranges else ("meaning",):
        table.add_column(heading)
    for title, entries in variable_groups(rows).items():
        table.add_row()
        table.add_row(Text(title, "bold"))
        for entry in entries:
            cells = [entry.name, _starts(entry), entry.unit, *([entry.limits] if ranges else []), entry.text]
            table.add_row(*map(Text, cells))
    return table


def _starts(entry: VariableRow) -> str:
    return " ... ".join(entry.starts[:: len(entry.starts) - 1]) if len(entry.starts) > 1 else "".join(entry.starts)
