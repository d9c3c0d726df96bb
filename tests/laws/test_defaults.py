"""A default of a law stands once: a second place that has one, such as the study or a friction block, has the same."""

from __future__ import annotations

from typing import Any

import pytest
from thorough import some

from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.blocks.catalogue import find, laws_folder
from friction_fmus.blocks.probe import FIXED, PARAMETER
from friction_fmus.errors import FrictionError
from friction_fmus.export.block_fmu import describe_block
from friction_fmus.lawkit.declarations import PARAMETERS
from friction_fmus.lawkit.law import Law, discover_laws
from friction_fmus.study.config import parse_config

LAWS = {law.name: law for law in discover_laws(laws_folder())}
SERVO = {"Ts": 1e-3, "force_limit": 10.0}

TWINS = {
    "CoulombFeedforward": "Coulomb",
    "DahlFeedforward": "Dahl",
    "DeadZoneFeedforward": "DeadZoneTorque",
    "ElastoPlasticFeedforward": "ElastoPlastic",
    "GMSFeedforward": "GMS",
    "GMSObserver": "GMS",
    "KarnoppFeedforward": "Karnopp",
    "LeuvenFeedforward": "Leuven",
    "LuGreFeedforward": "LuGre",
    "LuGreObserver": "LuGre",
    "ModifiedLeuvenFeedforward": "ModifiedLeuven",
    "StaticFeedforward": "Stribeck",
    "TustinFeedback": "Tustin",
    "Prefilter": "PID",
    "PreviewPrefilter": "PID",
    "ResetPID": "PID",
    "IterativeLearning": "PID",
    "RepetitiveController": "PID",
}
"""Law -> the block whose parameters of the same name it must have at its start."""

OWN = {"gain", "m", "u_min", "u_max", "Ts", "N"}
"""Parameters of the law's own: the share, the mass of its feedforward, the limits, samples of a period."""


def start(law: Law, name: str) -> Any:
    return next(v.start for v in law.select(*PARAMETERS) if v.name == name)


def starts(name: str) -> dict[str, float]:
    rows = describe_block(find(name)).variables
    return {row.name: row.start for row in rows if row.role in (PARAMETER, FIXED)}


def test_the_cascade_has_no_integral_by_default() -> None:
    assert start(LAWS["CascadePPI"], "ki") == 0.0


@pytest.mark.parametrize("law", GAINS)
@pytest.mark.parametrize("place", range(3))
def test_a_gain_that_a_study_lets_one_leave_out_is_that_of_the_law(law: str, place: int) -> None:
    names = GAINS[law]
    left_out = names[place]
    servo = {"law": law, **SERVO, **{name: 7.0 for name in names if name != left_out}}
    try:
        config = parse_config({"data": {"record": "emps"}, "servo": servo})
    except FrictionError as error:
        assert f"has no {left_out}; add it" in str(error)
    else:
        assert config.servo is not None
        assert config.servo.gains[left_out] == start(LAWS[law], left_out)


@pytest.mark.parametrize("law", GAINS)
def test_the_servo_of_a_study_has_no_gains_of_its_own(law: str) -> None:
    first, second, _ = GAINS[law]
    with pytest.raises(KeyError):
        _ = Servo(law, {first: 1.0, second: 1.0}, 1e-3, 1.0).pid


@pytest.mark.parametrize(("law", "block"), some([*TWINS.items()], [*TWINS.items()][::4]))
def test_a_law_starts_with_the_parameters_of_its_block(law: str, block: str) -> None:
    mine, theirs = starts(law), starts(block)
    shared = (mine.keys() & theirs.keys()) - OWN
    assert shared
    assert {name: mine[name] for name in shared} == {name: theirs[name] for name in shared}
