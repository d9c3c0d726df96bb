"""Floating-point types and syntax of Structured Text in IEC 61131-3, edition 3."""

import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.operations import LIBM
from friction_fmus.lawkit.emit.syntax import DOUBLE, PRODUCT, SUM, Real, Text, in_brackets, indented, statement

KEYWORDS = frozenset((Path(__file__).parent / "keywords.txt").read_text(encoding="utf-8").split())
"""Reserved words of the standard and of TwinCAT, standard functions, and index and constant of generated code."""

STANDARD = ("EXP", "LN", "EXPT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN")
"""Functions whose results are rounded as the controller does it."""
_NAMES = {"FABS": "ABS", "SQRT": "SQRT", "LOG": "LN", "POW": "EXPT", "CONSTPOW": "EXPT"} | {f: f for f in STANDARD}

_SPELLED = {"&&": "AND", "||": "OR", "==": "=", "!=": "<>", "!": "NOT ", "true": "TRUE", "false": "FALSE"}


@cache
def functions(real: str) -> Mapping[str, tuple[str, str]]:
    """Return how each function that Structured Text lacks is computed, and its text with ``PREFIX`` in names."""
    text = (Path(__file__).parent / "functions.st").read_text(encoding="utf-8")
    found = re.findall(r"\(\* ([^\n]+) \*\)\n(FUNCTION PREFIX_(\w+).*?END_FUNCTION\n)", text, re.DOTALL)
    return {name: (how, code if name == "fma" else code.replace("LREAL", real)) for how, code, name in found}


def spelled(text: str) -> str:
    """Return an expression of C with the operators of Structured Text."""
    return re.sub(r"&&|\|\||==|!=|!|\btrue\b|\bfalse\b", lambda match: _SPELLED[match[0]], text)


@dataclass(frozen=True)
class _StructuredReal(Real):
    """A floating-point type of Structured Text."""

    prefix: str = ""  # of the functions that Structured Text lacks
    locals: dict[str, tuple[str, int]] = field(default_factory=dict)
    """Types and sizes of the declared variables by name, because a block declares them before its statements."""

    def literal(self, value: float) -> str:
        if not math.isfinite(value):
            raise FrictionError(f"Structured Text has no literal for {value}: use a finite number, or the target c")
        mantissa, _, exponent = super().literal(value).partition("e")
        text = mantissa if "." in mantissa else f"{mantissa}.0"
        text += f"E{int(exponent)}" if exponent else ""
        if abs(value) < 3e38 and struct.unpack("f", struct.pack("f", value))[0] == value:
            return text  # the same number in REAL and in LREAL, whichever a compiler chooses
        return f"{'-' * text.startswith('-')}{self.name}#{text.removeprefix('-')}"

    def called(self, operation: str) -> str:
        name = LIBM[operation]
        if operation not in _NAMES and name not in functions(self.name):
            raise FrictionError(f"Structured Text has no function {name}: express it otherwise, or use the target c")
        return _NAMES.get(operation, f"{self.prefix}_{name}")

    def choice(self, condition: Text, first: Text, second: Text) -> str:
        return f"SEL({condition.text}, {second.text}, {first.text})"

    def assignment(self, place: str, value: Text, operator: str = "=") -> list[str]:
        if operator == "+=":
            value = Text(f"{place} + {in_brackets(value, PRODUCT)}", SUM)
        if value.sides:  # IF computes one side only, SEL both
            condition, *sides = value.sides
            return self.decision(condition, *(self.assignment(place, v) if v.text != place else [] for v in sides))
        first, *lines = statement(f"{place} = {value.text};")
        return list(map(spelled, [first.replace(" = ", " := ", 1), *lines]))

    def declared(self, kind: str, name: str, value: Text | None = None, size: int = 0) -> list[str]:
        self.locals[name] = (kind.removeprefix("const "), size)
        return self.assignment(name, value) if value else []

    def decision(self, condition: Text, first: Sequence[str], second: Sequence[str]) -> list[str]:
        lines = [f"IF {spelled(condition.text)} THEN", *indented(first or ["; (* nothing changes *)"])]
        outer = [line for line in second if not line.startswith(" ")]
        if not outer:
            return [*lines, "END_IF;"]
        if outer[0].startswith("IF ") and outer.index("END_IF;") == len(outer) - 1:
            return [*lines, f"ELS{second[0]}", *second[1:]]
        return [*lines, "ELSE", *indented(second), "END_IF;"]

    def loop(self, index: str, count: int, body: Sequence[str]) -> list[str]:
        return [f"FOR {index} := 0 TO {count - 1} DO", *indented(body), "END_FOR;"]

    def comment(self, text: str) -> str:
        return f"(*{super().comment(text.replace('*)', '* )').replace('(*', '( *'))[2:-2]}*)"


def real_type(c_type: Real, prefix: str) -> _StructuredReal:
    """Return the type that corresponds to a type of C."""
    name, limits = "LREAL" if c_type is DOUBLE else "REAL", (c_type.largest, c_type.smallest, c_type.bound)
    return _StructuredReal(name, "", "", *limits, "BOOL", "DINT_TO_{}({})", "(ABS({}) <= largest)", True, prefix)
