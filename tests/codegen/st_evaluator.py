"""Structured Text executed: the syntax tree of blark becomes Python, with the types and the arithmetic of the PLC.

AND, OR and SEL compute all operands; identifiers are equal in any case; an expression of the wrong type is an error.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from blark import transform as tree
from blark.parse import parse_source_code

LIBM = ctypes.CDLL(ctypes.util.find_library("m"))
STANDARD = {"EXP": "exp", "LN": "log", "EXPT": "pow", "SQRT": "sqrt", "SIN": "sin", "COS": "cos", "TAN": "tan"}
STANDARD |= {"ASIN": "asin", "ACOS": "acos", "ATAN": "atan", "ABS": "fabs"}
OPERATORS = {"=": "==", "<>": "!=", "AND": "&", "OR": "|"}


def libm(name: str, kind: str) -> Callable[..., Any]:
    """A function of the C library for LREAL or REAL."""
    function = getattr(LIBM, name + "f" * (kind == "REAL"))
    c_type, wrapped = (ctypes.c_double, float) if kind == "LREAL" else (ctypes.c_float, np.float32)
    function.restype = c_type
    function.argtypes = [c_type] * (2 if name in ("pow", "atan2", "fmod") else 1)
    return lambda *given: wrapped(function(*given))


def divided(a: float, b: float) -> float:
    """The quotient in IEEE 754."""
    try:
        return a / b
    except ZeroDivisionError:
        return math.nan if a == 0.0 or math.isnan(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)


def rounded_to_integer(x: Any) -> int:
    """As LREAL_TO_LINT: halves to even; the caller stays inside the range."""
    assert abs(x) < 2.0**63
    return round(float(x))


class Undefined:
    """The value of a variable before its first assignment."""

    def __bool__(self) -> bool:
        """Nothing may depend on it."""
        raise AssertionError("a temporary variable is read before it is assigned")


@dataclass
class Unit:
    """A function or function block as a Python function of a frame, a mapping of its variables."""

    name: str
    returns: str | None
    inputs: list[str] = field(default_factory=list)
    kinds: dict[str, str] = field(default_factory=dict)
    starts: dict[str, Any] = field(default_factory=dict)
    temporary: list[str] = field(default_factory=list)
    constant: set[str] = field(default_factory=set)
    code: Callable[[dict[str, Any]], None] | None = None


class Program:
    """All units of a text.

    Parameters
    ----------
    text : str
        Structured Text.
    kind : str
        LREAL or REAL.
    replaced : mapping of str to callable
        Functions in place of those of the text, by their names.
    """

    def __init__(
        self, text: str, kind: str = "LREAL", replaced: Mapping[str, Callable[..., Any]] | None = None
    ) -> None:
        """Parse and translate it."""
        parsed = parse_source_code(text)
        if parsed.exception:
            raise parsed.exception
        self.kind, self.units, self.replaced = kind, {}, {k.upper(): f for k, f in (replaced or {}).items()}
        number = float if kind == "LREAL" else np.float32
        self.scope: dict[str, Any] = {"divided": divided if kind == "LREAL" else (lambda a, b: a / b), "number": number}
        self.scope |= {name: libm(c_name, kind) for name, c_name in STANDARD.items()}
        self.scope |= {"SEL": lambda g, no, yes: yes if g else no, "LREAL_TO_REAL": np.float32, "REAL_TO_LREAL": float}
        for real in ("LREAL", "REAL"):
            self.scope |= {f"{integer}_TO_{real}": number for integer in ("DINT", "LINT")}
        self.results = dict.fromkeys(self.scope, kind) | {"LREAL_TO_REAL": "REAL", "REAL_TO_LREAL": "LREAL"}
        for integer in ("DINT", "LINT"):
            self.scope[f"{kind}_TO_{integer}"] = rounded_to_integer
            self.results[f"{kind}_TO_{integer}"] = integer
        for item in parsed.transform().items:
            unit = self._unit(item)
            self.units[unit.name] = unit
            if unit.returns:
                self.scope[unit.name] = self.replaced.get(unit.name) or self._callable(unit)
                self.results[unit.name] = unit.returns

    def _callable(self, unit: Unit) -> Callable[..., Any]:
        def called(*given: Any) -> Any:
            frame = dict(unit.starts) | dict(zip(unit.inputs, given, strict=True))
            assert unit.code
            unit.code(frame)
            return frame[unit.name]

        return called

    def _unit(self, item: Any) -> Unit:
        unit = Unit(item.name.upper(), str(item.return_type) if isinstance(item, tree.Function) else None)
        returns = unit.returns
        for section in item.declarations:
            for declared in section.items:
                for variable in declared.variables:
                    name = variable.variable.name.upper()
                    assert name not in unit.kinds, f"{name} is declared twice"
                    self._declare(unit, name, declared.init)
                    if isinstance(section, tree.InputDeclarations):
                        unit.inputs.append(name)
                    elif isinstance(section, tree.TemporaryVariableDeclarations):
                        unit.temporary.append(name)
                    elif getattr(section, "attrs", None):
                        unit.constant.add(name)
        if returns:
            unit.kinds[unit.name] = returns
        lines = [f"def {unit.name}(s):", *Translator(self, unit).block(item.body)]
        scope = dict(self.scope)
        exec("\n".join(lines), scope)
        unit.code = scope[unit.name]
        return unit

    def _declare(self, unit: Unit, name: str, init: Any) -> None:
        number: Any = float if self.kind == "LREAL" else np.float32
        if isinstance(init, tree.ArrayTypeInitialization):
            (dimension,) = init.spec.subranges
            first, last = int(dimension.start.value), int(dimension.stop.value)
            assert first == 0
            kind = str(init.spec.type.type_name)
            unit.kinds[name] = f"{kind}[]"
            values = list(self._elements(init.value, kind)) if init.value else []
            if not values:
                values = [False if kind == "BOOL" else number(0.0)] * (last + 1)
            assert len(values) == last + 1
            unit.starts[name] = values
            return
        kind = unit.kinds[name] = str(init.spec.type)
        default: Any = {"BOOL": False, "DINT": 0}.get(kind, number(0.0))
        unit.starts[name] = self._constant(init.value, kind) if init.value is not None else default

    def _elements(self, value: Any, kind: str) -> Any:
        for one in value.elements:
            inner = one.element
            for _ in range(int(str(one.count.value)) if one.count else 1):
                if isinstance(inner, tree.ArrayInitialization):
                    yield from self._elements(inner, kind)
                else:
                    yield self._constant(inner, kind)

    def _constant(self, value: Any, kind: str) -> Any:
        code, found = Translator(self, Unit("", None)).expression(value)
        assert found == kind, (str(value), kind)
        return eval(code, dict(self.scope))


class Translator:
    """Translator of statements and expressions of one unit."""

    def __init__(self, program: Program, unit: Unit) -> None:
        """Remember the types of the variables."""
        self.program, self.unit = program, unit

    def block(self, statements: Any, indent: str = "    ") -> list[str]:
        """Lines of Python."""
        lines: list[str] = []
        for one in statements.statements if statements else ():
            lines += [f"{indent}{line}" for line in self.statement(one)]
        return lines or [f"{indent}pass"]

    def statement(self, one: Any) -> list[str]:
        """Lines of Python."""
        if isinstance(one, tree.AssignmentStatement):
            (variable,) = one.variables
            target, kind = self.expression(variable)
            assert str(variable).partition("[")[0].upper() not in self.unit.constant
            value, found = self.expression(one.expression)
            assert kind == found, f"{one}: {found} is assigned to {kind}"
            return [f"{target} = {value}"]
        if isinstance(one, tree.IfStatement):
            lines = [f"if {self.condition(one.if_expression)}:", *self.block(one.statements)]
            for other in one.else_ifs:
                lines += [f"elif {self.condition(other.if_expression)}:", *self.block(other.statements)]
            return lines + (["else:", *self.block(one.else_clause.statements)] if one.else_clause else [])
        if isinstance(one, tree.WhileStatement):
            return [f"while {self.condition(one.expression)}:", *self.block(one.statements)]
        if isinstance(one, tree.ForStatement):
            index, kind = self.expression(one.control)
            (begin, _), (end, _) = self.expression(one.from_), self.expression(one.to)
            assert kind == "DINT"
            assert one.step is None
            return [f"for {index} in range({begin}, {end} + 1):", *self.block(one.statements)]
        raise AssertionError(f"the statement {one!r} is not expected")

    def condition(self, expression: Any) -> str:
        """A truth value in Python."""
        code, kind = self.expression(expression)
        assert kind == "BOOL", str(expression)
        return code

    def expression(self, one: Any) -> tuple[str, str]:
        """Python, and the type in Structured Text."""
        real = self.program.kind
        if isinstance(one, tree.Real):
            assert "." in one.value
            value = float(one.value)
            assert one.type_name in (None, real)
            assert one.type_name or float(np.float32(value)) == value, f"{one} is rounded if it is taken as REAL"
            return (f"number({value!r})" if real == "REAL" else repr(value)), real
        if isinstance(one, tree.Integer):
            return str(int(one.value)), "DINT"
        if isinstance(one, tree.Boolean):
            return str(str(one.value).upper() == "TRUE"), "BOOL"
        if isinstance(one, tree.ParenthesizedExpression):
            code, kind = self.expression(one.expr)
            return f"({code})", kind
        if isinstance(one, tree.SimpleVariable):
            name = str(one.name).upper()
            return f"s[{name!r}]", self.unit.kinds[name]
        if isinstance(one, tree.MultiElementVariable):
            (element,) = one.elements
            (subscript,) = element.subscripts
            (place, kind), (index, of_index) = self.expression(one.name), self.expression(subscript)
            assert of_index == "DINT"
            assert kind.endswith("[]")
            return f"{place}[{index}]", kind.removesuffix("[]")
        if isinstance(one, tree.UnaryOperation):
            code, kind = self.expression(one.expr)
            assert (kind == "BOOL") == (one.op.upper() == "NOT")
            return (f"(not {code})" if kind == "BOOL" else f"(-{code})"), kind
        if isinstance(one, tree.BinaryOperation):
            return self.binary(one)
        if isinstance(one, tree.FunctionCall):
            return self.call(one)
        raise AssertionError(f"the expression {one!r} is not expected")

    def binary(self, one: Any) -> tuple[str, str]:
        """An operation on two values of the same type."""
        (first, kind), (second, other) = self.expression(one.left), self.expression(one.right)
        operator = one.op.upper()
        assert kind == other, f"{one}: {kind} and {other}"
        assert (kind == "BOOL") == (operator in ("AND", "OR")), str(one)
        if operator == "/":
            return f"divided({first}, {second})", kind
        compares = operator in ("=", "<>", "<", ">", "<=", ">=", "AND", "OR")
        return f"({first} {OPERATORS.get(operator, operator)} {second})", "BOOL" if compares else kind

    def call(self, one: Any) -> tuple[str, str]:
        """A call with positional arguments."""
        name = str(one.name).upper()
        given = [self.expression(parameter.value) for parameter in one.parameters]
        arguments = ", ".join(code for code, _ in given)
        if name == "SEL":
            assert given[0][1] == "BOOL"
            assert given[1][1] == given[2][1]
            return f"SEL({arguments})", given[1][1]
        return f"{name}({arguments})", self.program.results[name]


class Instance:
    """A function block with its memory."""

    def __init__(self, program: Program, name: str) -> None:
        """Set the start values."""
        self.unit = program.units[name.upper()]
        self.memory = {n: list(v) if isinstance(v, list) else v for n, v in self.unit.starts.items()}

    def __getitem__(self, name: str) -> Any:
        """The value of a variable."""
        return self.memory[name.upper()]

    def __setitem__(self, name: str, value: Any) -> None:
        """Set a variable."""
        assert name.upper() in self.memory
        self.memory[name.upper()] = value

    def __call__(self) -> None:
        """Call it; temporary variables are undefined before."""
        for name in self.unit.temporary:
            kept = self.memory[name]
            self.memory[name] = [Undefined()] * len(kept) if isinstance(kept, list) else Undefined()
        assert self.unit.code
        self.unit.code(self.memory)
