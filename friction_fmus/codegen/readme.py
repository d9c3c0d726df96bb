"""The README of an exported law."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

from friction_fmus.codegen.cost import COMPILER, EMULATOR, FLAGS, PACKAGES, Cost
from friction_fmus.codegen.sources import Export
from friction_fmus.version import VERSION


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

## Cost

{_table(costs) if costs else _not_measured()}
"""


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
