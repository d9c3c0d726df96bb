"""Random systems give the same values, messages and logs with the direct calls of the blocks and with those of FMI."""

from __future__ import annotations

import logging
import os
import pickle
from collections.abc import Callable
from typing import Any

import pytest
from composite.composite_systems import random_seed_settings, random_systems
from hypothesis import given, reject, seed
from hypothesis import strategies as st
from thorough import nightly

from harness import HarnessError, System
from harness.parts import fmi2

MASTERS = ("gauss-seidel", "jacobi", "newton")
HUGE = (None, None, 1e155, 1e300)
"""A start value for some systems, which then fail."""


class Messages(logging.Handler):
    """Keeps what is logged."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


def all_of(make: Callable[[], System], master: str) -> list[Any]:
    """Everything that a run shows."""
    logger, messages = logging.getLogger("harness"), Messages()
    logger.addHandler(messages)
    try:
        with make() as system:
            result, error = system.run(master=master), None
    except HarnessError as failed:
        result, error = failed.result, str(failed)
    finally:
        logger.removeHandler(messages)
    if result is None:
        return [error, messages.texts]
    values = {str(name): result[name].to_numpy().tobytes() for name in result.data_vars}
    return [error, values, sorted(result.attrs.items()), messages.texts]


@nightly
@seed(20261128)
@random_seed_settings(int(os.environ.get("RANDOM_SYSTEMS", "8")))
@given(data=st.data())
def test_both_kinds_of_calls_show_the_same(data: st.DataObject) -> None:
    try:
        system = data.draw(random_systems())
    except HarnessError:  # the harness refuses some
        reject()
    start, huge = dict(system.start), data.draw(st.sampled_from(HUGE))
    reals = [name for name, value in start.items() if isinstance(value, float) and not name.endswith(".Ts")]
    if huge is not None and reals:
        start[data.draw(st.sampled_from(reals))] = huge
    text = pickle.dumps((system.parts, system.wires, system.experiment))

    def make() -> System:
        parts, wires, experiment = pickle.loads(text)
        return System(parts.values(), wires, start, experiment)

    for master in MASTERS:
        with pytest.MonkeyPatch.context() as patch:
            direct = all_of(make, master)
            patch.setattr(fmi2, "_direct_calls", lambda library: 0)
            assert repr(all_of(make, master)) == repr(direct)
