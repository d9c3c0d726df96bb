"""Compensator laws: one Python function of casadi expressions defines a law.

Variables are declared by argument defaults, the body contains the equations, and the docstring becomes the
documentation page::

    @law("P", "Proportional position controller", source="textbook", Ts=1e-3,
         outputs={"u": Output(FORCE, "control force")})
    def p(
        r: SX = Input(LENGTH, 0.0, "reference position"),
        x: SX = Input(LENGTH, 0.0, "measured position"),
        Kp: SX = Parameter(STIFFNESS, 100.0, "proportional gain", min=0.0),
    ) -> dict[str, SX]:
        \"\"\"Proportional position control: u = Kp (r - x).\"\"\"
        return {"u": Kp * (r - x)}
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from casadi import SX, Function, symvar, vertcat

from friction_fmus.blocks.axis_units import SLIDING
from friction_fmus.blocks.block_declarations import About, Use, replaces_servo
from friction_fmus.blocks.contact import Friction
from friction_fmus.blocks.law_summaries import law_paths
from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.lawkit.declarations import (
    BOOLEANS,
    FAULT,
    PARAMETERS,
    VECTORS,
    Command,
    Conditions,
    Input,
    Kind,
    LawVariable,
    Output,
    Parameter,
    Relation,
    SampleTime,
    State,
    Switch,
    check_identifier,
    check_line,
    conditions_of,
)
from friction_fmus.lawkit.emit.c_text import kernel
from friction_fmus.lawkit.emit.syntax import comment
from friction_fmus.lawkit.quantities import (
    ACCELERATION,
    ANGLE,
    DAMPING,
    FORCE,
    FREQUENCY,
    JERK,
    LENGTH,
    MASS,
    NO_UNIT,
    STIFFNESS,
    TIME,
    VELOCITY,
    Unit,
    c_description,
    c_string,
)
from friction_fmus.lawkit.results import Equations, Evaluator, Label, function_of, intermediate_results, results_of
from harness.storage.files import LARGEST_TEXT, reason, require_regular

__all__ = [
    "ACCELERATION",
    "ANGLE",
    "BOOLEANS",
    "DAMPING",
    "FORCE",
    "FREQUENCY",
    "JERK",
    "LENGTH",
    "MASS",
    "NO_UNIT",
    "STIFFNESS",
    "TIME",
    "VECTORS",
    "VELOCITY",
    "Command",
    "Friction",
    "Input",
    "Kind",
    "Law",
    "LawVariable",
    "Output",
    "Parameter",
    "SampleTime",
    "Size",
    "State",
    "Switch",
    "Unit",
    "Use",
    "law",
    "replaces_servo",
]


@dataclass(frozen=True)
class Size:
    """A parameter that counts elements of vectors.

    Values up to its maximum fit into the declared vectors. A larger start value lengthens the vectors, and the
    parameter is then fixed to this value.
    """

    vectors: tuple[str, ...]  # the states and vectors of parameters whose length follows the parameter
    most: int  # the largest start value


def wanted_sizes(
    name: str, sizes: Mapping[str, Size], maxima: Mapping[str, float], start: Mapping[str, float]
) -> dict[str, int]:
    """Return the sizes that start values need."""
    found = {}
    for parameter, size in sizes.items():
        value = float(start.get(parameter, 0.0))
        if math.isfinite(value) and value > maxima[parameter]:
            if value > size.most or value != int(value):
                rule = f"above {maxima[parameter]:g}, give an integer up to {size.most}"
                raise FrictionError(f"{name} cannot have {parameter} = {value:g}: {rule}")
            found[parameter] = int(value)
    return found


def resized(
    variables: tuple[LawVariable, ...], sizes: Mapping[str, Size], wanted: Mapping[str, int]
) -> tuple[LawVariable, ...]:
    """Return the variables with parameters fixed to these sizes and vectors of matching length."""
    by_name = {variable.name: variable for variable in variables}
    for parameter, size in wanted.items():
        added, value = size - int(by_name[parameter].max), float(size)
        by_name[parameter] = replace(by_name[parameter], start=value, min=value, max=value)
        for name in sizes[parameter].vectors:
            starts = by_name[name].starts
            by_name[name] = replace(by_name[name], start=starts + starts[-1:] * added)
    return tuple(by_name.values())


@dataclass(frozen=True, eq=False)
class Law:
    """A sampled control law."""

    name: str
    summary: str
    source: str
    """Model identifier; one-line description; literature."""
    documentation: str  # the documentation page as plain text; paragraphs indented by four spaces are equations
    variables: tuple[LawVariable, ...]
    """Variables in declaration order: outputs follow the last input, the sample time is last."""
    function: Function
    """One sample: maps the scalars of `given` to the outputs, then to the next states (named ``<state>_next``, for a
    vector ``<state>_1_next``, ...)."""
    path: Path
    conditions: Conditions
    about: About
    """Further declarations in its file."""
    sizes: Mapping[str, Size]  # parameters whose start values determine the length of vectors
    remade: Callable[[Mapping[str, int]], Law]  # returns the law with these parameters fixed to other values
    intermediate: Callable[[], tuple[Function, tuple[Label, ...]]]
    """Returns `function` with additional results, the intermediate results, and their names."""
    prefixes: Mapping[int, str] = field(default_factory=dict)
    """For a law that consists of others: the prefix of the names of variables that the documentation omits, by the
    first line of their code."""

    def with_room(self, start: Mapping[str, Any]) -> Law:
        """Return the law with vectors that are long enough for these start values.

        Raises
        ------
        FrictionError
            If a start value exceeds the largest size or is not an integer.
        """
        maxima = {variable.name: variable.max for variable in self.variables}
        wanted = wanted_sizes(self.name, self.sizes, maxima, start)
        return self.remade(wanted) if wanted else self

    def select(self, *kinds: Kind) -> tuple[LawVariable, ...]:
        """Return the variables of these kinds."""
        return tuple(variable for variable in self.variables if variable.kind in kinds)

    @cached_property
    def given(self) -> tuple[LawVariable, ...]:
        """Variables that a sample reads, in the order of the function's arguments."""
        return tuple(variable for variable in self.variables if variable.kind is not Kind.OUTPUT)

    @cached_property
    def results(self) -> tuple[LawVariable, ...]:
        """Variables that a sample writes, in the order of the function's results."""
        return self.select(Kind.OUTPUT) + self.select(Kind.STATE, Kind.STATES)

    def disabled(self) -> tuple[Function, tuple[LawVariable, ...]]:
        """Return the results that `enable` = false sets to a value of parameters only, as a function of `given`."""
        owners = _by_scalar(self.given)
        symbols = [SX.sym(scalar) for variable in self.given for scalar in variable.scalars]
        off = [v.name == "enable" and v.kind is Kind.COMMAND for v in owners]
        values = iter(self.function.call([SX(0.0) if o else s for o, s in zip(off, symbols, strict=True)]))
        changing = {scalar for v in self.given if v.kind not in PARAMETERS for scalar in v.scalars}
        found = [(v, [next(values) for _ in v.starts]) for v in self.results]
        kept = [
            (v, elements)
            for v, elements in found
            if any(off)
            and "enable" in self.dependencies(v.name)
            and not changing & {symbol.name() for symbol in symvar(vertcat(*elements))}
        ]
        results = [element for _, elements in kept for element in elements]
        return Function("disabled", symbols, results), tuple(v for v, _ in kept)

    def dependencies(self, result: str) -> tuple[str, ...]:
        """Return the exact dependencies of an output or of the next value of a state, including decisions."""
        names = [variable.name for variable in self.results]
        if result not in names:
            raise FrictionError(f"{self.name} has no result {result!r}{did_you_mean(result, names)}")
        owners = [variable.name for variable in _by_scalar(self.given)]
        columns = [i for i, variable in enumerate(_by_scalar(self.results)) if variable.name == result]
        used = {
            owner
            for i, owner in enumerate(owners)
            if any(self.function.sparsity_jac(i, column).nnz() for column in columns)
        }
        return tuple(variable.name for variable in self.given if variable.name in used)

    @cached_property
    def _evaluator(self) -> Evaluator:
        return Evaluator(self.function)

    def evaluate(self, values: Mapping[str, float | tuple[float, ...]]) -> dict[str, Any]:
        """Evaluate one sample with casadi."""
        known = {variable.name for variable in self.given}
        for name in values:
            if name not in known:
                raise FrictionError(f"{self.name} has no variable {name!r} to set{did_you_mean(name, known)}")
        arguments: list[float] = []
        for variable in self.given:
            value = values.get(variable.name, variable.start)
            elements = value if isinstance(value, tuple) else (value,)
            if len(elements) != len(variable.starts):
                raise FrictionError(
                    f"{self.name}: {variable.name} has the length {len(variable.starts)}, but {len(elements)} numbers "
                    "are given"
                )
            arguments += map(float, elements)
        found = iter(self._evaluator(arguments).tolist())
        return {
            variable.name: tuple(next(found) for _ in variable.starts) if variable.kind in VECTORS else next(found)
            for variable in self.results
        }


def _by_scalar(variables: tuple[LawVariable, ...]) -> list[LawVariable]:
    """Return every variable once per scalar."""
    return [variable for variable in variables for _ in variable.starts]


def law(
    name: str,
    summary: str,
    *,
    source: str,
    cites: Sequence[str] = (),
    Ts: float,
    outputs: Mapping[str, LawVariable],
    conditions: Mapping[str, Relation] | None = None,
    sizes: Mapping[str, Size] | None = None,
    friction: Friction | None = None,
    use: Use | None = None,
) -> Callable[[Equations], Law]:
    """Define a law by a function of casadi expressions.

    Parameters
    ----------
    name : str
        Model identifier of the FMU.
    summary, source : str
        One-line description; literature (author, journal, year).
    Ts : float
        Default of the fixed parameter ``Ts``, the sample time [s].
    outputs : mapping of str to LawVariable
        Outputs, declared by `Output`.
    conditions : mapping of str to callable, optional
        Relations without which the law is singular: ``{"w Ts < 2": lambda w, Ts: w * Ts < 2.0}``, as functions of
        parameters with these names. Values that violate one are rejected with a message that quotes its text. The
        relation u_min <= u_max is added automatically.
    sizes : mapping of str to Size, optional
        Parameters whose start values determine the length of vectors when the FMU is built.
    cites : optional
        See `About`.
    friction : Friction, optional
        Friction that the law compensates, see `About`; None if it has no friction model or a study excludes it.
    use : Use, optional
        How ``friction-fmus study`` uses the law; None excludes it from studies.

    Returns
    -------
    callable
        Decorator. The decorated function receives an SX for every argument (0 or 1 for a Boolean) and returns a dict
        with every output and, under the name of the state, the next value of every state.

    Raises
    ------
    FrictionError
        If the law is invalid; the message says why in one sentence.
    """

    about = About(friction=friction, use=use, cites=tuple(cites))

    def decorate(equations: Equations) -> Law:
        code = getattr(equations, "__code__", None)
        path = Path(code.co_filename) if code else Path()
        where = f"{path.name}: law {name}"
        for title, line in (("name", name), ("summary", summary), ("source", source)):
            check_line(where, title, line)
        check_identifier(where, "name", name)
        if not (math.isfinite(Ts) and Ts > 0.0):
            raise FrictionError(f"{where}: the sample time Ts = {Ts!r} must be positive and finite")
        documentation = inspect.getdoc(equations) or ""
        if not documentation:
            raise FrictionError(f"{where} has no docstring; add one, as it becomes the documentation page")

        def made(wanted: Mapping[str, int]) -> Law:
            declared = resized(_declared(where, equations), sizes or {}, wanted)
            variables = _in_table_order(declared, outputs, Ts)
            check_variables(where, variables, about)
            return Law(
                name,
                summary,
                source,
                documentation,
                variables,
                function_of(where, name, results_of(where, equations, declared, variables)),
                path,
                conditions_of(where, conditions or {}, variables),
                about,
                sizes or {},
                made,
                lambda: intermediate_results(where, equations, declared, variables),
            )

        return made({})

    return decorate


def _declared(where: str, equations: Equations) -> tuple[LawVariable, ...]:
    """Return the arguments of the function as named variables."""
    declared = []
    for name, argument in inspect.signature(equations).parameters.items():
        plain = argument.kind in (argument.POSITIONAL_OR_KEYWORD, argument.KEYWORD_ONLY)
        if not plain or not isinstance(argument.default, LawVariable) or argument.default.kind is Kind.OUTPUT:
            raise FrictionError(
                f"{where}: the argument {name} needs one of Input(...), Command(...), State(...), Parameter(...), "
                "Switch(...), SampleTime() as its default"
            )
        if (argument.default.kind is Kind.SAMPLE_TIME) != (name == "Ts"):
            raise FrictionError(
                f"{where}: SampleTime() declares the argument Ts and no other; correct the declaration of {name}"
            )
        declared.append(replace(argument.default, name=name))
    return tuple(declared)


def _in_table_order(
    declared: tuple[LawVariable, ...], outputs: Mapping[str, LawVariable], sample_time: float
) -> tuple[LawVariable, ...]:
    inputs = [variable for variable in declared if variable.kind in (Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND)]
    others = [variable for variable in declared if variable not in inputs and variable.kind is not Kind.SAMPLE_TIME]
    results = [replace(output, name=name) for name, output in outputs.items()]
    ts: LawVariable = SampleTime()
    return (*inputs, *results, *others, replace(ts, name="Ts", start=float(sample_time)))


def check_variables(where: str, variables: tuple[LawVariable, ...], about: About) -> None:
    if not any(variable.kind is Kind.OUTPUT for variable in variables):
        raise FrictionError(f"{where} has no output; declare one by outputs={{'u': Output(...)}}")
    seen: set[str] = set()
    for variable in variables:
        name = variable.name
        check_identifier(where, "variable", name)
        check_line(where, f"description of {name}", variable.text)
        for scalar in {name, *variable.scalars}:
            if scalar in seen:
                raise FrictionError(f"{where}: the name {scalar} is declared twice; rename one of the variables")
            seen.add(scalar)
        if not (variable.starts and all(map(math.isfinite, variable.starts))):
            raise FrictionError(f"{where}: the start value of {name} must be finite, not {variable.start!r}")
        if not all(variable.min <= start <= variable.max for start in variable.starts):
            limits = f"[{variable.min:g}, {variable.max:g}]"
            raise FrictionError(f"{where}: the start value {variable.start!r} of {name} lies outside {limits}")
        if not (math.isfinite(variable.nominal) and variable.nominal > 0.0):
            raise FrictionError(f"{where}: the nominal value of {name} must be positive, not {variable.nominal!r}")
    for variable in variables:
        if variable.kind not in (Kind.STATE, Kind.STATES):
            continue
        for scalar in variable.scalars:
            if f"{scalar}_next" in seen:
                raise FrictionError(
                    f"{where}: {scalar}_next is the next value of the state {variable.name}; rename that variable"
                )
    try:
        about.check(variable.name for variable in variables)
    except FrictionError as error:
        raise FrictionError(f"{where}: {error}") from error


def block_source(law: Law) -> str:
    """Return the C file of a law's block for block.h."""
    writes = [place for variable in law.results for place in variable.places(f"model->{variable.name}")]
    body = _statements(law.function, law.given, writes)
    last_output = max(i for i, variable in enumerate(law.variables) if variable.kind is Kind.OUTPUT)
    table = (*law.variables[: last_output + 1], FAULT, *law.variables[last_output + 1 :])
    texts, skipped = law.conditions.texts, _skip(law)
    origin = f"Generated from the law file {law.path.name}: change that file, not this one."
    return "\n".join(
        [
            comment(f"{law.documentation}\n\n{origin}"),
            "",
            f"#define MODEL   {law.name}",
            f"#define SUMMARY {c_string(SLIDING.fill(law.summary))}",
            f"#define SOURCE  {c_string(law.source)}",
            "#define SAMPLED",
            "#define GUARDED",
            *(["#define SKIPS_BY skip"] if skipped else []),
            *(["#define REQUIRES relations"] if texts else []),
            "",
            "/* clang-format off */",
            *_table(table),
            "/* clang-format on */",
            "",
            '#include "block.h"',
            "",
            "/* The operations of the law in casadi's order of evaluation; the results are stored at the end. */",
            "static void sample(Model *model)",
            "{",
            "    GIVEN(model)",
            *(f"    {line}" for line in body),
            "}",
            *skipped,
            *(_relations(law) if texts else []),
            "",
        ]
    )


def _statements(function: Function, given: Sequence[LawVariable], writes: Sequence[str]) -> tuple[str, ...]:
    """Return the C statements of a function of these variables, which are available as constants."""
    # GIVEN copies scalars, but has only pointers to vectors: a state vector is named as where results are stored
    places = [("model->" if variable.kind is Kind.STATES else "", variable) for variable in given]
    reads = [place for prefix, variable in places for place in variable.places(f"{prefix}{variable.name}")]
    scalars = [variable for variable in given for _ in variable.starts]
    booleans = [i for i, variable in enumerate(scalars) if variable.kind in BOOLEANS]
    taken = [*(variable.name for variable in given), *(re.findall(r"\w+", " ".join(writes)))]
    positive = [i for i, variable in enumerate(scalars) if variable.min >= 0.0]
    return kernel(function, reads, writes, conditions=booleans, positive=positive, taken=taken, unrolls=True).lines


def _skip(law: Law) -> list[str]:
    """Return the C function in place of a sample with an invalid input: it counts, and a disabled law is at rest."""
    function, results = law.disabled()
    lines = [f"model->{variable.name} += 1.0;" for variable in law.given if variable.tally]
    if results:
        writes = [place for variable in results for place in variable.places(f"model->{variable.name}")]
        rest = _statements(function, law.given, writes)
        lines += ["if (!enable) {", *(f"    {line}" for line in rest), "}"]
    body = [f"    {line}" for line in lines]
    return ["", "static void skip(Model *model)", "{", "    GIVEN(model)", *body, "}"] if lines else []


def _relations(law: Law) -> list[str]:
    """Return the C function that returns the text of a violated condition."""
    texts = law.conditions.texts
    held = [f"holds[{i}]" for i in range(len(texts))]
    return [
        "",
        "static const char *relations(const Model *model)",
        "{",
        "    GIVEN(model)",
        f"    double holds[{len(texts)}];",
        *(f"    {line}" for line in _statements(law.conditions.function, law.conditions.parameters, held)),
        *(f"    if (holds[{i}] == 0.0)\n        return {c_string(text)};" for i, text in enumerate(texts)),
        "    return NULL;",
        "}",
    ]


def _limit(value: float) -> str:
    """Return a number for the table, where the macro INF is infinity."""
    return repr(float(value)) if math.isfinite(value) else "INF" if value > 0.0 else "-INF"


def _table(variables: Sequence[LawVariable]) -> list[str]:
    """Return the rows of VARIABLES in columns."""
    rows = [_row(variable) for variable in variables]
    widths = [max(len(cells[column]) for _, cells, _ in rows) for column in range(len(rows[0][1]))]
    longest = max(len(kind) for kind, _, _ in rows)
    lines = ["#define VARIABLES"]
    for kind, cells, text in rows:
        columns = [cell.ljust(width) for cell, width in zip(cells, widths, strict=True) if width]
        lines.append(f"    {kind.ljust(longest)}({' '.join(columns)} {text})")
    width = max(map(len, lines))
    return [*(f"{line.ljust(width)} \\" for line in lines[:-1]), lines[-1]]


def _row(variable: LawVariable) -> tuple[str, list[str], str]:
    """Return macro, cells (name, number of elements, unit, start, min or nominal, max) and text of a variable."""
    kind = variable.kind
    unit = "" if kind in (*BOOLEANS, Kind.FLAG) else variable.unit.c
    count = low = high = ""
    if kind in VECTORS:
        count, start = str(len(variable.starts)), f"({', '.join(map(_limit, variable.starts))})"
    elif kind in BOOLEANS:
        start = str(int(variable.starts[0]))
    else:
        start = "" if kind in (Kind.OUTPUT, Kind.FLAG) else _limit(variable.starts[0])
    if kind in (Kind.PARAMETER, Kind.VECTOR, Kind.SAMPLE_TIME):
        low, high = _limit(variable.min), _limit(variable.max)
    elif kind in (Kind.STATE, Kind.STATES):
        low = _limit(variable.nominal)
    cells = [f"{cell}," if cell else "" for cell in (variable.name, count, unit, start, low, high)]
    return kind.value, cells, c_description(variable.text)


def discover_laws(path: Path | str) -> list[Law]:
    """Load the laws of a folder, or of one file."""
    path = Path(path)
    if not path.exists():
        raise FrictionError(f"There is no law file or folder {path}; give an existing path")
    files = law_paths(path) if path.is_dir() else [path]
    found: dict[str, Law] = {}
    for file in files:
        for value in vars(_load(file)).values():
            # an imported law belongs to the file that defines it
            if not isinstance(value, Law) or value.path.resolve() != file.resolve():
                continue
            other = found.setdefault(value.name, value)
            if other is not value:
                raise FrictionError(f"Two laws are called {value.name}: in {other.path.name} and in {file.name}")
    return list(found.values())


def _load(file: Path) -> ModuleType:
    file = file.resolve()
    try:
        require_regular(file, LARGEST_TEXT)
        content = file.read_bytes()
    except OSError as error:
        raise FrictionError(f"{file.name} cannot be loaded: {reason(error)}; give a Python file") from error
    return _module(file, hashlib.sha256(content).hexdigest())


@cache
def _module(file: Path, digest: str) -> ModuleType:
    """Return the module of a law file with this content, which is executed once."""
    name = f"law_file_{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise FrictionError(f"{file.name} is not a Python file; a law file ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look up their module
    bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # write no files to a user's folder
    try:
        spec.loader.exec_module(module)
    except FrictionError:
        del sys.modules[name]
        raise
    except Exception as error:
        del sys.modules[name]
        raise FrictionError(f"{file.name} cannot be loaded: {type(error).__name__}: {error}") from error
    finally:
        sys.dont_write_bytecode = bytecode
    return module
