"""The README of an exported law."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

from friction_fmus.codegen.cost import COMPILER, EMULATOR, FLAGS, PACKAGES, Cost
from friction_fmus.codegen.layout import Export
from friction_fmus.version import VERSION

TRAVEL = (0.0, 0.1, 1.0, 10.0)
"""Distances from zero [m] at which float is compared with double."""

ACCURACY = 1e-4
"""Largest difference there of an output, in its rms value."""


def readme(export: Export, costs: Sequence[Cost]) -> str:
    """Its text.

    Parameters
    ----------
    export : Export
        What was written.
    costs : sequence of Cost
        Of each core, empty without a cross compiler.
    """
    p, law, real = export.prefix, export.law, export.real.name
    called = ", ".join(f"`{name}`" for name in sorted(export.kernel.functions))
    library = f"calls {called} of the C library" if called else "calls nothing of the C library"
    origin = (
        f"{law.summary}. Source: {law.source}. Written by friction-fmus {VERSION} from `{law.path.name}`, with all "
        f"numbers in `{real}`; `{p}.h` has the equations and says what every variable is."
    )
    files = (
        f"* `{p}.h`, `{p}.c`: the law. C89 and C99, no allocation, no variables but in the four structs, so that one "
        f"program may have several instances. It {library}."
    )
    use = (
        f"`{p}_init` writes the start values, `{p}_check` says whether parameters can be used, `{p}_step` takes one "
        "sample and is called every `Ts` seconds. While an input is NaN or infinite the outputs and states stay as "
        f"they are and `fault` is 1. {_agreement(real)} Do not compile with `-ffast-math`."
    )
    return f"""# {law.name} in C

{_fill(origin)}

{_fill(files, "  ")}
* `main.c`: an example, `cc main.c {p}.c -lm`.

{_fill(use)}
{_positions(export)}
## Cost

{_table(costs) if costs else _not_measured()}
"""


_PAIRS = """
## Positions

{positions}

```c
/* from a double, or any type that has the digits */
inputs.{name} = (float)position;
inputs.{name}_low = (float)(position - (double)inputs.{name});
```

```c
/* from the count n of an encoder of the step q, to 1/2000 of q; n is a long, q a float */
const float fine = (float)(n % 4096) * q, coarse = (float)(n - n % 4096);
const float product = coarse * q, rest = fmaf(coarse, q, -product) + fine;
inputs.{name} = product + rest;
inputs.{name}_low = rest - (inputs.{name} - product);
```

{accuracy}
"""


def _positions(export: Export) -> str:
    """How positions are given in float, and how accurate the law is far from zero."""
    if not export.real.suffix:
        return ""
    loss = ""
    if export.rounded:
        loss = f" This law rounds an absolute position to one float before it calls {', '.join(export.rounded)}."
    if not export.pairs:
        what = "No two positions are subtracted" if export.positions else "No input is a position"
        return f"\n{_fill(f'{what}: the relative accuracy does not depend on where the axis stands.{loss}')}\n"
    names = {group: [v.name for v in members if v.name in export.pairs] for group, members in export.groups.items()}
    listed = "; ".join(
        f"{group}: {', '.join(f'`{name}`' for name in found)}" for group, found in names.items() if found
    )
    first = names["inputs"][0]
    text = (
        "A float resolves 60 nm at 1 m, too little for the difference of two positions. So each absolute position is "
        f"the sum of two floats: `{first}` is the position rounded to float, `{first}_low` what that leaves. The sum "
        f"resolves 0.02 pm at 10 m. The variables of this kind are: {listed}. If `{first}_low` stays 0, the position "
        f"is what `{first}` holds."
    )
    distances = ", ".join(f"{distance:g}" for distance in TRAVEL[:-1])
    accuracy = (
        f"On motions of 25 µm and of 5 mm about {distances} and {TRAVEL[-1]:g} m the outputs of the laws that come "
        f"with friction-fmus differ from those in double by less than {ACCURACY:g} of their rms value."
    )
    accuracy += loss
    return _PAIRS.format(name=first, positions=_fill(text), accuracy=_fill(accuracy))


def _fill(text: str, indent: str = "") -> str:
    return textwrap.fill(text, 120, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False)


def _agreement(real: str) -> str:
    if real == "float":
        return "The numbers are those of the FMU up to the rounding of single precision."
    return "With `-ffp-contract=off` and the same C library the numbers are those of the FMU bit by bit."


def _not_measured() -> str:
    return _fill(
        f"It was not measured: {COMPILER} was not there. On Debian `apt-get install {' '.join(PACKAGES.values())}` "
        "installs what is needed; then run `friction-fmus codegen` again."
    )


_ROWS: tuple[tuple[str, Callable[[Cost], float | None]], ...] = (
    ("flash of the law [bytes]", lambda cost: cost.code),
    ("flash with what it calls [bytes]", lambda cost: cost.flash),
    ("RAM of an instance [bytes]", lambda cost: cost.instance),
    ("RAM of the C library [bytes]", lambda cost: cost.static),
    ("stack of its functions [bytes]", lambda cost: cost.frame),
    ("stack with what it calls [bytes]", lambda cost: cost.stack),
    ("instructions of a step, mean", lambda cost: cost.mean),
    ("instructions of a step, most", lambda cost: cost.most),
)


def _table(costs: Sequence[Cost]) -> str:
    lines = [
        f"| | {' | '.join(cost.core.name for cost in costs)} |",
        f"|---|{'--:|' * len(costs)}",
    ]
    for title, value in _ROWS:
        cells = [value(cost) for cost in costs]
        if None not in cells:
            lines.append(f"| {title} | {' | '.join(f'{cell:.0f}' for cell in cells)} |")
    counted = (
        "Instructions and the stack with what it calls were measured in qemu-arm over random inputs: instructions are "
        "no cycles, and other inputs may take other branches of the C library's functions."
        if costs[0].most is not None
        else f"Instructions were not counted: {EMULATOR} was not there; on Debian `apt-get install "
        f"{PACKAGES[EMULATOR]}` installs it."
    )
    explained = (
        "What it calls are functions of the C library and, where the core cannot compute them, floating-point "
        "operations. The stack of its functions is that of `-fstack-usage`, summed over the chain of calls. "
    )
    cores = "".join(f"* {cost.core.name}: `{' '.join(cost.core.flags)}`\n" for cost in costs)
    return "\n".join(
        [
            *lines,
            "",
            _fill(f"Measured with `{COMPILER} {' '.join(FLAGS)}`, newlib, and"),
            "",
            cores,
            _fill(explained + counted),
        ]
    )
