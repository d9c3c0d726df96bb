"""Writes docs/performance.md from the JSON files of the benchmarks: ``python benchmarks/page.py FILE... > PAGE``.

Only ratios measured in one run are shown: nanoseconds belong to a machine.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

INTRODUCTION = """# Performance

Ratios, each measured in one run with both sides in turn and the fastest round of each. They vary by some 20 % from
machine to machine and from run to run. To measure them here:

```console
"""

SECTIONS = {
    "blocks": """## A step of a friction model

One `fmi2DoStep` over the same law as a plain C function (`benchmarks/laws.h`), called in a loop, with the same compiler
flags and the same forces; held velocities, steps of 0.1 ms. The plain function has no checks, no roll-back, no outputs
but the force. What an FMU adds is 6 to 9 ns: the checks of the time, the copy to which a failed step returns, the
check that all results are finite. A law that is itself done in 5 ns is therefore several times slower as an FMU, one of
30 ns or more hardly.
""",
    "sweep": """## A sweep

1000 closed loops (a profile, a PID controller, a mass and LuGre friction) of 1 s in steps of 0.1 ms, 3 ms each: the
whole sweep, with the start of its workers and its files. The time of two workers over that of one is what the machine
had to spare while others used it; the overhead is the whole time of the workers over that in their runs, two over one:
with 1.0, two processors do twice the runs. The loop over fmpy takes the same steps of the same FMUs, with instances
that are reset too; every value and every step of it is a call from Python.
""",
}


def table(rows: list[dict[str, Any]]) -> list[str]:
    """The ratios among the rows."""
    lines = ["| | ratio | target | |", "|---|--:|--:|---|"]
    for row in rows:
        if row["unit"] == "x":
            target = "" if row["target"] is None else f"{row['target']:g}"
            mark = "" if row["target"] is None else "met" if row["ok"] else "not met"
            lines.append(f"| {row['name']} | {row['value']:.2g} | {target} | {mark} |")
    return lines


def page(files: list[Path]) -> str:
    """The page for the results in these files, each named like its benchmark."""
    commands = [f"$ python benchmarks/{file.stem}.py --json {file.stem}.json" for file in files]
    commands.append(
        f"$ python benchmarks/page.py {' '.join(f'{file.stem}.json' for file in files)} > docs/performance.md"
    )
    parts = [INTRODUCTION + "\n".join(commands) + "\n```\n"]
    for file in files:
        rows = json.loads(file.read_text(encoding="utf-8"))
        parts.append("\n".join([SECTIONS[file.stem], *table(rows)]) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    sys.stdout.write(page([Path(name) for name in sys.argv[1:]]))
