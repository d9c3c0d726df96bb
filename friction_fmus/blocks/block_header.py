"""What Python knows of ``block.h``: rows of the table of variables, their roles and types, row macros, and units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

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
