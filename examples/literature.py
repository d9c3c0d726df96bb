"""docs/study.md, from literature.toml and what the other pages show: ``python examples/literature.py docs``."""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

EXAMPLES = Path(__file__).resolve().parent
PAGES = {"models": "claims.md", "compensation": "effects.md"}
VERDICTS = ("holds", "holds if", "does not hold", "not tested")
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"

INTRODUCTION = """# The study of the literature, executable

This project started from a traineeship report, "A study of friction models and friction compensation". This page goes
through its chapters. Each claim about a model or a compensator stands here in our words, with the verdict, the script
that shows it or shows when it does not hold, its figure, and a number that the script prints or measures.

{counts}

Claims are kept in `examples/literature.toml`; this page is made of them, of [claims.md](claims.md),
[effects.md](effects.md) and [compensation.md](compensation.md) by

```console
$ python examples/literature.py docs
```
"""


class Script(NamedTuple):
    """What a page shows of a script.

    Attributes
    ----------
    link : str
        Its section.
    title : str
        The heading of that section.
    printed : str
        The sentences that it prints.
    figures : mapping of str to str
        What it measures by name, as in docs/compensation.md.
    """

    link: str
    title: str
    printed: str
    figures: Mapping[str, str]


class Literature(NamedTuple):
    """The table of claims: sections of the study, their claims and figures, and equations that are misprinted."""

    section: list[dict[str, Any]]
    claim: list[dict[str, Any]]
    figure: list[dict[str, Any]]
    equation: list[dict[str, Any]]


class MissingNumberError(LookupError):
    """A claim names a number that its script does not give."""


def read() -> Literature:
    """The table of claims."""
    return Literature(**tomllib.loads((EXAMPLES / "literature.toml").read_text(encoding="utf-8")))


def shown(docs: Path) -> dict[str, Script]:
    """All scripts by folder/name, from the pages in a folder."""
    measured = {}
    for part in (docs / "compensation.md").read_text(encoding="utf-8").split("\n## [")[1:]:
        measured[part.split("](")[0]] = dict(re.findall(r"^\| (\S.*?) \| (\S.*?) \|", part, re.M))
    found = {}
    for folder, page in PAGES.items():
        for part in (docs / page).read_text(encoding="utf-8").split("\n## ")[1:]:
            title = part.partition("\n")[0]
            (name,) = re.findall(rf"^python examples/{folder}/(\w+)\.py", part, re.M)
            (printed,) = re.findall(r"^> (.+)$", part, re.M)
            anchor = re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
            found[f"{folder}/{name}"] = Script(f"{page}#{anchor}", title, printed, measured.get(title, {}))
    return found


def number(script: Script, wanted: str) -> str:
    """A number of a script.

    Parameters
    ----------
    script : Script
        The script.
    wanted : str
        Name of something that it measures, or a piece of the sentences that it prints, with # for each number.

    Raises
    ------
    MissingNumberError
        If there is no such number.
    """
    if wanted in script.figures:
        return f"{wanted}: {script.figures[wanted]}"
    pattern = NUMBER.join(re.escape(piece) for piece in wanted.split("#"))
    match = re.search(rf"(?<![\d.]){pattern}", script.printed) if "#" in wanted else None
    if match is None:
        raise MissingNumberError(
            f"'{wanted}' is not a number of '{script.title}': see what the script prints and measures"
        )
    return match.group()


def evidence(claim: Mapping[str, Any], scripts: Mapping[str, Script]) -> str:
    """Links to the scripts of a claim and their figures, and its numbers, as items of an inner list."""
    found: dict[str, list[str]] = {}
    for name, wanted in zip(claim.get("scripts", ()), claim.get("numbers", ()), strict=True):
        found.setdefault(name, []).append(number(scripts[name], wanted))
    return "".join(
        f"\n    - [`{Path(name).name}`]({scripts[name].link}) ([figure](figures/{Path(name).name}.png)): "
        + f"{'; '.join(numbers)}."
        for name, numbers in found.items()
    )


def item(claim: Mapping[str, Any], scripts: Mapping[str, Script]) -> str:
    """A claim as an item of a list."""
    note = f": {claim['note']}" if "note" in claim else "."
    return f"- {claim['says']} **{claim['verdict'].capitalize()}**{note}{evidence(claim, scripts)}"


def misprint(equation: Mapping[str, Any], scripts: Mapping[str, Script]) -> str:
    """A misprinted equation as an item of a list."""
    return f"- **{equation['number']}** {equation['wrong']} {equation['right']}{evidence(equation, scripts)}"


def count(claims: Iterable[Mapping[str, Any]]) -> str:
    """How many claims have which verdict."""
    of = [claim["verdict"] for claim in claims]
    hold, conditional, wrong, untested = (of.count(verdict) for verdict in VERDICTS)
    return (
        f"Of {len(of)} claims {hold} hold, {conditional} hold under a condition that is stated, {wrong} do not hold, "
        f"and {untested} are history or opinion that nothing here can test."
    )


def page(docs: Path) -> str:
    """The page, from the pages of the scripts in a folder."""
    literature, scripts = read(), shown(docs)
    parts = [INTRODUCTION.format(counts=count(literature.claim))]
    for section in literature.section:
        parts.append(f"{'#' * section['level']} {section['title']}\n")
        for figure in literature.figure:
            if figure["section"] == section["title"]:
                name = Path(figure["script"]).name
                parts.append(f"![{figure['number']}: {figure['shows']}](figures/{name}.png)\n")
                parts.append(f"{figure['number']}: {figure['shows']} ([`{name}`]({scripts[figure['script']].link}))\n")
        items = [item(claim, scripts) for claim in literature.claim if claim["section"] == section["title"]]
        parts += ["\n".join(items) + "\n"] if items else []
    parts.append("## Equations that are misprinted or incomplete\n")
    parts.append("\n".join(misprint(equation, scripts) for equation in literature.equation) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("docs", type=Path, help="where the pages are, and this one is written")
    docs = parser.parse_args().docs
    (docs / "study.md").write_text(page(docs), encoding="utf-8")
