"""The page docs/models.md, from the friction models: ``python -m friction_fmus.fmi.models_page > docs/models.md``."""

from __future__ import annotations

from friction_fmus.blocks.catalogue import FEATURES, Block, catalogue
from friction_fmus.blocks.comment import INDENT, Paragraph, paragraphs
from friction_fmus.blocks.probe import STATE, STATE_OUTPUT
from friction_fmus.fmi.package import describe_block

INTRODUCTION = """# Friction models

Each model is an FMU with the relative sliding velocity `v` as input and the friction force `F`, which opposes `v`, as
output. `friction-fmus show NAME` prints the equations and parameters of a model, and `friction-fmus cite NAME` prints
the BibTeX entry of its source.
"""


def models_page() -> str:
    """Return the page: a table of features, then the equations and limits of each model."""
    blocks = [block for block in catalogue().values() if block.kind == "friction"]
    heads = ("model", *FEATURES, "states")
    table = [f"| {' | '.join(heads)} |", f"|---|{':-:|' * (len(heads) - 1)}"]
    table += [_table_row(block) for block in blocks]
    legend = [f"* **{name}**: {meaning}" for name, meaning in FEATURES.items()]
    return "\n".join([INTRODUCTION, *table, "", *legend, "", *(_section(block) for block in blocks)])


def _table_row(block: Block) -> str:
    states = sum(v.role in (STATE, STATE_OUTPUT) for v in describe_block(block).variables)
    marks = ["x" if feature in block.features else "" for feature in FEATURES]
    return f"| [{block.name}](#{block.name.lower()}) | {' | '.join(marks)} | {states} |"


def _section(block: Block) -> str:
    parts = [f"## {block.name}", f"*{block.summary}.* Source: {block.origin}."]
    parts += [_markdown(paragraph) for paragraph in paragraphs(block.notes)]
    return "\n\n".join(parts) + "\n"


def _markdown(paragraph: Paragraph) -> str:
    if paragraph.equations:
        return "\n".join(["```text", *(INDENT + line for line in paragraph.lines), "```"])
    lead = f"**{paragraph.lead}** " if paragraph.lead else ""
    written = "\n  ".join(paragraph.lines) if paragraph.item else "\n".join(paragraph.lines)
    return ("- " if paragraph.item else lead) + written.replace("*", "\\*").replace("|", "\\|")


if __name__ == "__main__":
    import sys

    sys.stdout.write(models_page())
