"""Names of the intermediate results of a law: the local variables of its function and of the functions that it calls.

The function is executed once more under a trace, so that a law needs no declarations for readable C code.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import casadi
from casadi import SX

_CASADI = str(Path(casadi.__file__).parent)


@dataclass(frozen=True, eq=False)
class Label:
    """A name of an intermediate result."""

    name: str
    """Python identifier."""
    value: SX
    """The scalar expression."""
    depth: int
    """0 for variables of the law's own function, 1 for functions that it calls, and so on."""
    assigned: bool
    """False for arguments and returned values of called functions, and for elements of lists."""


def labelled(equations: Callable[..., Any], symbols: dict[str, SX]) -> tuple[Any, list[Label]]:
    """Call the function of a law and record its intermediate results."""
    recorder = _Recorder()
    earlier = sys.gettrace()
    sys.settrace(recorder.entered)
    try:
        return equations(**symbols), recorder.labels
    finally:
        sys.settrace(earlier)


class _Recorder:
    """Trace function that compares the local variables before and after each line."""

    def __init__(self) -> None:
        self.labels: list[Label] = []
        self._known: list[dict[str, tuple[Any, int]]] = []  # local variables of active functions with lengths of lists

    def entered(self, frame: FrameType, event: str, _: Any) -> Callable[[FrameType, str, Any], Any] | None:
        """Trace a function unless it belongs to casadi or has no name."""
        code = frame.f_code
        if event != "call" or code.co_filename.startswith(_CASADI) or code.co_name.startswith("<"):
            return None
        self._known.append({})
        self._record(frame, assigned=False)
        return self._went_on

    def _went_on(self, frame: FrameType, event: str, result: Any) -> Callable[[FrameType, str, Any], Any]:
        if event in ("line", "return"):
            self._record(frame, assigned=True)
        if event == "return":
            self._known.pop()
            if self._known:
                self._add(frame.f_code.co_name, result, assigned=False)
        return self._went_on

    def _record(self, frame: FrameType, *, assigned: bool) -> None:
        known = self._known[-1]
        for name, value in frame.f_locals.items():
            old, length = known.get(name, (None, 0))
            grown = len(value) if isinstance(value, list) else 0
            if old is not value:
                self._add(name, value, assigned=assigned)
            elif grown > length:
                for i in range(length, grown):
                    self._add(f"{name}_{i}", value[i], assigned=False)
            known[name] = value, grown

    def _add(self, name: str, value: Any, *, assigned: bool) -> None:
        depth = len(self._known) - 1
        for label, scalar in _scalars(name, value):
            self.labels.append(Label(label, scalar, depth, assigned and label == name))


def _scalars(name: str, value: Any) -> Iterator[tuple[str, SX]]:
    """Yield the scalar expressions in a value, with the index of each element."""
    if isinstance(value, SX):
        if value.is_scalar() and not (value.is_constant() or value.is_symbolic()):
            yield name, value
    elif isinstance(value, list | tuple):
        for i, element in enumerate(value):
            yield from _scalars(f"{name}_{i}", element)
