"""The block diagram of a composite FMU: columns along the signals, no line through a box."""

from __future__ import annotations

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st
from thorough import few

from friction_fmus.export.composite.diagram import arrange


def test_a_servo_runs_from_left_to_right_and_back() -> None:
    parts = ["friction", "reference", "pid", "axis"]
    loop = [("reference", "pid"), ("pid", "axis"), ("axis", "pid"), ("axis", "friction"), ("friction", "axis")]
    layout = arrange(parts, loop)
    assert layout.places == {"reference": (0, 0), "pid": (1, 0), "axis": (2, 0), "friction": (3, 0)}
    assert layout.routes["friction", "axis"] == ((3, 0), (2, 0))


def test_a_line_passes_beside_a_box() -> None:
    layout = arrange(["r", "model", "pid"], [("r", "model"), ("model", "pid"), ("r", "pid")])
    (_, (column, row), _) = layout.routes["r", "pid"]
    assert column == layout.places["model"][0]
    assert row != layout.places["model"][1]


@settings(max_examples=few(200), deadline=None)
@given(st.integers(1, 8), st.data())
def test_no_two_boxes_and_no_line_share_a_place(count: int, data: st.DataObject) -> None:
    parts = [f"p{k}" for k in range(count)]
    pairs = data.draw(st.lists(st.tuples(st.sampled_from(parts), st.sampled_from(parts)), max_size=20))
    layout = arrange(parts, pairs)
    boxes = [*layout.places.values()]
    assert len(set(boxes)) == len(boxes)
    assert set(layout.routes) == {(a, b) for a, b in pairs if a != b}
    for (source, target), route in layout.routes.items():
        assert (route[0], route[-1]) == (layout.places[source], layout.places[target])
        assert not set(route[1:-1]) & set(boxes)
        steps = {after[0] - before[0] for before, after in itertools.pairwise(route)}
        assert steps in ({1.0}, {-1.0})
