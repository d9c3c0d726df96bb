"""What holds for the package as a whole."""

from __future__ import annotations

import inspect
from pathlib import Path

import harness

FILES = sorted(Path(harness.__file__).parent.rglob("*.py"))


def test_every_public_name_exists_and_is_documented() -> None:
    for name in harness.__all__:
        assert inspect.getdoc(getattr(harness, name)), name


def test_every_argument_of_a_public_function_or_class_is_documented() -> None:
    for name in harness.__all__:
        thing = getattr(harness, name)
        own_class = inspect.isclass(thing) and thing.__module__.startswith("harness") and "__init__" in vars(thing)
        if not inspect.isfunction(thing) and not own_class:
            continue
        parameters = inspect.signature(thing).parameters.values()
        parameters = [p for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
        for parameter in parameters:
            assert parameter.name in (inspect.getdoc(thing) or ""), f"{name}: {parameter.name}"


def test_errors_are_harness_errors() -> None:
    errors = [getattr(harness, name) for name in harness.__all__ if name.endswith("Error")]
    assert len(errors) == 16
    assert all(issubclass(error, harness.HarnessError) for error in errors)
