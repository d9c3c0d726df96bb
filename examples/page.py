"""docs/claims.md, docs/effects.md and their figures, made by the scripts: ``python examples/page.py docs``."""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

EXAMPLES = Path(__file__).resolve().parent


class Page(NamedTuple):
    """A page of the documentation: its file, and how it begins."""

    file: str
    introduction: str


PAGES = {
    "models": Page(
        "claims.md",
        """# What the models can and cannot do

The study of friction models and friction compensation from which this project started makes claims about the models.
Here each of them is a script that drives the FMUs, draws a figure and asserts the claim. All parameters are the start
values of the FMUs, unless it is said otherwise.
""",
    ),
    "compensation": Page(
        "effects.md",
        """# What friction does to a control loop, and what compensation does about it

Each effect is a script that closes the loop with the FMUs, draws a figure and asserts what it shows. Unless it is
said otherwise the loop is an axis of 1 kg with LuGre friction, with the parameters of its 1995 paper, under a PID at
2 kHz that places three poles at 15 Hz, with feedforward of the inertia. All figures with their bounds are in
[compensation.md](compensation.md).
""",
    ),
}
"""Folder of scripts -> the page that shows them."""


def scripts(folder: str) -> dict[str, Path]:
    """The scripts of a folder, by name."""
    paths = sorted(path for path in (EXAMPLES / folder).glob("*.py") if not path.name.startswith("_"))
    return {path.stem: path for path in paths}


def section(folder: str, name: str, numbers: str) -> str:
    """The section of a script: its docstring, the numbers that it printed, its figure and its command."""
    text = scripts(folder)[name].read_text(encoding="utf-8")
    title, _, text = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
    return f"""## {title}

{text.strip()}

> {numbers}

![{title}](figures/{name}.png)

```sh
python examples/{folder}/{name}.py figures
```
"""


def page(folder: str, numbers: Mapping[str, str]) -> str:
    """The page of a folder, from the numbers that each script printed."""
    return "\n".join([PAGES[folder].introduction, *(section(folder, name, numbers[name]) for name in scripts(folder))])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("docs", type=Path, help="where the pages and figures/ are written")
    docs = parser.parse_args().docs
    for folder, (file, _) in PAGES.items():
        sys.path.insert(0, str(EXAMPLES / folder))
        found = {name: import_module(name).main(docs / "figures") for name in scripts(folder)}
        numbers = {name: each if isinstance(each, str) else each.numbers for name, each in found.items()}
        (docs / file).write_text(page(folder, numbers), encoding="utf-8")
