"""The text of a block's C file: its comment, and macros that are tables for readers other than the compiler."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from friction_fmus.errors import FrictionError, did_you_mean

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


def macro(code: str, name: str) -> str | None:
    """Return the text of a macro without its line continuations, or None if it is not defined."""
    found = re.search(rf"^#define\s+{name}\b((?:.*\\\n)*.*)$", code, re.M)
    return " ".join(line.rstrip("\\").strip() for line in found[1].splitlines()).strip() if found else None


def string(code: str, name: str) -> str:
    """Return a string macro with adjacent literals joined; empty if it is not defined."""
    parts = re.findall(r'"((?:[^"\\]|\\.)*)"', macro(code, name) or "")
    return re.sub(r"\\(.)", r"\1", "".join(parts))


def words(text: str) -> tuple[str, ...]:
    """Return the parts of a text between commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def table(code: str, name: str, known: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
    """Return the rows of a macro as kinds and arguments."""
    rows = []
    rest = macro(code, name) or ""
    while rest:
        match = re.match(r"([A-Z_]+)\s*\(", rest)
        if match is None:
            raise FrictionError(f"{name} contains {rest!r} in place of a row such as {known[0]}(...)")
        if match[1] not in known:
            raise FrictionError(
                f"{name} contains the unknown row {match[1]}{did_you_mean(match[1], known)}; known rows are "
                f"{', '.join(known)}"
            )
        end = _end(rest, match.end(), name)
        rows.append((match[1], tuple(_arguments(rest[match.end() : end]))))
        rest = rest[end + 1 :].strip()
    return rows


def _end(text: str, begin: int, name: str) -> int:
    """Return the position of the parenthesis that closes the one before `begin`."""
    depth, quoted = 1, False
    for place in range(begin, len(text)):
        quoted ^= text[place] == '"'
        depth += 0 if quoted else (text[place] == "(") - (text[place] == ")")
        if depth == 0:
            return place
    raise FrictionError(f"{name} has no closing parenthesis after {text[:begin]!r}")


def _arguments(text: str) -> Iterator[str]:
    """Yield the arguments between commas outside parentheses and strings; string literals without quotes."""
    depth, quoted, begin = 0, False, 0
    for place, letter in enumerate(f"{text},"):
        quoted ^= letter == '"'
        depth += 0 if quoted else (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0 and not quoted:
            argument = text[begin:place].strip()
            begin = place + 1
            if argument:
                yield re.sub(r'"\s*"', "", argument).strip('"')
