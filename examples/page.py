"""docs/effects.md and its figures, made by the scripts: ``python examples/page.py docs``."""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

EXAMPLES = Path(__file__).resolve().parent
FILE = "effects.md"

INTRODUCTION = """# Effects of friction and of compensation

What friction models can and cannot show, and what compensation achieves in a control loop. Each section is a script
that runs the FMUs, draws the figure and checks the numbers against theory or an independent computation. To draw a
figure yourself:

```sh
python examples/compensation/hunting.py figures
```

The first comment of a script says how its result was computed. The literature's claims about these effects are in
[literature.md](literature.md), and the bounds of all measured figures in
[figures.csv](../examples/compensation/figures.csv).
"""

CHAPTERS = {
    "models": """## Friction models

All parameters are the start values of the FMUs unless the text says otherwise.
""",
    "compensation": """## Control loops

Unless the text says otherwise, the loop is an axis of 1 kg with LuGre friction (the parameters of its 1995 paper) under
a PID controller at 2 kHz with feedforward of the inertia. The controller places three poles at 15 Hz. Errors are root
mean square (rms) tracking errors.
""",
}
"""Folder of scripts -> how its chapter begins."""


class Text(NamedTuple):
    """The parts of a script's docstring that the page shows."""

    title: str
    summary: str
    source: str


def scripts(folder: str) -> dict[str, Path]:
    """Return the scripts of a folder by name."""
    paths = sorted(path for path in (EXAMPLES / folder).glob("*.py") if not path.name.startswith("_"))
    return {path.stem: path for path in paths}


def text(folder: str, name: str) -> Text:
    """Return the title, the first paragraph and the source of a script."""
    docstring = ast.get_docstring(ast.parse(scripts(folder)[name].read_text(encoding="utf-8"))) or ""
    heading, summary, *rest = docstring.split("\n\n")
    (source,) = (paragraph for paragraph in rest if paragraph.startswith("Source: "))
    return Text(heading, summary, source)


def title(folder: str, name: str) -> str:
    """Return the heading of a script's section."""
    return text(folder, name).title


def link(folder: str, name: str) -> str:
    """Return the address of a script's section, relative to docs/."""
    anchor = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", title(folder, name).lower()))
    return f"{FILE}#{anchor}"


def section(folder: str, name: str, numbers: str) -> str:
    """Return the section of a script: its summary, its figure, the numbers that it printed, its source and a link."""
    said = text(folder, name)
    return f"""### {said.title}

{said.summary}

![Figure](figures/{name}.png)

> {numbers}

{said.source} [Script](../examples/{folder}/{name}.py)
"""


def page(numbers: Mapping[tuple[str, str], str]) -> str:
    """Return the page, from the numbers that each script printed."""
    parts = [INTRODUCTION]
    for folder, beginning in CHAPTERS.items():
        parts += [beginning, *(section(folder, name, numbers[folder, name]) for name in scripts(folder))]
    return "\n".join(parts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("docs", type=Path, help="where the page and figures/ are written")
    docs = parser.parse_args().docs
    printed = {}
    for folder in CHAPTERS:
        sys.path.insert(0, str(EXAMPLES / folder))
        for name in scripts(folder):
            found = import_module(name).main(docs / "figures")
            printed[folder, name] = found if isinstance(found, str) else found.numbers
    (docs / FILE).write_text(page(printed), encoding="utf-8")
