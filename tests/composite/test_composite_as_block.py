"""The tests of every block, run on composite FMUs; where a loop solved to a tolerance differs, a test of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from every_block import test_block_package as package
from every_block import test_block_steps as steps
from every_block import test_refused_calls as refused
from every_block.test_block_derivatives import (  # noqa: F401
    test_asking_for_directional_derivatives_changes_nothing,
    test_asking_for_output_derivatives_changes_nothing,
    test_directional_derivatives_are_zero_where_nothing_is_declared,
    test_held_inputs_are_constant,
)
from every_block.test_block_documentation import (  # noqa: F401
    page,
    test_a_screen_reader_finds_its_way,
    test_every_reference_leads_to_a_file_of_the_fmu,
    test_it_fits_on_a_phone,
    text,
)
from every_block.test_block_extremes import (  # noqa: F401
    test_denormal_inputs_are_inputs,
    test_huge_and_tiny_steps_are_answered_or_refused_with_the_reason,
)
from every_block.test_block_package import (  # noqa: F401
    dependencies,
    test_a_derivative_has_the_unit_of_its_state_per_second,
    test_every_parameter_and_input_has_a_start_value,
    test_fmpy_finds_no_fault,
    test_no_path_of_the_building_machine_is_in_the_binary,
    test_simulates_its_default_experiment,
    test_start_values_of_the_xml_are_those_of_the_binary,
    test_structure_is_complete_and_in_order,
    test_the_archive_is_as_section_2_3_of_the_standard_wants_it,
    test_the_header_of_the_xml_is_filled,
    test_the_xml_meets_the_schema,
    test_units_are_defined_and_right,
    test_value_references_are_unique_and_time_is_the_independent_variable,
    test_what_is_not_declared_as_dependency_has_no_influence,
    xml,
)
from every_block.test_block_steps import (  # noqa: F401
    test_an_extra_tiny_step_hardly_changes_anything,
    test_nothing_is_printed,
    test_the_bits_do_not_depend_on_logging_or_on_who_reads,
    test_the_same_run_gives_the_same_bits,
)
from every_block.test_block_terminals import (  # noqa: F401
    test_icons_show_a_curve_or_a_sketch,
    test_meets_the_schema_of_fmi_3,
    test_members_are_ports_of_the_block,
    test_pixel_images_are_square_and_carry_no_date,
    test_vector_images_are_small_and_refer_to_nothing_outside,
)
from every_block.test_block_traps import test_no_call_divides_by_zero_overflows_or_is_invalid  # noqa: F401
from every_block.test_block_values import (  # noqa: F401
    test_everything_declared_can_be_read_in_initialization_mode_and_later,
    test_inputs_pass_to_outputs_in_initialization_mode,
    test_reading_twice_gives_the_same,
    test_values_outside_their_limits_are_discarded,
    test_what_was_set_is_read_back,
)
from lxml import etree
from shell.fixtures import instance, running, situation  # noqa: F401
from shell.instance import Instance, Library, load, signals
from shell.selection import COMPOSITES
from thorough import landing, nightly, some


@pytest.fixture(params=some(COMPOSITES, COMPOSITES[:1]))
def library(request: pytest.FixtureRequest, compose: Callable[[str], Path]) -> Library:
    """Each of these composite FMUs in turn."""
    return load(compose(request.param))


@nightly
def test_extreme_finite_values_are_computed_or_refused_but_never_give_nan(library: Library) -> None:
    """Of a composite, its inner loops take long to refuse them."""
    steps.test_extreme_finite_values_are_computed_or_refused_but_never_give_nan(library)


@landing
def test_results_that_are_not_finite_change_nothing(library: Library, situation: str) -> None:  # noqa: F811
    """Values of any size make inner steps long."""
    refused.test_results_that_are_not_finite_change_nothing(library, situation)


@landing
@pytest.mark.parametrize("library", COMPOSITES[:1], indirect=True)
def test_every_parameter_matters(library: Library) -> None:
    """Of the small one: the search for values with an effect takes minutes for the servo."""
    package.test_every_parameter_matters(library)


def test_outputs_follow_inputs_that_are_set_without_a_step(library: Library, xml: etree._Element) -> None:  # noqa: F811
    """Those of continuous parts: a sampled part takes its inputs at its samples, and none depends on them at once."""
    acting = set().union(*dependencies(xml, library, "Outputs").values())
    outputs = library.names("output")
    with Instance(library) as run, Instance(library) as new:
        run.initialise()
        inputs = signals(library, 9, 1)[0]
        run.everything()
        run.set(inputs)
        new.initialise(**{name: value for name, value in inputs.items() if name in acting})
        assert run.get(*outputs) == new.get(*outputs)


def test_outputs_in_a_run_depend_at_once_on_declared_inputs_only(library: Library, xml: etree._Element) -> None:  # noqa: F811
    """Against outputs read after the inputs were set again: the loop solved in a step has an error of 1e-9."""
    declared = dependencies(xml, library, "Outputs")
    outputs = library.names("output")
    with Instance(library) as run:
        run.initialise()
        for k, inputs in enumerate(signals(library, 3, 20)):
            run.set({name: run.get1(name) for name in inputs})
            before = run.get(*outputs)
            for name, value in inputs.items():
                held = run.get1(name)
                run.set({name: value})
                for output, old, new in zip(outputs, before, run.get(*outputs), strict=True):
                    assert old == new or name in declared[output], (output, name)
                run.set({name: held})
            run.set(inputs)
            run.step(0.01 * k, 0.01)


def test_the_page_shows_parts_and_connections(library: Library, page: etree._Element) -> None:  # noqa: F811
    assert "Canudas de Wit" in text(page)
    tables = {text(table.find("caption")): table for table in page.iter("table")}
    parts = {name.removeprefix("der(").partition(".")[0] for name in library.variables} - {"time"}
    assert {text(row[0]) for row in tables["FMUs whose sources this FMU contains"].iter("tr")} >= parts
    ends = [text(cell) for row in tables["Values that parts exchange"].iter("tr") for cell in row[:2]]
    assert {end.partition(".")[2] for end in ends} >= {"v", "F"}
    rows = tables["Variables and their start values"].iter("th")
    assert {text(head) for head in rows if head.get("scope") == "row"} == set(library.variables)


def test_values_may_be_set_at_any_time_before_the_first_step(library: Library) -> None:
    """After initialization mode, the iteration begins at other values, so that digits below its tolerance differ."""
    values = signals(library, 11, 1)[0]
    for name in library.names("parameter", type="Real"):
        v = library.variables[name]
        if v.variability == "tunable":
            value = (library.start(name) or 0.1) * 1.05
            values[name] = min(max(value, float(v.min or "-inf")), float(v.max or "inf"))
    names, found = library.names(type="Real"), []
    for when in ("instantiated", "initialization mode", "after it"):
        with Instance(library) as run:
            if when == "instantiated":
                run.set(values)
            run.setup()
            run.must("EnterInitializationMode")
            if when == "initialization mode":
                run.set(values)
            run.must("ExitInitializationMode")
            if when == "after it":
                run.set(values)
            assert run.get(*values) == list(values.values())
            run.step(0.0, 0.01)
            found.append(run.get(*names))
    assert found[0] == found[1]
    for name, first, last in zip(names, found[0], found[2], strict=True):
        assert last == pytest.approx(first, rel=1e-6, abs=1e-9), name
