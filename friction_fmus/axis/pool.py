"""Parts that loops of the same axis use one after the other."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

from harness import FmuPart


@dataclass
class PartPool:
    """Parts of loops, to be used again by the next one, because loading an FMU takes longer than a short run.

    Loops that share parts must not run at the same time. Used with ``with``, the pool closes the parts at the end.
    """

    _parts: dict[Hashable, FmuPart] = field(default_factory=dict)

    def part(self, name: str, fmu: Hashable, path: Callable[[], Path], every: int) -> FmuPart:
        """Return a part."""
        key = name, fmu, every
        if key not in self._parts:
            self._parts[key] = FmuPart(name, path(), every=every)
        return self._parts[key]

    def __enter__(self) -> PartPool:
        """Return the pool."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Close the parts."""
        for part in self._parts.values():
            part.close()


__all__ = ["PartPool"]
