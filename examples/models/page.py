"""docs/claims.md and its figures, made by the claims: ``python examples/models/page.py docs``."""

from __future__ import annotations

import argparse
import ast
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

INTRODUCTION = """# What the models can and cannot do

The study of friction models and friction compensation from which this project started makes claims about the models.
Here each of them is a script that drives the FMUs, draws a figure and asserts the claim. All parameters are the start
values of the FMUs, unless it is said otherwise.
"""


def claims() -> dict[str, Path]:
    """The scripts by name."""
    own = Path(__file__)
    scripts = sorted(path for path in own.parent.glob("*.py") if path != own and not path.name.startswith("_"))
    return {path.stem: path for path in scripts}


def section(name: str, numbers: str) -> str:
    """The section of a claim: its docstring, the numbers that it printed, its figure and its command."""
    title, _, text = (ast.get_docstring(ast.parse(claims()[name].read_text(encoding="utf-8"))) or "").partition("\n")
    return f"""## {title}

{text.strip()}

> {numbers}

![{title}](figures/{name}.png)

```sh
python examples/models/{name}.py figures
```
"""


def page(numbers: Mapping[str, str]) -> str:
    """The page, from the numbers that each script printed."""
    return "\n".join([INTRODUCTION, *(section(name, numbers[name]) for name in claims())])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path, help="where claims.md and figures/ are written")
    folder = parser.parse_args().folder
    numbers = {name: import_module(name).main(folder / "figures") for name in claims()}
    (folder / "claims.md").write_text(page(numbers), encoding="utf-8")
