"""The tests of the FMI functions and of states, run on a composite FMU."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from every_block.test_block_state import (  # noqa: F401
    elsewhere,
    test_a_reset_instance_is_a_new_one,
    test_a_restored_state_continues_with_the_same_bits,
    test_a_serialised_state_continues_in_another_process,
    test_a_state_fits_another_instance,
    test_a_state_outlives_steps_that_promise_never_to_return,
    test_instances_in_turn_are_each_as_if_alone,
    test_the_same_state_has_the_same_bytes,
    test_threads_with_an_instance_each_are_as_if_alone,
)
from shell.exchanging import SITUATIONS, begin, go_on, go_to
from shell.facade import IN_3, in_either
from shell.fixtures import instance, situation  # noqa: F401
from shell.instance import Instance, Library, load, signals
from shell.selection import COMPOSITES
from shell.test_call_sequence import (  # noqa: F401
    test_a_faulty_instantiation_gives_null_and_says_why,
    test_after_terminate_the_last_values_can_still_be_read,
    test_every_block_has_that_table,
    test_freeing_nothing_does_nothing,
    test_the_library_says_what_it_is,
)
from shell.test_logging import test_the_categories_of_the_xml_are_those_of_the_library  # noqa: F401
from shell.test_states import (  # noqa: F401
    test_a_state_pointer_is_used_again,
    test_bytes_of_another_length_are_refused,
    test_damaged_bytes_are_refused,
    test_instances_leave_no_memory_behind,
    test_no_bytes_at_all_are_refused,
    test_too_small_a_buffer_is_refused,
)
from shell.test_steps import (  # noqa: F401
    test_a_later_start_time_is_the_first_point,
    test_a_master_that_multiplies_instead_of_adding_is_followed,
    test_a_step_beyond_the_stop_time_is_an_error,
    test_impossible_steps_are_errors_and_change_nothing,
    test_steps_that_differ_by_rounding_are_accepted,
    test_the_last_step_may_pass_the_stop_time_by_rounding,
    test_time_is_exactly_t_plus_h,
)
from shell.test_values import (  # noqa: F401
    test_a_get_with_one_wrong_reference_writes_nothing,
    test_a_set_with_one_bad_value_sets_none,
    test_fixed_parameters_cannot_be_set_during_the_run,
    test_nothing_is_a_legal_number_of_variables,
    test_one_call_reads_all_reals_and_time_among_them,
    test_outputs_and_time_cannot_be_set_before_the_run_either,
    test_outputs_locals_and_time_cannot_be_set,
    test_start_values_that_are_not_finite_are_discarded,
    test_there_are_no_strings,
    test_unknown_and_wrongly_typed_references_are_errors,
    test_values_that_are_not_finite_are_discarded,
)
from thorough import some


@pytest.fixture(scope="module")
def servo3(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A composite of FMI 3.0 behind the facade, which takes seconds to compile."""
    return in_either(COMPOSITES[1] + IN_3, tmp_path_factory.mktemp("composite3"))


@pytest.fixture(params=some([*COMPOSITES, COMPOSITES[1] + IN_3], [COMPOSITES[0], COMPOSITES[1] + IN_3]))
def library(request: pytest.FixtureRequest, compose: Callable[[str], Path]) -> Library:
    """Each of these composite FMUs in turn."""
    of_fmi_3 = request.param.endswith(IN_3)
    return load(request.getfixturevalue("servo3") if of_fmi_3 else compose(request.param))


@pytest.fixture
def running(library: Library, request: pytest.FixtureRequest) -> Iterator[Instance]:
    """An instance after a step of 10 ms, where the test asks for it."""
    asked = "situation" in request.fixturenames
    where = request.getfixturevalue("situation") if asked else "co-simulation"
    between = "co-simulation" if where == "co-simulation" else "continuous-time mode"
    first = signals(library, 1, 1)
    with Instance(library, kind=SITUATIONS[where]) as made:
        begin(made, SITUATIONS[where], **first[0])
        go_on(made, between, first, 0.0, 0.01)
        go_to(made, where)
        yield made
