"""Docstrings of the public names: complete numpydoc sections, checked by the library numpydoc."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import fields, is_dataclass
from typing import Any

import pytest
from numpydoc.docscrape import ClassDoc
from numpydoc.validate import validate

PACKAGES = (
    "friction_fmus",
    "friction_fmus.conditions",
    "friction_fmus.data",
    "friction_fmus.identification",
    "friction_fmus.report",
    "friction_fmus.study",
    "harness",
)
"""Packages whose ``__all__`` is the public surface."""

CHECKS = {
    "GL03",  # no double blank lines
    "GL06",  # only sections that numpydoc knows
    "GL07",  # sections in numpydoc's order
    "GL08",  # there is a docstring
    "SS02",  # the summary starts with a capital letter
    "SS03",  # and ends with a period
    "SS05",  # and is imperative: "Return", not "Returns"
    "PR01",  # every parameter is documented
    "PR02",  # no other parameters are
    "PR03",  # in the order of the signature
    "PR04",  # each with its type
    "PR07",  # and a description
    "RT01",  # a section Returns
    "RT03",  # with a description
    "YD01",  # or a section Yields
}


def public(package: str) -> list[str]:
    """Dotted names of the functions and classes of a package, and of the methods of its classes.

    Methods of `harness` are not included: most of them implement the interface of `Part`, which documents them.
    """
    module = importlib.import_module(package)
    names = []
    for name in module.__all__:
        found = getattr(module, name)
        home = str(getattr(found, "__module__", ""))
        if not home.startswith(("friction_fmus", "harness")) or not (
            inspect.isfunction(found) or inspect.isclass(found)
        ):
            continue
        names.append(f"{package}.{name}")
        if inspect.isclass(found) and home.startswith("friction_fmus"):
            methods = [key for key, value in vars(found).items() if inspect.isfunction(value) and key[0] != "_"]
            names += [f"{package}.{name}.{method}" for method in methods]
    return names


def resolved(name: str) -> Any:
    """The object with a dotted name."""
    package = max((each for each in PACKAGES if name.startswith(f"{each}.")), key=len)
    found: Any = importlib.import_module(package)
    for part in name.removeprefix(f"{package}.").split("."):
        found = getattr(found, part)
    return found


def problems(name: str) -> list[str]:
    """Problems of the docstring with a dotted name.

    numpydoc expects the fields of a dataclass under Parameters, but they may also be under Attributes. A protocol has
    no parameters.
    """
    found = resolved(name)
    errors = [f"{code} {text}" for code, text in validate(name)["errors"] if code in CHECKS]
    if is_dataclass(found):
        text = ClassDoc(found)
        entries = ",".join(entry.name for section in ("Parameters", "Attributes") for entry in text[section])
        missing = {field.name for field in fields(found)} - {entry.strip() for entry in entries.split(",")}
        errors = [error for error in errors if not error.startswith("PR01")]
        errors += [f"the field {field} is not documented" for field in sorted(missing)]
    elif getattr(found, "_is_protocol", False):
        errors = [error for error in errors if not error.startswith("PR01")]
    return errors


@pytest.mark.parametrize("name", [name for package in PACKAGES for name in public(package)])
def test_a_public_name_has_a_complete_docstring(name: str) -> None:
    assert problems(name) == []
