"""The notes of a block as paragraphs: the first comment of its C file, or the docstring of its law."""

from __future__ import annotations

import re
from dataclasses import dataclass

LEADS = ("Use it", "Limits:")
"""First words of the paragraphs that help to choose a model: when to use it, and its limits."""

INDENT = "    "


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of prose, a block of equations, or an item of a list."""

    lines: tuple[str, ...]
    """The lines, without the indentation of equations, the hyphen of an item and the lead."""
    lead: str = ""
    """One of `LEADS`, or empty."""
    equations: bool = False
    item: bool = False
    """Whether it is a block of equations, which keeps its layout; whether it is an item of a list."""

    @property
    def text(self) -> str:
        """Prose as one line, or equations with their line breaks."""
        return "\n".join(self.lines) if self.equations else " ".join(self.lines)


def paragraphs(notes: str) -> tuple[Paragraph, ...]:
    """Split notes into paragraphs: blank lines separate them, indentation marks equations, hyphens mark items."""
    found: list[Paragraph] = []
    for part in re.split(r"\n\s*\n", notes.strip("\n")):
        lines = part.splitlines()
        if all(line.startswith(INDENT) for line in lines):
            found.append(Paragraph(tuple(line.removeprefix(INDENT) for line in lines), equations=True))
            continue
        for piece in re.split(r"\n(?=- )", part.strip()):
            item = piece.startswith("- ")
            lead = re.match(rf"({'|'.join(LEADS)})\s+", piece)
            body = piece.removeprefix("- ") if item else piece[lead.end() :] if lead else piece
            written = tuple(line.strip() for line in body.splitlines())
            found.append(Paragraph(written, lead.group(1) if lead else "", item=item))
    return tuple(found)
