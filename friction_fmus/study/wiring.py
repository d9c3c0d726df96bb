"""The README of the recommended compensator: every connection of its parts, as in the co-simulated axis."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from friction_fmus.axis.assembly import block
from friction_fmus.axis.loop import RECORDED
from friction_fmus.axis.servo import Servo
from friction_fmus.blocks.axis_units import Words
from friction_fmus.codegen.loop import LOOP_FILE
from harness import FmuPart, System, Wire
from harness.system.wire import parse_wire, split_name

REFERENCE: Final = "reference.r"
ERROR: Final = "tracking_error"
"""Part with the reference minus the position."""


def with_tracking_error(system: System) -> System:
    """Return the system of an axis with a part that computes the tracking error, and with more recorded variables."""
    assert system.experiment is not None
    # at the samples only, because the reference has its new value only then
    part = FmuPart(ERROR, block("Sum"), every=system.experiment.decimate)
    parts = [*system.parts.values(), part]
    wires: list[str | Wire] = [*system.wires, f"{REFERENCE} -> {ERROR}.u1", f"axis.x -> {ERROR}.u2"]
    start = {**system.start, f"{ERROR}.gain[2]": -1.0}
    experiment = replace(system.experiment, record=(REFERENCE, RECORDED[0], f"{ERROR}.y", *RECORDED[1:]))
    return System(parts, wires, start, experiment, system.name)


PLANT: Final = ("axis", "friction", "position", "encoder", "measured", "noise", ERROR)
"""Parts that stand for the machine or compute the tracking error; the README has the connections of all others."""

SUMS: Final = ("force", "unexplained")
"""Parts that add their inputs u1, u2, ..., multiplied by gain[1], gain[2], ... (1 if not in the table)."""

NOTHING: Final = (
    "# Recommended compensator\n\nNo compensator is recommended: `axis.ssp` contains the servo without one.\n"
)
"""README if nothing is recommended."""

LAWS: Final = ("compensator", "feedforward")
"""Parts that are added to the servo."""


@dataclass(frozen=True)
class Figures:
    """Figures of the report that the files reproduce."""

    rms: float
    """Tracking error [m or rad]."""
    unit: str
    """Unit of the position."""


def wiring(system: System, servo: Servo, figures: Figures | None, no_code: str, u: Words) -> str:
    """Return the README of the folder of the recommendation."""
    assert system.experiment is not None
    every = round(servo.Ts / system.experiment.step)
    wires = [wire for wire in map(parse_wire, system.wires) if split_name(wire.target)[0] not in PLANT]
    lines = ["# Recommended compensator"]
    for text in _paragraphs(system, servo, wires, figures, no_code, u):
        lines += ["", textwrap.fill(text, 120, break_on_hyphens=False, break_long_words=False)]
    lines += ["", "| input | value | delay [samples] |", "|---|---|--:|"]
    lines += [f"| `{wire.target}` | {_value(wire)} | {wire.delay // every} |" for wire in wires]
    for target, value in sorted(_constants(system)):
        lines.append(f"| `{target}` | {value!r} | 0 |")
    return "\n".join(lines) + "\n"


def _paragraphs(
    system: System, servo: Servo, wires: list[Wire], figures: Figures | None, no_code: str, u: Words
) -> Iterator[str]:
    """Yield the paragraphs above the table."""
    yield (
        f"The laws are sampled every {servo.Ts:g} s, together with the servo. The table lists every input of the "
        "sampled parts of `axis.ssp`, in the units of the axis."
    )
    for wire in wires:
        part, output = split_name(wire.source)
        if part in LAWS and output != "u" and split_name(wire.target)[0] in ("servo", *SUMS):
            yield f"Use the output `{output}` of `{part}`. Its output `u` is the {u.force} of a whole controller."
    if "table" in system.parts:
        yield (
            f"`table` is the identified {u.force} over position at the reference, see `PositionMap.fmu` and the table "
            "in its sources; subtract it. Because of the table, there is no C code of the loop."
        )
    sums = [f"`{name}.y`" for name in SUMS if name in system.parts]
    if sums:
        yield f"{' and '.join(sums)} = gain[1] u1 + gain[2] u2 + ..., where a gain that is not in the table is 1."
    if any(wire.source == "servo.u" for wire in wires):
        yield f"`servo.u` is the {u.force} of the drive after all limits; a delay of 1 stands for the previous sample."
    yield (
        "Start all parts together, with the axis at rest on the reference, as in the run of the report: only then do "
        "the start values of the laws fit the motion."
    )
    table = "`loop_table(r, rd)` to `f_known`, " if "table" in system.parts else ""
    yield no_code or (
        f"`c/` contains all of this as one function, from `{LOOP_FILE}`: servo, laws, velocity, sums, limits and "
        f"delays. Once per sample, assign reference and measured position to `loop_inputs`, {table}call `loop_step`, "
        "and pass `u` to the drive."
    )
    if figures is not None:
        yield (
            f"The tracking error of the report is {figures.rms:.4g} {figures.unit} rms; `friction-fmus run axis.ssp` "
            "repeats its run."
        )


def _value(wire: Wire) -> str:
    """Return gain, source and offset as a formula with all digits."""
    gain = "" if wire.gain == 1.0 else f"{wire.gain!r} × "
    sign = "+" if wire.offset >= 0.0 else "-"
    offset = "" if wire.offset == 0.0 else f" {sign} {abs(wire.offset)!r}"
    return f"{gain}`{wire.source}`{offset}"


def _constants(system: System) -> Iterator[tuple[str, float]]:
    """Yield the inputs of sampled parts that are constant, with their values."""
    for name, part in system.parts.items():
        if name in PLANT or not isinstance(part, FmuPart):
            continue
        inputs = {port.name for port in part.inputs} | {f"gain[{i}]" for i in (1, 2, 3) if name in SUMS}
        for target, value in system.start.items():
            if split_name(target)[0] == name and split_name(target)[1] in inputs and not isinstance(value, str):
                yield target, float(value)
