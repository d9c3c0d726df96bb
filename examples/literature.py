"""docs/literature.md, from literature.toml and what the scripts show: ``python examples/literature.py docs``."""

from __future__ import annotations

import argparse
import csv
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import figures
import page as effects

EXAMPLES = Path(__file__).resolve().parent
FILE = "literature.md"
VERDICTS = ("holds", "holds if", "does not hold", "not tested")
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"

INTRODUCTION = """# Claims of the literature

This project started from a traineeship report, *A study of friction models and friction compensation*. This page lists
its claims, chapter by chapter. Each has a verdict and, in parentheses, a link to the [effect](effects.md)
that supports it. (1.3) is an equation of the report, [24] one of its references.
[paragraphs.csv](../examples/paragraphs.csv) lists its systems, methods, figures and equations by paragraph, each with
its files, a script or test that shows it, and its state.

{counts}

The claims are in `examples/literature.toml`, each with the figures that support it. This command writes the page:

```console
$ python examples/literature.py docs
```
"""


class Script(NamedTuple):
    """The parts of a script that a page shows.

    Attributes
    ----------
    link : str
        Its section.
    title : str
        The heading of that section.
    printed : str
        The sentences that it prints.
    figures : frozenset of str
        Names of what it measures.
    """

    link: str
    title: str
    printed: str
    figures: frozenset[str]


class Literature(NamedTuple):
    """The table of claims: sections of the report, their claims, and equations that are misprinted or ambiguous."""

    section: list[dict[str, Any]]
    claim: list[dict[str, Any]]
    equation: list[dict[str, Any]]


class MissingNumberError(LookupError):
    """A claim names a number that its script does not give."""


def read() -> Literature:
    """Return the table of claims."""
    return Literature(**tomllib.loads((EXAMPLES / "literature.toml").read_text(encoding="utf-8")))


def paragraphs() -> list[dict[str, str]]:
    """Return the systems, methods, figures and equations of the report, the rows of paragraphs.csv."""
    with (EXAMPLES / "paragraphs.csv").open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def shown(docs: Path) -> dict[str, Script]:
    """Return all scripts by folder/name: what docs/effects.md shows of them and what they measure."""
    text = (docs / effects.FILE).read_text(encoding="utf-8")
    printed = dict(re.findall(r"^!\[.*\]\(figures/(\w+)\.png\)\n\n> (.+)$", text, re.M))
    measured = {name: frozenset(found) for name, found in figures.read().items()}
    return {
        f"{folder}/{name}": Script(
            effects.link(folder, name), effects.title(folder, name), printed[name], measured.get(name, frozenset())
        )
        for folder in effects.CHAPTERS
        for name in effects.scripts(folder)
    }


def confirm(script: Script, wanted: str) -> None:
    """Raise an error unless a script gives a number.

    Parameters
    ----------
    script : Script
        The script.
    wanted : str
        Name of something that it measures, or a part of the sentences that it prints, with # for each number.

    Raises
    ------
    MissingNumberError
        If there is no such number.
    """
    pattern = NUMBER.join(re.escape(part) for part in wanted.split("#"))
    printed = "#" in wanted and re.search(rf"(?<![\d.]){pattern}", script.printed)
    if wanted not in script.figures and not printed:
        raise MissingNumberError(
            f"'{wanted}' is not a number of '{script.title}': see what the script prints and measures"
        )


def evidence(claim: Mapping[str, Any], scripts: Mapping[str, Script]) -> str:
    """Return links to the scripts of a claim in parentheses, once its numbers are confirmed."""
    for name, wanted in zip(claim.get("scripts", ()), claim.get("numbers", ()), strict=True):
        confirm(scripts[name], wanted)
    links = [f"[{Path(name).name}]({scripts[name].link})" for name in dict.fromkeys(claim.get("scripts", ()))]
    return f" ({'; '.join(links)})" if links else ""


def item(claim: Mapping[str, Any], scripts: Mapping[str, Script]) -> str:
    """Return a claim as an item of a list."""
    note = f": {claim['note']}" if "note" in claim else "."
    return f"- {claim['says']} **{claim['verdict'].capitalize()}**{note}{evidence(claim, scripts)}"


def misprint(equation: Mapping[str, Any], scripts: Mapping[str, Script]) -> str:
    """Return a misprinted, incomplete or ambiguous equation as an item of a list."""
    return f"- **{equation['number']}** {equation['wrong']} {equation['right']}{evidence(equation, scripts)}"


def counterparts(scripts: Mapping[str, Script]) -> str:
    """Return links to the first script of each figure of the report, by its number."""
    found = [(row["what"], Path(row["shown by"].split()[0])) for row in paragraphs() if row["kind"] == "figure"]
    numbers = (re.findall(r"Figure (\S+):", what)[0] for what, _ in found)
    links = (scripts[f"{path.parent.name}/{path.stem}"].link for _, path in found)
    return ", ".join(f"[{number}]({link})" for number, link in zip(numbers, links, strict=True)) + "."


def count(claims: Iterable[Mapping[str, Any]]) -> str:
    """Return a table of how many claims have which verdict."""
    of = [claim["verdict"] for claim in claims]
    hold, conditional, wrong, untested = (of.count(verdict) for verdict in VERDICTS)
    rows = {
        "hold": hold,
        "hold under a stated condition": conditional,
        "do not hold": wrong,
        "history or opinion, left out here": untested,
    }
    return "\n".join(
        [f"| {len(of)} claims | |", "|---|--:|", *(f"| {name} | {number} |" for name, number in rows.items())]
    )


def page(docs: Path) -> str:
    """Return the page, from docs/effects.md in a folder and the kept figures."""
    literature, scripts = read(), shown(docs)
    parts = [INTRODUCTION.format(counts=count(literature.claim))]
    for section in literature.section:
        parts.append(f"{'#' * section['level']} {section['title']}\n")
        claims = [claim for claim in literature.claim if claim["section"] == section["title"]]
        items = [item(claim, scripts) for claim in claims if claim["verdict"] != VERDICTS[-1]]
        parts += ["\n".join(items) + "\n"] if items else []
    parts.append("## Misprinted, incomplete or ambiguous equations\n")
    parts.append("\n".join(misprint(equation, scripts) for equation in literature.equation) + "\n")
    parts.append("## Counterparts of the report's figures\n")
    parts.append(counterparts(scripts) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("docs", type=Path, help="where effects.md is and this page is written")
    docs = parser.parse_args().docs
    (docs / FILE).write_text(page(docs), encoding="utf-8")
