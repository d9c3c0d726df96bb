"""A short form of the search for runs that are wrong without a warning; `coupling_search.py` is the long one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from accuracy import event_driven, state_models
from coupling_search import Composites, References, draw, judge
from thorough import landing, nightly, some


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search gives up a reference after a second; a slow processor needs more for the ones below."""
    for module in (event_driven, state_models):
        monkeypatch.setattr(module, "SECONDS", 60.0)


@pytest.mark.parametrize("seed", some([136, 192, 226, 444, 542, 694], [136, 444, 542]))
def test_swings_within_a_step_that_follow_a_jump(seed: int, tmp_path: Path) -> None:
    """A mass that swings 2 to 1900 radians within a step, on rigid friction, against closed forms."""
    case, made = draw(seed), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert {judge(case, answers, run, made) for run in ("newton", "adaptive")} <= {"right", "false alarm"}


def test_a_mass_that_swings_3900_radians_within_a_step(tmp_path: Path) -> None:
    """On Tustin friction."""
    case, made = draw(678), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, "newton", made) == "right"


@pytest.mark.parametrize(
    ("seed", "run"), some([(1008, "newton"), (1008, "adaptive"), (990, "newton")], [(1008, "newton")])
)
def test_systems_that_were_wrong_without_a_warning_or_refused(seed: int, run: str, tmp_path: Path) -> None:
    """A load beyond static friction for a small part of a step (1008), a solver that stagnated (990)."""
    case, made = draw(seed), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, run, made) == "right"


def test_friction_that_falls_with_the_velocity(tmp_path: Path) -> None:
    """A light mass slips every 8 ms: long implicit steps damped the growth of its motion."""
    case, made = draw(459), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, "newton", made) == "right"


@pytest.mark.parametrize(
    ("seed", "run"),
    some(
        [
            *((2827, "newton"), (175, "jacobi"), (681, "jacobi")),
        ],
        [(681, "jacobi")],
    ),
)
def test_errors_that_add_up_are_told(seed: int, run: str, tmp_path: Path) -> None:
    """Of the distance along a contact over many steps; of a force that jumps two steps late."""
    case, made = draw(seed), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, run, made) == "warned"


@pytest.mark.parametrize(
    ("seed", "run"),
    some(
        [
            *((seed, "newton") for seed in (469, 1000, 1135)),
            *((seed, run) for seed in (1177, 1193) for run in ("newton", "adaptive")),
            *((seed, run) for seed in (1526, 1652) for run in ("newton", "composite")),
            *((seed, "adaptive") for seed in (2307, 2316, 2327, 2472)),
        ],
        [(469, "newton"), (1193, "newton"), (1526, "newton"), (1652, "newton"), (2327, "adaptive"), (2472, "adaptive")],
    ),
)
def test_errors_that_were_tolerated(seed: int, run: str, tmp_path: Path) -> None:
    """Errors of many parts of a step that add up (469, 1000, 1135); errors that are small compared with a force that
    was large for an instant (1177, 1193); the force while a mass rests from the start (1526) or turns round (1652);
    motions that are over within a small part of the first step (2307, 2327) or after a break-away (2316); a stop
    against viscous friction (2472)."""
    case, made = draw(seed), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, run, made) == "right"


@pytest.mark.parametrize(
    ("seed", "run"),
    some(
        [
            *((seed, "newton") for seed in (801, 933, 1197, 1371, 1783, 1841, 1910, 1995)),
            *((seed, "composite") for seed in (1555, 1565)),
        ],
        [(1841, "newton"), (1995, "newton")],
    ),
)
def test_errors_that_each_check_tolerated(seed: int, run: str, tmp_path: Path) -> None:
    """Of pieces of divided steps, all to one side (801, 933, 1565, 1783, 1910); of whole steps (1197, 1555, 1995);
    of a mass that swings within the step although its velocity at the ends varies slowly (1371, 1841)."""
    case, made = draw(seed), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, run, made) == "right"


@pytest.mark.parametrize("run", some(["newton", "adaptive", "composite"], ["newton"]))
def test_a_load_that_changes_twice_within_a_step(run: str, tmp_path: Path) -> None:
    """No master sees the first change."""
    case, made = draw(1242), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, run, made) == "warned"


@landing
@pytest.mark.parametrize("ratio", some([0.25, 0.79, 1.3, 3.7], [1.3]))
def test_a_slip_that_begins_late_in_an_inner_step(ratio: float, tmp_path: Path) -> None:
    """A light mass slips within two thirds of an inner step, of which a part lies in the next one."""
    case, made = replace(draw(108), ratio=ratio), Composites(tmp_path)
    answers = References(case)
    assert answers.found
    assert judge(case, answers, "composite", made) == "right"


@nightly
@pytest.mark.parametrize("seed", some([2, 8, 10, 16, 22, 24, 31, 33, 73, 86, 723], [2]))
def test_no_run_is_wrong_without_a_warning(seed: int, tmp_path: Path) -> None:
    """Systems in which rest once ended at sliding friction, and four with states."""
    case, made = draw(seed), Composites(tmp_path)
    answers = References(case)
    assert answers.found, "the system is not fit to judge by"
    for run in ("newton", "adaptive", "composite"):
        assert judge(case, answers, run, made) in ("right", "false alarm", "warned"), run
