"""The blocks that stand for all others in this folder compile every line of the FMI shell that any block compiles."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from shell.instance import Library, load
from shell.selection import SAMPLED_BLOCKS, SHELL_BLOCKS
from thorough import nightly

from friction_fmus import catalogue

SOURCES = Path(__file__).parents[2] / "fmu_src"
HEADERS = {path.name: path.read_text(encoding="utf-8") for path in SOURCES.glob("*.h")}


def compiled_branches(text: str, macros: set[str]) -> set[int]:
    """Lines of the ``#if``, ``#elif`` and ``#else`` whose text is compiled, and of ``#endif`` where none is."""
    found: set[int] = set()
    chains: list[tuple[bool, bool]] = []  # whether the text around is compiled, and whether a branch has been
    active = True
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.replace(" && __GNUC__ >= 8", "")  # of the compiler, not of a block
        directive = re.match(r"\s*#\s*(ifdef|ifndef|if|elif|else|endif)\b(?: (?:defined )?(\w+))?(.*)", line)
        if directive is None:
            continue
        kind, name, rest = directive.groups()
        assert re.fullmatch(r"\s*(/\*.*\*/)?\s*", rest), f"this test cannot evaluate {line!r}"
        if kind.startswith("if"):
            chains.append((active, False))
        outer, done = chains.pop()
        if kind == "endif":
            active = outer
            found |= {number} if outer and not done else set()
            continue
        active = outer and not done and (kind == "else" or (name in macros) != (kind == "ifndef"))
        found |= {number} if active else set()
        chains.append((outer, done or active))
    return found


def own_macros(library: Library) -> set[str]:
    """The macros that a block and the headers it includes define."""
    own = [path for path in (library.folder / "sources").iterdir() if path.name not in HEADERS]
    texts = [path.read_text(encoding="utf-8") for path in own]
    return {name for text in texts for name in re.findall(r"^\s*#\s*define\s+(\w+)", text, re.M)}


def traits(library: Library) -> set[object]:
    """What a block asks of the shell: branches by header and line, kinds of variables, groups that are empty."""
    macros, variables = own_macros(library), library.variables.values()
    found: set[object] = {(name, line) for name, text in HEADERS.items() for line in compiled_branches(text, macros)}
    found |= {(v.causality, v.variability, v.initial, v.type, "[" in v.name) for v in variables}
    found |= {f"no {group}" for group in ("input", "parameter") if not library.names(group)}
    return found | ({"no state"} if all(v.derivative is None for v in variables) else set())


ONLY_FMI_2 = pytest.mark.parametrize("build_fmu", [2], indirect=True, ids=["FMI 2.0"])


@nightly
@ONLY_FMI_2
def test_every_branch_of_the_shell_is_in_one_of_these_blocks(build_fmu: Callable[..., Path]) -> None:
    """Add a block to `SHELL_BLOCKS` if a trait is missing."""
    found = {name: traits(load(build_fmu(name))) for name in catalogue()}
    missing = set().union(*found.values()) - set().union(*(found[name] for name in SHELL_BLOCKS))
    assert {trait: [name for name in found if trait in found[name]] for trait in missing} == {}


@nightly
@ONLY_FMI_2
def test_sampled_blocks_are_found(build_fmu: Callable[..., Path]) -> None:
    assert [name for name in catalogue() if load(build_fmu(name)).sampled] == list(SAMPLED_BLOCKS)


def test_branches_are_followed() -> None:
    text = "#ifndef A\n#ifdef B\n1\n#elif defined C\n2\n#else\n3\n#endif\n#endif\n#if defined D\n4\n#endif"
    assert compiled_branches(text, {"A"}) == {9, 12}
    assert compiled_branches(text, {"B", "C", "D"}) == {1, 2, 10}
    assert compiled_branches(text, {"C"}) == {1, 4, 12}
    assert compiled_branches(text, set()) == {1, 6, 12}
