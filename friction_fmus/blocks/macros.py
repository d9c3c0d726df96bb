"""The text of a block's C file, its comment and the macros that are tables, and of ``block.h``."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from friction_fmus.errors import FrictionError, did_you_mean

LEADS = ("Use it", "Limits:")
"""First words of the paragraphs that help to choose a model: when to use it, and its limits."""

INDENT = "    "


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of prose, a block of equations, or an item of a list."""

    lines: tuple[str, ...]  # the lines, without the indentation of equations, the hyphen of an item and the lead
    lead: str = ""  # one of `LEADS`, or empty
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


@lru_cache(maxsize=1)  # the macros of one file are read one after another
def macros(code: str) -> dict[str, str]:
    """Return the texts of all macros by name."""
    return {name: text for name, text in reversed(re.findall(r"^#define\s+(\w+)\b((?:.*\\\n)*.*)$", code, re.M))}


def macro(code: str, name: str) -> str | None:
    """Return the text of a macro without its line continuations, or None if it is not defined."""
    found = macros(code).get(name)
    return None if found is None else " ".join(line.rstrip("\\").strip() for line in found.splitlines()).strip()


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
        spans, end = argument_spans(rest, match.end(), name)
        arguments = (re.sub(r'"\s*"', "", rest[span]).strip('"') for span in spans if rest[span])
        rows.append((match[1], tuple(arguments)))
        rest = rest[end + 1 :].strip()
    return rows


def argument_spans(text: str, begin: int, name: str, error: type[Exception] = FrictionError) -> tuple[list[slice], int]:
    """Return the arguments from `begin` on, between commas outside of strings and brackets, and where they close."""
    spans, depth, start, quoted = [], 0, begin, False
    for place in range(begin, len(text)):
        letter = text[place]
        if letter == '"' and text[place - 1] != "\\":
            quoted = not quoted
        elif quoted:
            continue
        elif letter in "([":
            depth += 1
        elif depth == 0 and letter in ",)":
            part = text[start:place]
            left = start + len(part) - len(part.lstrip())
            spans.append(slice(left, left + len(part.strip())))
            start = place + 1
            if letter == ")":
                return spans, place
        elif letter in ")]":
            depth -= 1
    raise error(f"{name} has a row without an end; close its bracket")


_SHAPES = "SCALAR|VECTOR|DYNAMIC|DYNAMICS"


@cache
def block_header() -> str:
    """Return the text of ``block.h``."""
    from harness.compiling.toolchain import source_folder  # few commands need it

    return (source_folder() / "block.h").read_text(encoding="utf-8")


def constants(kind: str, code: str) -> Mapping[str, int]:
    """Return the constants of ``enum role`` or ``enum type`` by name, without the prefix."""
    names = re.search(rf"^enum {kind} {{(.*?)}};", code, re.M | re.S)
    assert names
    prefix = f"{kind.upper()}_"
    return {name.strip().removeprefix(prefix): number for number, name in enumerate(names[1].split(","))}


def row_fields(code: str) -> list[tuple[str, str]]:
    """Return name and C type of each field of the struct ``Row``."""
    body = re.search(r"typedef struct {([^{}]*)} Row;", re.sub(r"/\*.*?\*/", "", code, flags=re.S))
    assert body
    fields = []
    for declaration in body[1].split(";")[:-1]:
        kind, names = re.fullmatch(r"\s*((?:const )?\w+)\s+(.*)", declaration, re.S).groups()  # type: ignore[union-attr]
        for name in names.split(","):
            pointer = "*" if "*" in name else ""
            fields.append((name.strip(" *"), kind.removeprefix("const ") + pointer))
    return fields


@cache
def start_arguments(code: str) -> Mapping[str, tuple[int, bool]]:
    """Return for each row macro with a start value its position among the arguments, and whether it is a vector."""
    found = {}
    for macro, arguments in re.findall(rf"^#define (\w+)\((name[^)]*)\) +(?:{_SHAPES}|INPUT)\(", code, re.M):
        names = [name.strip() for name in arguments.split(",")]
        for name in {"start", "starts"} & {*names}:
            found[macro] = names.index(name), name == "starts"
    return found


def si_units(*, rotary: bool = False) -> dict[str, str]:
    """Return the unit of each quantity in the translational or in the rotational build."""
    _, text = block_header().split("#ifdef ROTATIONAL\n", 1)
    turning, sliding = text.split("#else\n", 1)
    found = dict(re.findall(r'^#define (\w+)\s+"([^"]*)"$', sliding, re.M))
    return found | dict(re.findall(r'^#define (\w+)\s+"([^"]*)"$', turning if rotary else "", re.M))
