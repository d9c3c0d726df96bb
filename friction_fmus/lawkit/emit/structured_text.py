"""Structured Text of IEC 61131-3, edition 3: its syntax, floating-point types, keywords, and missing functions."""

import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.names import DOUBLE, FLOAT, Real
from friction_fmus.lawkit.emit.operations import LIBM
from friction_fmus.lawkit.emit.syntax import PRIMARY, PRODUCT, SUM, Syntax, Text, in_brackets, indented, statement

_WORDS = """ABS ABSTRACT ACOS ACTION ADD ADR AND ANDN AND_THEN ANY ARRAY ASIN AT ATAN ATAN2 BITADR BOOL BY BYTE CAL CALC
CALCN CASE CD CEIL CHAR CLASS CLK CONCAT CONFIGURATION CONSTANT CONTINUE COS CTD CTU CTUD CU D DATE DATE_AND_TIME DELETE
DINT DIV DO DS DT DWORD ELSE ELSIF EN ENO EQ EXIT EXP EXPT EXTENDS FALSE FINAL FIND FLOOR FOR FROM FUNCTION F_EDGE
F_TRIG GE GT I IF IMPLEMENTS IN INDEXOF INI INSERT INT INTERFACE INTERNAL INTERVAL JMP JMPC JMPCN L LARGEST LD LDATE LDN
LDT LE LEFT LEN LIMIT LINT LN LOG LREAL LT LTIME LTOD LWORD MAX METHOD MID MIN MOD MOVE MUL MUX N NAMESPACE NE NOT NULL
OF ON OR ORN OR_ELSE OVERLAP OVERRIDE P PARAMS PERSISTENT POINTER PRIORITY PRIVATE PROGRAM PROPERTY PROTECTED PT PUBLIC
PV R R1 READ_ONLY READ_WRITE REAL REF REFERENCE REF_TO REPEAT REPLACE RESOURCE RET RETAIN RETC RETCN RETURN RIGHT ROL
ROR RS RTC R_EDGE R_TRIG S S1 SD SEL SEMA SHL SHR SIN SINGLE SINT SIZEOF SL SQRT SR ST STEP STN STRING STRUCT SUB SUPER
TAN TASK THEN THIS TIME TIME_OF_DAY TO TOD TOF TON TP TRANSITION TRUE TRUNC TYPE UDINT UINT ULINT UNION UNTIL USINT
USING VAR WCHAR WHILE WITH WORD WSTRING XOR XORN"""
KEYWORDS = frozenset(_WORDS.split())
"""Reserved words, also of TwinCAT, operators of Instruction List, qualifiers of actions, standard functions, and the
index and the constant of generated code."""

_STANDARD = {"FABS": "ABS", "LOG": "LN", "POW": "EXPT", "CONSTPOW": "EXPT"}
_STANDARD |= {name: name for name in ("EXP", "SQRT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN")}

_SPELLED = {"&&": "AND", "||": "OR", "==": "=", "!=": "<>", "!": "NOT ", "true": "TRUE", "false": "FALSE"}


def spelled(text: str) -> str:
    """Return an expression of C with the operators of Structured Text."""
    return re.sub(r"&&|\|\||==|!=|!|\btrue\b|\bfalse\b", lambda match: _SPELLED[match[0]], text)


@dataclass(frozen=True)
class _StructuredText(Syntax):
    """The syntax of Structured Text; declarations are elsewhere."""

    prefix: str  # prefix of the functions that Structured Text lacks

    integer = "DINT"
    flag = "BOOL"

    def key(self, name: str) -> str:
        return name.upper()

    def called(self, operation: str, suffix: str) -> str:
        name = LIBM[operation]
        if operation not in _STANDARD and name not in functions("LREAL"):
            raise FrictionError(
                f"Structured Text has no function {name}: write the law without it, or choose the target c"
            )
        return _STANDARD.get(operation, f"{self.prefix}_{name}")

    def converted(self, index: str, real: str) -> Text:
        return Text(f"{self.integer}_TO_{real}({index})", PRIMARY, frozenset())

    def choice(self, condition: Text, first: Text, second: Text) -> str:
        return f"SEL({condition.text}, {second.text}, {first.text})"

    def assignment(self, place: str, value: Text) -> list[str]:
        if value.sides:  # unlike SEL, IF computes one side only
            condition, *sides = value.sides
            first, second = (self.assignment(place, side) if side.text != place else [] for side in sides)
            return self.decision(condition, first, second)
        first_line, *lines = statement(f"{place} = {value.text};")
        return list(map(spelled, [first_line.replace(" = ", " := ", 1), *lines]))

    def increase(self, name: str, term: Text) -> list[str]:
        return self.assignment(name, Text(f"{name} + {in_brackets(term, PRODUCT)}", SUM, term.reads))

    def constant(self, kind: str, name: str, value: Text) -> list[str]:
        return self.assignment(name, value)

    def variable(self, kind: str, name: str, value: Text | None = None, size: int = 0) -> list[str]:
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

    def comment_text(self, text: str) -> str:
        return super().comment_text(text).replace("*)", "* )").replace("(*", "( *")

    def comment(self, text: str) -> str:
        return f"(*{super().comment(text)[2:-2]}*)"


class _StructuredReal(Real):
    """A floating-point type of Structured Text."""

    def literal(self, value: float) -> str:
        if not math.isfinite(value):
            raise FrictionError(f"Structured Text has no literal for {value}: use a finite number, or the target c")
        mantissa, _, exponent = super().literal(value).partition("e")
        text = mantissa if "." in mantissa else f"{mantissa}.0"
        text += f"E{int(exponent)}" if exponent else ""
        if abs(value) < FLOAT.largest and struct.unpack("f", struct.pack("f", value))[0] == value:
            return text  # the same number in REAL and in LREAL, whichever a compiler chooses
        return f"{'-' * text.startswith('-')}{self.name}#{text.removeprefix('-')}"

    def finite(self, place: str) -> str:
        return f"(ABS({place}) <= largest)"


def real_type(c_type: Real, prefix: str) -> Real:
    """Return the type that corresponds to a type of C."""
    limits = (c_type.largest, c_type.smallest, c_type.bound)
    return _StructuredReal("LREAL" if c_type is DOUBLE else "REAL", "", "", *limits, _StructuredText(prefix))


@cache
def functions(real: str) -> Mapping[str, tuple[str, str]]:
    """Return how each function that Structured Text lacks is computed, and its text with ``PREFIX`` in names."""
    text = (Path(__file__).parent / "functions.st").read_text(encoding="utf-8")
    found = re.findall(r"\(\* ([^\n]+) \*\)\n(FUNCTION PREFIX_(\w+).*?END_FUNCTION\n)", text, re.DOTALL)
    return {name: (how, code if name == "fma" else code.replace("LREAL", real)) for how, code, name in found}


comment = _StructuredText("").comment
