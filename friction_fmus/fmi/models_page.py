"""The page docs/models.md, from the friction models: ``python -m friction_fmus.fmi.models_page > docs/models.md``."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from friction_fmus.blocks.catalogue import FEATURES, Block, catalogue
from friction_fmus.blocks.comment import INDENT, Paragraph, paragraphs
from friction_fmus.blocks.probe import STATE, STATE_OUTPUT
from friction_fmus.fmi.package import describe_block

INTRODUCTION = """# Friction models

Each model is an FMU with the input `v`, the relative sliding velocity, and the output `F`, the friction force that
opposes it. [Which friction model](which-model.md) helps to choose one, and [effects.md](effects.md) compares them.

```console
$ friction-fmus show LuGre
$ friction-fmus cite LuGre
```

`show` prints all notes of a model and its parameters; `documentation/index.html` in the FMU has them with figures.
`cite` prints the BibTeX entries.

![Which model shows which phenomenon](figures/phenomena.png)
"""


def models_page() -> str:
    """Return the page: a table of features, then what each model is, its use, limits and equations."""
    blocks = [block for block in catalogue().values() if block.kind == "friction"]
    table = ["| model | shows | states |", "|---|---|--:|", *map(_table_row, blocks)]
    legend = [f"* **{name}**: {meaning}" for name, meaning in FEATURES.items()]
    return "\n".join([INTRODUCTION, *table, "", *legend, "", *(_section(block) for block in blocks)])


def _table_row(block: Block) -> str:
    states = sum(v.role in (STATE, STATE_OUTPUT) for v in describe_block(block).variables)
    shown = ", ".join(feature for feature in FEATURES if feature in block.features)
    return f"| [{block.name}](#{block.name.lower()}) | {shown} | {states} |"


def _section(block: Block) -> str:
    first, *rest = paragraphs(block.notes)
    leads = [paragraph for paragraph in rest if paragraph.lead]
    parts = [_markdown(paragraph) for paragraph in (first, *leads, *_equations(rest))]
    return "\n\n".join([f"## {block.name}", *parts, f"Source: {block.origin}."]) + "\n"


def _equations(notes: Sequence[Paragraph]) -> list[Paragraph]:
    """Return the equations, each with the paragraph after it, which explains them."""
    shown: list[Paragraph] = []
    for before, paragraph in pairwise((Paragraph(()), *notes)):
        if paragraph.equations or (before.equations and not paragraph.lead):
            shown.append(paragraph)
    return shown


def _markdown(paragraph: Paragraph) -> str:
    if paragraph.equations:
        return "\n".join(["```text", *(INDENT + line for line in paragraph.lines), "```"])
    lead = f"**{paragraph.lead}** " if paragraph.lead else ""
    written = "\n  ".join(paragraph.lines) if paragraph.item else "\n".join(paragraph.lines)
    return ("- " if paragraph.item else lead) + written.replace("*", "\\*").replace("|", "\\|")


if __name__ == "__main__":
    import sys

    sys.stdout.write(models_page())
