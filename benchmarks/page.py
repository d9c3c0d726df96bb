"""Writes docs/performance.md from the JSON files of the benchmarks: ``python benchmarks/page.py FILE... > PAGE``.

Nanoseconds are not shown: they belong to a machine.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

INTRODUCTION = """# Performance

Ratios of times are measured in one run with both sides in turn, the fastest round of each. They vary by some 20 % from
machine to machine and from run to run; errors do not. To measure them here, beside ecos (which needs Debian's
libtbb12), libcosim and MuJoCo:

```console
$ pip install -e .[bench]
"""

SECTIONS = {
    "blocks": """## A step of a friction model

One `fmi2DoStep` over the same law as a plain C function (`benchmarks/laws.h`), called in a loop, with the same compiler
flags and the same forces; held velocities, steps of 0.1 ms. The plain function has no checks, no roll-back, no outputs
but the force. What an FMU adds is 6 to 9 ns: the checks of the time, the copy to which a failed step returns, the
check that all results are finite. A law that is itself done in 5 ns is therefore several times slower as an FMU, one of
30 ns or more hardly.
""",
    "laws": """## A sample of a law

A compensator law as the C that `friction-fmus codegen` writes, in double and in float; as FMU, with all inputs set and
all results read around its `fmi2DoStep`; and in casadi's virtual machine. Random inputs, the same compiler flags, all
in turn in one process. The FMU and the exported C give the same bits.

Casadi's buffer interface is called from Python: that is Python's call of it, about 0.1 µs, and the virtual machine, but
not what Python takes to set the inputs. The same buffer called in a loop in C, with the inputs set and the states fed
back as for the exported C, is the virtual machine alone. Most of its time is in reading operations, about 2 ns each,
so the gain is least for laws that have few and call the C library. The map over all samples also fetches every
argument of every sample from memory.

Two laws are written by hand, too (`benchmarks/hand/`): with branches that compute no more than a sample needs, and
without. They take the same structs, give the same outputs and fault, to 1e-9. The faster one counts. On random samples
branches are hard to predict, and a tenth of the samples are not enabled; the motion is a sine.

What makes a law fast, as variants of these two over the exported C: a formulation that calls the C library only where
it must; and C in which what only one side of a decision needs is computed on that side. In casadi's own C both sides
are computed, or, with short-circuit, functions called. `-fno-math-errno` gains a few per cent at most, -O3 nothing;
whether the file is included or compiled by itself makes no difference, so it is up to the user. An implicit step in
place of the exact one takes half the time of the LuGre observer; but it is another law, with other numbers.
""",
    "harness": """## Co-simulation

Two pairs of FMUs, in steps of 0.1 ms: in the engine, in a loop by hand in C over the same `fmi2` functions
(`benchmarks/c_loop.c`), in a loop with fmpy's `FMU2Slave`, in ecos and in libcosim, the last two told once to do all
steps. All record the same variables; processor time without the start; the fastest round, and the median of the ratios
of 60 rounds. A whole run is one of 200 000 steps with its start and its `Dataset`.

Two Quantisers in a row are the cheapest blocks, so they show the engine itself: it adds about a sixth to their time,
for values that go through a table of signals. Mass and LuGre, in a loop of two wires whose values and energy are
watched, are blocks of usual cost.

Stick-slip is figure 6 of Canudas de Wit, Olsson, Astrom and Lischinsky (1995); errors are those of its period,
6.36271982 s, or of the position against scipy's Radau at 1e-10. MuJoCo computes the same with its own LuGre friction,
that of a DC motor, on a sliding joint; Euler is its default integrator. With RK4, four evaluations a step where
`newton` takes 1.3, it comes nearer.

In the servo loop at 2 kHz a feedforward is computed before or behind the plant. Held for a sample its force is half a
sample late on the mean, computed behind the plant one and a half: where timing is all that is wrong with it, in sliding
without reversal, the tracking error triples. In motion that reverses the error is mostly that of presliding friction,
which this feedforward does not have, and the order hardly matters.
""",
    "sweep": """## A sweep

1000 closed loops (a profile, a PID controller, a mass and LuGre friction) of 1 s in steps of 0.1 ms, 3 ms each: the
whole sweep, with the start of its workers and its files. What two workers gain depends on what others do on the
machine, as it does for two plain processes. The overhead, the whole time of the workers over that in their runs, two
workers over one, depends on it less. The loop over fmpy takes the same steps of the same FMUs, with instances that are
reset too; every value and every step of it is a call from Python.
""",
}


OF_THE_MACHINE = ("ns", "ms", "runs/s")
"""Units of what says nothing about other machines."""


def table(rows: list[dict[str, Any]]) -> list[str]:
    """The rows that hold on other machines, too; a value without a unit is a ratio."""
    lines = ["| | value | target | |", "|---|--:|--:|---|"]
    for row in rows:
        if row["unit"] not in OF_THE_MACHINE:
            unit = "" if row["unit"] in ("x", "") else f" {row['unit']}"
            target = "" if row["target"] is None else f"{row['target']:.3g}"
            mark = "" if row["target"] is None else "met" if row["ok"] else "not met"
            lines.append(f"| {row['name']} | {row['value']:.3g}{unit} | {target} | {mark} |")
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
