"""The page docs/models.md, from the friction models: ``python -m friction_fmus.fmi.models_page > docs/models.md``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from friction_fmus.blocks.catalogue import FEATURES, Block, catalogue
from friction_fmus.blocks.comment import INDENT, Paragraph, paragraphs

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
    """Return the page: the features, then what each model is, its use, limits and equations."""
    blocks = [block for block in catalogue().values() if block.kind == "friction"]
    legend = [f"* **{name}**: {meaning}" for name, meaning in FEATURES.items()]
    return "\n".join([INTRODUCTION, *legend, "", *(_section(block) for block in blocks)])


def _section(block: Block) -> str:
    first, *rest = paragraphs(block.notes)
    leads = [paragraph for paragraph in rest if paragraph.lead]
    parts = [markdown(paragraph) for paragraph in (first, *leads, *_equations(rest))]
    return "\n\n".join([f"## {block.name}", *parts, f"Source: {block.origin}."]) + "\n"


def _equations(notes: Sequence[Paragraph]) -> list[Paragraph]:
    """Return the equations, each with the paragraph after it that explains them, unless it is about the steps."""
    shown: list[Paragraph] = []
    for before, paragraph in pairwise((Paragraph(()), *notes)):
        numerics = re.search(r"\bsteps?\b", " ".join(paragraph.lines))
        if paragraph.equations or (before.equations and not paragraph.lead and not numerics):
            shown.append(paragraph)
    return shown


def markdown(paragraph: Paragraph) -> str:
    """Return a paragraph of the notes of a block in Markdown."""
    if paragraph.equations:
        return "\n".join(["```text", *(INDENT + line for line in paragraph.lines), "```"])
    lead = f"**{paragraph.lead}** " if paragraph.lead else ""
    written = "\n  ".join(paragraph.lines) if paragraph.item else "\n".join(paragraph.lines)
    return ("- " if paragraph.item else lead) + written.replace("*", "\\*").replace("|", "\\|")


if __name__ == "__main__":
    import sys

    sys.stdout.write(models_page())
