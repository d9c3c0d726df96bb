"""The C source of a block with other start values or another name, as in a customised FMU."""

import hashlib
import re
from collections.abc import Mapping
from numbers import Integral

from friction_fmus.blocks.macros import argument_spans, block_header, start_arguments, table
from friction_fmus.errors import BuildError, UnknownNameError, did_you_mean

Start = Mapping[str, float | int | bool | str]


def renamed(code: str, name: str) -> str:
    """Return the source with another model identifier."""
    if not re.fullmatch(r"[A-Za-z]\w*", name):
        raise BuildError(
            f"{name!r} is not a valid name of an FMU; use letters, digits and underscores, and begin with a letter"
        )
    return re.sub(r"^(#define\s+MODEL\s+)\w+", rf"\g<1>{name}", code, count=1, flags=re.M)


def identified(sources: Mapping[str, str], name: str) -> dict[str, str]:
    """Return the sources with a hash of them in the block, for the GUID: states saved by other code are rejected."""
    text = "\0".join(part for item in sorted(sources.items()) for part in item)
    line = f'#define IDENTITY "{hashlib.sha256(text.encode()).hexdigest()[:32]}"\n'
    block = f"{name}.c"
    return {**sources, block: re.sub(r"^(?=#define\s+MODEL\b)", line, sources[block], count=1, flags=re.M)}


def rotational(code: str) -> str:
    """Return the source of the rotational twin, with torques for forces and angles for lengths."""
    return re.sub(r"^(#define\s+MODEL\s+\w+)$", r"#define ROTATIONAL\n\1Rotational", code, count=1, flags=re.M)


def with_long_arrays(code: str, name: str, start: Start) -> str:
    """Return the source with arrays that are long enough for these start values."""
    # A row ``SIZE(N, LONGEST, 16384)`` of its macro ``SIZES`` states that the parameter N can be up to the value of the
    # macro ``LONGEST``, a number, which can be raised to 16384.
    for _, arguments in table(code, "SIZES", ("SIZE",)):
        parameter, limit, most = (*arguments, "", "", "")[:3]
        definition = re.compile(rf"^(#define\s+{re.escape(limit)}\s+)(\d+)$", re.M)
        found = definition.search(code)
        if found is None or not most.isdecimal():
            raise BuildError(
                f"{name} has the malformed row SIZE({', '.join(arguments)}); write SIZE(parameter, macro, largest "
                "size) and define the macro as a number"
            )
        present, value = int(found[2]), float(start.get(parameter, 0.0))
        if present < value < float("inf"):
            if value > int(most) or value != int(value):
                rule = f"above {present}, give an integer up to {most}"
                raise BuildError(f"{name} cannot have {parameter} = {value:g}: {rule}")
            code = definition.sub(rf"\g<1>{int(value)}", code)
    return code


def with_start_values(code: str, start: Start) -> str:
    """Return the source with other start values in its VARIABLES table; Fn has that of Fn0 unless it is given."""
    if "Fn0" in start and re.search(r"\(\s*Fn\s*,", code):
        start = {"Fn": start["Fn0"], **start}
    for variable, value in start.items():
        if isinstance(value, str):
            raise BuildError(f"The start value {variable} = {value!r} is not a number; give one, also with a unit")
        if not float(value) - float(value) == 0.0:
            raise BuildError(f"The start value {variable} = {value} is not finite; give a finite number")
        code = _with_start_value(code, variable, value)
    return code


def _with_start_value(code: str, variable: str, value: float | int | bool) -> str:
    places = start_arguments(block_header())
    rows = {row[2]: row for row in re.finditer(rf"\b({'|'.join(places)})\s*\(\s*(\w+)\s*,", code)}
    element = re.fullmatch(r"(\w+)\[(\d+)\]", variable)
    name = element.group(1) if element else variable
    if name not in rows or places[rows[name][1]][1] != bool(element):
        raise UnknownNameError(f"There is no variable {variable!r} with a start value{did_you_mean(variable, rows)}")
    match = rows[name]
    spans, _ = argument_spans(code, match.start(2), "VARIABLES", BuildError)
    span = spans[places[match[1]][0]]
    text = str(int(value)) if isinstance(value, Integral) else repr(float(value))
    if element:
        values = [part.strip() for part in code[span].strip("()").split(",")]
        number = int(element.group(2))
        length = int(code[spans[1]])
        if not 1 <= number <= length:
            raise UnknownNameError(f"There is no variable {variable!r}; the elements of {name} are 1 to {length}")
        values += ["0.0"] * (number - len(values))
        values[number - 1] = text
        text = f"({', '.join(values)})"
    return code[: span.start] + text + code[span.stop :]
