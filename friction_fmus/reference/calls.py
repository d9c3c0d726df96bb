"""The calls of a case, made through the interface of a tool."""

from collections.abc import Callable
from typing import Any, Final

from friction_fmus.errors import FrictionError
from friction_fmus.reference.case import ReferenceCase

STATUS: Final = ("ok", "warning", "discard", "error", "fatal")


def run_calls(case: ReferenceCase, instantiate: Callable[[str], Any]) -> list[list[Any]]:
    """Make the calls of a case and return the rows of its results.

    ``instantiate`` returns a new instance of the FMU with a name; docs/reference-set.md lists its methods.
    """
    instances: dict[str, Any] = {}
    kept: dict[str, Any] = {}  # states and derivatives by name
    rows: list[list[Any]] = []

    def make(call: dict[str, Any], instance: Any) -> None:
        do, state = call["do"], call.get("state", "")
        if do == "start":
            instance.start({**case.start, **call.get("values", {})})
        elif do == "set":
            instance.set(call["values"])
        elif do == "step":
            for _ in range(call.get("count", 1)):
                instance.step(float(call.get("size", case.experiment.step)))
        elif do == "get":
            found = instance.get([name for name in case.outputs if name not in kept])
            rows.append([instance.time, *(kept[name] if name in kept else found.pop(0) for name in case.outputs)])
        elif do in ("save", "serialise"):
            kept[state] = getattr(instance, do)()
        elif do in ("restore", "deserialise"):
            getattr(instance, do)(kept[state])
        elif do in ("directional", "adjoint"):
            found = getattr(instance, do)(call["unknowns"], call["knowns"], call["seed"])
            kept.update(zip(call["into"], found, strict=True))
        else:
            {"reset": instance.reset, "terminate": instance.terminate}[do]()

    for number, call in enumerate(case.call, start=1):
        key, expected, status = call.get("instance", "a"), call.get("expect", "ok"), 0
        if key not in instances:
            instances[key] = instantiate(key)
        try:
            make(call, instances[key])
        except Exception as error:  # of the tool
            status = getattr(error, "status", -1)
            if status < 0:
                raise
        if STATUS[status if status > 1 else 0] != expected:
            message = f"call {number} of {case.name}, {call['do']}, has the status {STATUS[status]}, not {expected}"
            raise FrictionError(message)
    return rows
