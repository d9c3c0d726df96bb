"""Writes docs/performance.md from the JSON files of the benchmarks: ``python benchmarks/page.py FILE... > PAGE``.

Nanoseconds are not shown: they belong to a machine.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

INTRODUCTION = """# Performance

A sample of any compensator takes at most 0.3 µs as an FMU. A closed loop with LuGre friction takes 2 ms for 1 s in
steps of 0.1 ms: the engine is faster than a loop in C that calls the functions of FMI, and 30 to 230 times as fast as
fmpy, ecos and libcosim. A ratio below 1 in the tables means faster than the other program.

A ratio of times compares the fastest rounds of two programs that run in turn. Ratios vary by some 20 % between
machines and runs; errors do not. To repeat the measurements (ecos needs Debian's libtbb12):

```console
$ pip install -e .[bench]
"""

SECTIONS = {
    "blocks": """## A step of a friction model

The time of one `fmi2DoStep` relative to that of the same law as a plain C function (`benchmarks/laws.h`), with held
velocities and steps of 0.1 ms. The plain function has no checks, no roll-back and no outputs except the force. An FMU
adds 6 to 9 ns for the checks of the time, the copy for a failed step, and the check that all results are finite. A law
that takes 5 ns is therefore several times slower as an FMU, one that takes 30 ns or more hardly.
""",
    "laws": """## A sample of a law

Each compensator law is measured as the C that `friction-fmus codegen` writes (in double and in float), as FMU (with
all inputs set and all results read around `fmi2DoStep`), and in casadi's virtual machine. Inputs are random. The FMU
and the exported C give the same bits.

Casadi's buffer is called from Python (this includes 0.1 µs for the call) and in a loop in C (the virtual machine
alone). The map over all samples also reads every argument from RAM.

Two laws are also written by hand (`benchmarks/hand/`), with and without branches; the faster version counts. Their
outputs agree to 1e-9. Random samples make branches hard to predict; the motion is a sine.

The variants, relative to exported C, show what makes a law fast: calling the C library only where necessary, and
computing each side of a decision only where it is needed. Casadi's own C computes both sides or, with short-circuit,
calls functions. An implicit step gives other numbers.
""",
    "harness": """## Co-simulation

Two pairs of FMUs run in steps of 0.1 ms: in the engine, in a C loop over the same `fmi2` functions
(`benchmarks/c_loop.c`), in a loop with fmpy's `FMU2Slave`, in ecos and in libcosim. All record the same variables.
Times are processor times without the start, of the fastest round or as the median ratio of 60 rounds. A whole run has
200 000 steps and includes its start and its `Dataset`.

Two Quantisers are the cheapest blocks and show the engine itself. Mass and LuGre, in a loop whose values and energy are
monitored, are blocks of usual cost.

Stick-slip is figure 6 of Canudas de Wit, Olsson, Astrom and Lischinsky (1995). Its errors are those of the period,
6.36271982 s, or of the position against scipy's Radau at 1e-10. MuJoCo computes it with its own LuGre friction of a DC
motor, on a sliding joint; Euler is its default integrator. RK4 comes closer to `newton`, with four evaluations a step
instead of 1.3.

In the servo loop at 2 kHz a feedforward is computed before or after the plant. Its held force is late by half a sample
on average, and by one and a half if it is computed after the plant. In sliding without reversals, the tracking error
triples; with reversals, the order hardly matters.
""",
    "systems": """## Whole systems and batches

The engine steps blocks and laws of this project by calls of their own (`fmu_src/direct.h`), which set, step and read a
part at once. They are compared with the functions of FMI, which foreign FMUs have, with servo loops written by hand in
C (`benchmarks/servos.c`: no checks, no states to save, no measurement of coupling errors, one recorded variable, the
plan of the profile made once; positions agree to 1e-7 m), and with the same system as one FMU. The pulled mass sticks
and slips; its C (`benchmarks/pulled_mass.c`) solves each step as `newton` does, without checking steps, and keeps what
depends on the length of a step only, as the block does; its positions agree to 1e-9 m. The servo (profile, PID, mass,
LuGre) and the GMS loop run under `gauss-seidel`, the others under `newton`.

"compiled" is the loop compiled for the system, with the blocks inlined (`--engine compiled`), bit for bit the same. Of
a step of the servo, it measures coupling errors for 15 ns and checks results for 10 ns, which C by hand does not; most
of the rest are the equations of the blocks. Under `newton` compiling gains nothing and is not offered: the solver calls
the blocks from many places, which cannot all be inlined.

One FMU is called through FMI, and copies its state before each communication step, so that a refused step changes
nothing. With ten inner steps in a communication step, it takes at most 2 % longer than the engine.

The servo of a batch is a PD controller at 10 kHz, a mass and LuGre friction, in steps of 0.1 ms, of which each call
makes ten. MuJoCo has it as a joint with a DC motor, whose LuGre friction it integrates, and an actuator with the
controller; its threaded rollout gets the whole reference in one call. Errors are the largest ones of x over its range,
against scipy's Radau at 1e-10 from sample to sample. fmpy steps one servo in a loop in Python.
""",
    "sweep": """## A sweep

1000 closed loops (a profile, a PID controller, a mass and LuGre friction) of 1 s in steps of 0.1 ms, 2 ms each. The
time includes the start of the workers. The gain of two workers depends on the load of the machine, like
that of two plain processes. The overhead (time of the workers over the time in their runs, two workers over one)
depends on it less. The loop over fmpy takes the same steps with the same FMUs, also resets instances, and calls every
value and step from Python.
""",
}


OF_THE_MACHINE = ("ns", "ms", "runs/s", "million/s")
"""Units of values that say nothing about other machines."""

MANY = 8
"""Number of subjects above which a quantity has a table of its own."""


def tables(rows: list[dict[str, Any]]) -> str:
    """Return the rows that hold on other machines, too, as tables with one subject or one quantity each.

    A row is named "subject: quantity". A value without a unit is a ratio.
    """
    shown = [row for row in rows if row["unit"] not in OF_THE_MACHINE]
    names = [row["name"].rpartition(": ") for row in shown]
    counts = Counter(quantity for _, _, quantity in names)
    found: dict[str, list[str]] = {}
    for row, (subject, _, quantity) in zip(shown, names, strict=True):
        heading, label = (quantity, subject) if counts[quantity] > MANY else (subject, quantity)
        unit = "" if row["unit"] in ("x", "") else f" {row['unit']}"
        target = "" if row["target"] is None else f"{row['target']:.3g}, {'met' if row['ok'] else '**not met**'}"
        lines = found.setdefault(heading, [f"| {heading} | value | target |", "|---|--:|---|"])
        lines.append(f"| {label} | {row['value']:.3g}{unit} | {target} |")
    return "\n\n".join("\n".join(lines) for lines in found.values())


def page(files: list[Path]) -> str:
    """Return the page for the results in these files, each named like its benchmark."""
    commands = [f"$ python benchmarks/{file.stem}.py --json {file.stem}.json" for file in files]
    commands.append(
        f"$ python benchmarks/page.py {' '.join(f'{file.stem}.json' for file in files)} > docs/performance.md"
    )
    parts = [INTRODUCTION + "\n".join(commands) + "\n```\n"]
    for file in files:
        rows = json.loads(file.read_text(encoding="utf-8"))
        parts.append(f"{SECTIONS[file.stem]}\n{tables(rows)}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    sys.stdout.write(page([Path(name) for name in sys.argv[1:]]))
