"""Objects as small HTML tables, for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.parts.part import Part, Port
    from harness.system.system import System


@dataclass(frozen=True)
class Listing:
    """A table of texts, which is drawn for a terminal, a notebook or a page."""

    caption: str
    headings: Sequence[str]
    """Headings; a column of numbers has one that begins with a space."""
    rows: Sequence[Sequence[object]]

    @property
    def cells(self) -> Iterator[list[str]]:
        """The texts of each row; floating-point numbers have six digits."""
        return (["" if c is None else f"{c:.6g}" if isinstance(c, float) else str(c) for c in row] for row in self.rows)

    @property
    def records(self) -> list[dict[str, object]]:
        """Each row for JSON, with the headings as keys."""
        keys = [" ".join(heading.split()) for heading in self.headings]
        return [dict(zip(keys, row, strict=True)) for row in self.rows]

    def html(self) -> str:
        """Return the table as HTML; texts are escaped."""
        heads = (" ".join(heading.split()) for heading in self.headings)
        head = "".join(f'<th scope="col">{escape(heading)}</th>' for heading in heads)
        body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in self.cells)
        caption = f"<caption>{escape(self.caption)}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: ``1 part``, ``2 parts``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def part_text(part: Part) -> str:
    """Return a part as one line."""
    numbers = [counted(len(getattr(part, f"{noun}s")), noun) for noun in ("input", "output", "parameter")]
    return f"<{type(part).__name__} {part.name!r}: {', '.join(numbers)}>"


def part_html(part: Part) -> str:
    """Return the variables of a part as a table."""
    rows = [
        (port.name, noun, port.start, _unit(port), port.description)
        for noun in ("input", "output", "parameter")
        for port in getattr(part, f"{noun}s")
    ]
    headings = ("variable", "kind", "start", "unit", "meaning")
    return Listing(f"{type(part).__name__} {part.name}", headings, rows).html()


def system_text(system: System) -> str:
    """Return a system as one line."""
    parts = ", ".join(system.parts)
    return f"<System {system.name!r}: {counted(len(system.parts), 'part')} ({parts}), {_connections(system)}>"


def system_html(system: System) -> str:
    """Return the parts, connections and start values of a system as tables."""
    parts = [
        (name, type(part).__name__, _listed(part.inputs), _listed(part.outputs)) for name, part in system.parts.items()
    ]
    ports = {
        f"{name}.{port.name}": port for name, part in system.parts.items() for port in (*part.inputs, *part.parameters)
    }
    wires = [(wire.source, wire.target, wire.gain, wire.offset) for wire in system.wires]
    tables = [
        Listing(f"System {system.name}", ("part", "kind", "inputs", "outputs"), parts),
        Listing(_connections(system), ("from", "to", "gain", "offset"), wires),
    ]
    if system.start:
        values = [(name, value, _unit(ports[name]) if name in ports else "") for name, value in system.start.items()]
        tables.append(Listing("Start values", ("variable", "value", "unit"), values))
    return "".join(table.html() for table in tables)


def _connections(system: System) -> str:
    return counted(len(system.wires), "connection")


def _listed(ports: Iterable[Port]) -> str:
    return ", ".join(f"{port.name} [{port.unit}]" if _unit(port) else port.name for port in ports)


def _unit(port: Port) -> str:
    return "" if port.unit in (None, "1") else str(port.unit)
