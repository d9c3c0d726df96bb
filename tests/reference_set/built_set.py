"""The reference set, built once for the tests of a process."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from friction_fmus.reference.case import CASES, ReferenceCase, read_case, read_cases
from friction_fmus.reference.set_builder import build_case

LONG = ("million",)  # parts of the names of cases with many steps


@cache
def folder() -> Path:
    """The folder of the set, removed at the end."""
    made = Path(tempfile.mkdtemp(prefix="reference-set"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


@cache
def built(name: str) -> ReferenceCase:
    """A case of the set, built at the first call."""
    return read_case(build_case(read_case(CASES / name), folder()))


def names() -> Sequence[str]:
    """Names of all cases."""
    return [case.name for case in read_cases(CASES)]


def is_long(name: str) -> bool:
    """Whether a case has many steps."""
    return any(part in name for part in LONG)
