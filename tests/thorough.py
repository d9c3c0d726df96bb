"""What only `nightly.sh` runs in full, with ``THOROUGH=1``; other runs have a selection."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from typing import Final, TypeVar
from zlib import crc32

import pytest

_T = TypeVar("_T")
THOROUGH = bool(os.environ.get("THOROUGH"))

ONE_IN: Final[Mapping[str, int]] = {
    "check/test_check_catalogue.py::test_nothing_is_found_in_a_block": 2,
    "codegen/test_numbers.py::test_double_has_the_bits_of_the_fmu_and_of_casadi": 2,
    "codegen/test_numbers.py::test_float_is_near_casadi": 2,
    "codegen/test_travel.py::test_float_is_double_over_the_travel": 2,
    "composite/test_composite_as_block.py::test_extreme_finite_values_are_computed_or_refused_but_never_give_nan": 2,
    "every_block/test_block_package.py::test_every_parameter_matters": 2,
    "exchange/test_exchange_runs.py::test_both_kinds_agree": 2,
    "harness/test_newton_with_blocks.py::test_models_with_a_state_move_as_with_tiny_explicit_steps": 2,
    "laws/test_emit.py::test_every_law_keeps_casadis_bits_over_a_long_run": 3,
    "laws/test_emit.py::test_random_decisions_have_casadis_bits": 2,
    "laws/test_law_blocks.py::test_the_blocks_sample_is_casadis": 3,
    "laws/test_law_blocks.py::test_the_table_says_what_the_law_says": 2,
    "laws/test_loops_over_elements.py::test_random_operations_on_elements_have_casadis_bits": 2,
    "slow/fuzzing/test_forged_states.py::test_a_forged_memory_is_refused_or_bears_any_use": 2,
    "slow/fuzzing/test_native_checks.py::test_fuzzing_finds_nothing": 5,
    "slow/fuzzing/test_native_checks.py::test_no_level_of_optimisation_brings_out_a_warning": 5,
    "slow/fuzzing/test_native_checks.py::test_threads_with_an_instance_each_under_a_sanitizer": 5,
    "slow/fuzzing/test_random_calls.py::test_random_calls": 2,
    "slow/importers/test_composite_importers.py::test_one_and_two_axes_under_control": 2,
    "slow/test_code_of_laws.py::test_c99_and_c17_without_a_warning_and_the_example_runs": 2,
    "slow/test_code_of_laws.py::test_double_has_the_bits_of_the_fmu_and_of_casadi_over_a_long_run": 5,
    "slow/test_code_of_laws.py::test_every_law_keeps_casadis_bits_over_a_long_run": 5,
    "slow/test_code_of_laws.py::test_float_is_near_casadi_over_a_long_run": 5,
    "slow/test_code_of_laws.py::test_the_blocks_sample_is_casadis": 5,
    "slow/test_code_of_laws.py::test_the_unit_test_passes": 5,
    "slow/test_command_leftovers.py::test_a_command_leaves_only_what_it_is_asked_for": 2,
    "slow/test_examples.py::test_claim_holds_and_the_page_shows_it": 5,
    "slow/test_exchange_motions.py::test_random_motions": 3,
    "slow/test_kernels.py::test_decisions_are_the_same_with_every_kernel": 3,
    "slow/test_long_steps.py::test_a_step_that_takes_too_long_is_discarded_with_the_reason": 2,
    "slow/test_long_steps.py::test_no_step_takes_longer_than_five_seconds": 2,
    "slow/test_long_steps.py::test_no_step_with_the_largest_counts_takes_longer_than_five_seconds": 2,
    "slow/test_misra.py::test_the_readme_lists_the_deviations": 3,
    "slow/test_performance.py::test_benchmark_runs_and_its_rows_stand_in_the_page": 3,
    "slow/test_report_in_a_browser.py::test_a_screen_shows_all_without_network_or_error": 2,
    "slow/test_source_code.py::test_two_builds_are_the_same_bytes": 5,
    "slow/test_target.py::test_the_target_computes_the_same_over_the_travel": 3,
    "slow/test_target.py::test_the_unit_test_passes_on_the_target": 3,
}
"""Tests that take long and are repeated for many blocks, laws or scripts: one repetition in so many runs."""


def slowness() -> float:
    """Return how much slower this machine is just now than one on which the loop below takes 0.25 s, at least 1.

    The processor time of the same work differs by a factor of 2.5 on shared machines.
    """
    begin = time.process_time()
    total = 0
    for i in range(3_000_000):
        total += i * i
    return max(1.0, (time.process_time() - begin) / 0.25)


nightly = pytest.mark.skipif(not THOROUGH, reason="takes long: runs each night, with THOROUGH=1")


def some(every: Sequence[_T], chosen: Sequence[_T]) -> Sequence[_T]:
    """Return all cases each night, and the chosen ones otherwise."""
    return every if THOROUGH else chosen


def left_out(items: Sequence[pytest.Item]) -> set[pytest.Item]:
    """Return the repetitions that do not run; always the same ones of any selection of blocks, laws or scripts."""
    repetitions: dict[str, list[pytest.Item]] = {}
    for item in items:
        name = item.nodeid.partition("[")[0].partition("tests/")[2]
        if name in ONE_IN:
            repetitions.setdefault(name, []).append(item)
    out: set[pytest.Item] = set()
    for name, all_of_it in repetitions.items():
        kept = -(-len(all_of_it) // ONE_IN[name])
        out.update(sorted(all_of_it, key=lambda item: crc32(item.nodeid.encode()))[kept:])
    return out
