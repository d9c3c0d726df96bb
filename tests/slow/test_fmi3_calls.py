"""States and refused calls of every block in FMI 3.0, by the tests of FMI 2.0."""

from __future__ import annotations

from tempfile import mkdtemp

import pytest
from every_block.test_block_state import (  # noqa: F401
    elsewhere,
    running,
    test_a_reset_instance_is_a_new_one,
    test_a_restored_state_continues_with_the_same_bits,
    test_a_serialised_state_continues_in_another_process,
    test_a_state_fits_another_instance,
    test_a_state_outlives_steps_that_promise_never_to_return,
    test_instances_in_turn_are_each_as_if_alone,
    test_the_same_state_has_the_same_bytes,
    test_threads_with_an_instance_each_are_as_if_alone,
)
from every_block.test_refused_calls import test_results_that_are_not_finite_change_nothing  # noqa: F401
from shell.facade import IN_3, in_either
from shell.fixtures import instance, situation  # noqa: F401
from shell.instance import Library, load
from thorough import some

from friction_fmus import catalogue


@pytest.fixture(scope="module", params=some(tuple(catalogue()), ("LuGre", "GMS", "PID")))
def library(request: pytest.FixtureRequest) -> Library:
    """Each block of the catalogue in turn."""
    return load(in_either(request.param + IN_3, mkdtemp(prefix="fmi3-")))
