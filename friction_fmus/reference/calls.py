"""The calls of a case, made through the interface of a tool."""

from collections.abc import Callable
from typing import Any, Final

from friction_fmus.errors import FrictionError
from friction_fmus.reference.case import ReferenceCase

STATUS: Final = ("ok", "warning", "discard", "error", "fatal")

Instance = Any  # has the methods that docs/reference-set.md lists


def run_calls(case: ReferenceCase, instantiate: Callable[[str], Instance]) -> list[list[Any]]:
    """Make the calls of a case and return the rows of its results; ``instantiate`` returns an instance with a name."""
    instances: dict[str, Instance] = {}
    states: dict[str, Any] = {}
    rows: list[list[Any]] = []
    for number, call in enumerate(case.call, start=1):
        key = call.get("instance", "a")
        if key not in instances:
            instances[key] = instantiate(key)
        status = 0
        try:
            _call(case, call, instances[key], states, rows)
        except Exception as error:
            status = getattr(error, "status", -1)
            if status < 0:
                raise
        expected = call.get("expect", "ok")
        if max(status - 1, 0) != max(STATUS.index(expected) - 1, 0):
            message = f"call {number} of {case.name}, {call['do']}, has the status {STATUS[status]}, not {expected}"
            raise FrictionError(message)
    return rows


def _call(
    case: ReferenceCase, call: dict[str, Any], instance: Instance, states: dict[str, Any], rows: list[list[Any]]
) -> None:
    """Make one call."""
    do, state = call["do"], call.get("state", "")
    if do == "start":
        instance.start({**case.start, **call.get("values", {})})
    elif do == "set":
        instance.set(call["values"])
    elif do == "step":
        for _ in range(call.get("count", 1)):
            instance.step(float(call.get("size", case.experiment.step)))
    elif do == "get":
        found = instance.get([name for name in case.outputs if name not in states])
        rows.append([instance.time, *(states[name] if name in states else found.pop(0) for name in case.outputs)])
    elif do in ("save", "serialise"):
        states[state] = getattr(instance, do)()
    elif do in ("restore", "deserialise"):
        getattr(instance, do)(states[state])
    elif do in ("directional", "adjoint"):
        found = getattr(instance, do)(call["unknowns"], call["knowns"], call["seed"])
        states.update(zip(call["into"], found, strict=True))
    elif do in ("reset", "terminate"):
        getattr(instance, do)()
    else:
        raise FrictionError(f"{case.name} has the unknown call {do!r}")
