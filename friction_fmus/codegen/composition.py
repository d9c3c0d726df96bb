"""Laws made of laws: several laws in one sample, each with the results of those before it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from casadi import SX, Function, symvar

from friction_fmus.blocks.block_declarations import About
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.declarations import PARAMETERS, Conditions, Kind, LawVariable
from friction_fmus.lawkit.law import Law, check_variables
from friction_fmus.lawkit.results import Label, Results, function_of

_STATES = (Kind.STATE, Kind.STATES)


class Composition:
    """A law under construction; variables of a part have its name as prefix, so that they remain different."""

    def __init__(self) -> None:
        """Begin without variables."""
        self._variables: dict[str, LawVariable] = {}
        self._symbols: dict[str, list[SX]] = {}
        self._results: dict[str, list[SX]] = {}
        self._labels: list[Label] = []
        self._held: dict[str, SX] = {}

    def declare(self, variable: LawVariable) -> list[SX]:
        """Add a variable and return its symbols."""
        if variable.name in self._variables:
            raise FrictionError(f"Two variables of the composed law are called {variable.name}; rename one in its law")
        self._variables[variable.name] = variable
        self._symbols[variable.name] = [SX.sym(scalar) for scalar in variable.scalars]
        return self._symbols[variable.name]

    def label(self, name: str, value: SX) -> SX:
        """Name an intermediate result and return it."""
        self._labels.append(Label(name, value, 0, assigned=True))
        return value

    def result(self, name: str, *values: SX) -> None:
        """Set the next value of a state, or of all its elements, or the value of an output."""
        self._results[name] = list(values)

    def output(self, variable: LawVariable, value: SX) -> None:
        """Add an output."""
        self.declare(variable)
        self.result(variable.name, value)

    def apply(self, part: str, law: Law, connected: Mapping[str, SX], shared: Mapping[str, str]) -> dict[str, SX]:
        """Compute a law in every sample and return its outputs."""
        own = {v.name: shared.get(v.name, f"{part}_{v.name}") for v in law.select(*PARAMETERS, *_STATES)}
        given: list[SX] = []
        for variable in law.given:
            if variable.name not in own:
                given.append(connected[variable.name])
            elif variable.name in shared:
                given += self._symbols[shared[variable.name]]
            else:
                given += self.declare(replace(variable, name=own[variable.name]))
        function, labels = law.intermediate()
        values = iter(function.call(given))
        outputs: dict[str, SX] = {}
        for variable in law.results:
            scalars = [next(values) for _ in variable.starts]
            if variable.kind is Kind.OUTPUT:
                outputs[variable.name] = scalars[0]
                self._labels.append(Label(f"{part}_{variable.name}", scalars[0], 0, assigned=False))
            else:
                self.result(own[variable.name], *scalars)
        named = [replace(at, name=f"{part}_{at.name}", value=value) for at, value in zip(labels, values, strict=True)]
        self._labels += named
        self._hold(law.conditions, own)
        return outputs

    def _hold(self, conditions: Conditions, own: Mapping[str, str]) -> None:
        """Add the conditions of a law."""
        given = [symbol for parameter in conditions.parameters for symbol in self._symbols[own[parameter.name]]]
        for text, held in zip(conditions.texts, conditions.function.call(given), strict=True):
            self._held[re.sub(r"\b[A-Za-z]\w*\b", lambda found: own.get(found[0], found[0]), text)] = held

    def law(
        self, name: str, summary: str, source: str, documentation: str, path: Path, prefixes: Mapping[int, str]
    ) -> Law:
        """Return the law, without variables that have no effect on its outputs."""
        where = f"{path.name}: law {name}"
        needed = self._needed()
        variables = self._in_table_order(needed)
        check_variables(where, variables, About())
        given = [variable for variable in variables if variable.kind is not Kind.OUTPUT]
        written = [v for v in variables if v.kind is Kind.OUTPUT] + [v for v in variables if v.kind in _STATES]
        results = Results(
            tuple(symbol for variable in given for symbol in self._symbols[variable.name]),
            tuple(value for variable in written for value in self._results[variable.name]),
            tuple(scalar for variable in given for scalar in variable.scalars),
            tuple(
                scalar if variable.kind is Kind.OUTPUT else f"{scalar}_next"
                for variable in written
                for scalar in variable.scalars
            ),
        )
        labels = tuple(label for label in self._labels if _symbols_in([label.value]) <= needed)
        traced = Function("intermediate", results.arguments, [*results.expressions, *(at.value for at in labels)])
        found = Law(
            name,
            summary,
            source,
            documentation,
            variables,
            function_of(where, name, results),
            path,
            self._conditions(variables, needed),
            About(),
            {},
            lambda _: found,
            lambda: (traced, labels),
            prefixes,
        )
        return found

    def _needed(self) -> set[str]:
        """Return the names of the symbols on which the outputs depend, in this or a later sample."""
        outputs = [value for v in self._variables.values() if v.kind is Kind.OUTPUT for value in self._results[v.name]]
        found: set[str] = set()
        new = _symbols_in(outputs)
        while new:
            found |= new
            states = [v.name for v in self._variables.values() if v.kind in _STATES and new & {*v.scalars}]
            new = _symbols_in(value for state in states for value in self._results[state]) - found
            # the elements of a vector stay together
            new |= {scalar for state in states for scalar in self._variables[state].scalars} - found
        return found

    def _in_table_order(self, needed: set[str]) -> tuple[LawVariable, ...]:
        """Return inputs, outputs, then states and parameters, the sample time last."""
        kinds = ((Kind.INPUT, Kind.OPTIONAL), (Kind.COMMAND,), (Kind.OUTPUT,))
        first = {kind for group in kinds for kind in group} | {Kind.SAMPLE_TIME}
        groups = [[v for v in self._variables.values() if v.kind in group] for group in kinds]
        groups.append([v for v in self._variables.values() if v.kind not in first])
        groups.append([v for v in self._variables.values() if v.kind is Kind.SAMPLE_TIME])
        kept = (Kind.OUTPUT, Kind.SAMPLE_TIME)
        return tuple(v for group in groups for v in group if v.kind in kept or needed & {*v.scalars})

    def _conditions(self, variables: tuple[LawVariable, ...], needed: set[str]) -> Conditions:
        """Return the conditions on the remaining parameters."""
        held = {text: value for text, value in self._held.items() if _symbols_in([value]) <= needed}
        parameters = tuple(variable for variable in variables if variable.kind in PARAMETERS)
        symbols = [symbol for parameter in parameters for symbol in self._symbols[parameter.name]]
        return Conditions(tuple(held), parameters, Function("conditions", symbols, list(held.values())))


def _symbols_in(values: Iterable[SX]) -> set[str]:
    return {symbol.name() for value in values for symbol in symvar(value)}
