"""The calls of a case, made through the interface of a tool."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Protocol

from friction_fmus.errors import FrictionError
from friction_fmus.reference.case import ReferenceCase

STATUS: Final = ("ok", "warning", "discard", "error", "fatal")


class CallRefusedError(Exception):
    """The FMU has returned a status above warning."""

    def __init__(self, status: int) -> None:
        super().__init__(f"status {STATUS[status]}")
        self.status = status


class CalledInstance(Protocol):
    """An instance of the FMU in a tool. A call that the FMU refuses raises `CallRefusedError`."""

    time: float  # current time [s]; a restored state brings its time back

    def start(self, values: Mapping[str, Any]) -> None:
        """Set start values and initialise; also after a reset."""

    def set(self, values: Mapping[str, Any]) -> None:
        """Set variables."""

    def get(self, names: Sequence[str]) -> list[Any]:
        """Return the values of variables."""

    def step(self, size: float) -> None:
        """Make a communication step [s]."""

    def save(self) -> Any:
        """Return a copy of the state."""

    def restore(self, state: Any) -> None:
        """Return to a state from `save`."""

    def serialise(self, state: Any) -> bytes:
        """Return a state as bytes."""

    def deserialise(self, data: bytes) -> Any:
        """Return a state of bytes, for `restore`."""

    def derivative(
        self, kind: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> list[float]:
        """Return the directional derivatives of unknowns, or the adjoint ones with respect to knowns."""

    def reset(self) -> None:
        """Return to the state after the instantiation."""

    def terminate(self) -> None:
        """End the run."""


def run_calls(case: ReferenceCase, instantiate: Callable[[str], CalledInstance]) -> list[list[Any]]:
    """Make the calls of a case and return the rows of its results, of which each ``get`` is one.

    Parameters
    ----------
    case : ReferenceCase
        The case.
    instantiate : callable
        Returns a new instance with a name.

    Raises
    ------
    FrictionError
        If the FMU returns another status than the case expects.
    """
    instances: dict[str, CalledInstance] = {}
    states: dict[str, Any] = {}
    derivatives: dict[str, float] = {}
    rows: list[list[Any]] = []

    def one(call: Mapping[str, Any], instance: CalledInstance) -> None:
        do, name = call["do"], call.get("state", "")
        if do == "start":
            instance.start({**case.start, **call.get("values", {})})
        elif do == "set":
            instance.set(call["values"])
        elif do == "step":
            for _ in range(call.get("count", 1)):
                instance.step(float(call.get("size", case.experiment.step)))
        elif do == "get":
            wanted = [each for each in case.outputs if each not in derivatives]
            found = dict(zip(wanted, instance.get(wanted), strict=True)) | derivatives
            rows.append([instance.time, *(found[each] for each in case.outputs)])
        elif do == "save":
            states[name] = instance.save()
        elif do == "restore":
            instance.restore(states[name])
        elif do == "serialise":
            states[name] = instance.serialise(instance.save())
        elif do == "deserialise":
            instance.restore(instance.deserialise(states[name]))
        elif do in ("directional", "adjoint"):
            found_values = instance.derivative(do, call["unknowns"], call["knowns"], call["seed"])
            derivatives.update(zip(call["into"], found_values, strict=True))
        elif do in ("reset", "terminate"):
            getattr(instance, do)()
        else:
            raise FrictionError(f"{case.folder} has the unknown call {do!r}")

    for number, call in enumerate(case.call, start=1):
        key = call.get("instance", "a")
        if key not in instances:
            instances[key] = instantiate(key)
        expected = STATUS.index(call.get("expect", "ok"))
        status = 0
        try:
            one(call, instances[key])
        except CallRefusedError as refused:
            status = refused.status
        if status != expected:
            raise FrictionError(
                f"call {number} of {case.name}, {call['do']}, gave the status {STATUS[status]}, not {STATUS[expected]}"
            )
    return rows
