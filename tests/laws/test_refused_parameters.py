"""Relations between parameters without which a law has no meaning: refused at initialisation, accepted just inside."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shell.instance import ERROR, OK, Instance, load
from thorough import few

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
PAIR = {"zero": 0.0, "pair[1]": 0.6, "pair[2]": 0.9}

CASES: list[tuple[str, str, Mapping[str, float], Mapping[str, float]]] = [
    # law, text, refused, accepted
    ("Dither", "frequency < 1/(2 Ts)", {"Ts": 1e-3, "frequency": 500.0}, {"Ts": 1e-3, "frequency": 499.9}),
    ("AdaptiveLuGre", "theta_min <= theta0 <= theta_max", {"theta0": 10.1}, {"theta0": 10.0}),
    ("AdaptiveLuGre", "theta_min <= theta0 <= theta_max", {"theta0": -0.1}, {"theta0": 0.0}),
    ("AdaptiveLuGre", "theta_min <= theta0 <= theta_max", {"theta_min": 11.0, "theta0": 10.5}, {"theta_min": 1.0}),
    ("AdaptiveSlidingMode", "Fc0 <= Fc_max", {"Fc_max": 0.9}, {"Fc_max": 1.0}),
    ("AdaptiveSlidingMode", "Fv0 <= Fv_max", {"Fv_max": 0.3}, {"Fv_max": 0.4}),
    *[
        case
        for name in ("Prefilter", "PreviewPrefilter")
        for case in (
            (
                name,
                "Ts Ki < Kp or Ki = 0",
                {"Ts": 1e-3, "Kp": 10.0, "Ki": 10.1e3},
                {"Ts": 1e-3, "Kp": 10.0, "Ki": 9.9e3},
            ),
            (name, "Ts Ki < Kp or Ki = 0", {"Kp": 0.0}, {"Kp": 0.0, "Ki": 0.0}),
            # 2 Ts Kp = 24, 4 Kd + Ts^2 Ki = 4 Kd + 0.25
            (name, "2 Ts Kp < 4 Kd + Ts^2 Ki", {"Ts": 1e-3, "Kd": 5.93}, {"Ts": 1e-3, "Kd": 5.94}),
        )
    ],
    *[
        (
            name,
            "alpha[1] + ... + alpha[N] > 0",
            {"N": 1.0, "alpha[1]": 0.0},
            {"N": 1.0, "alpha[1]": 1e-9, "alpha[2]": 0.0},
        )
        for name in ("GMSFeedforward", "GMSObserver")
    ],
    ("DiscreteInverse", "zero = 0, |zero| > 1 or zero_phase", {"zero": -1.0}, {"zero": -1.01}),
    ("DiscreteInverse", "zero = 0, |zero| > 1 or zero_phase", {"zero": 0.5}, {"zero": 0.5, "zero_phase": 1.0}),
    ("DiscreteInverse", "pair = 0, |pair| > 1 or zero_phase", PAIR | {"pair[2]": 0.8}, PAIR),
    ("DiscreteInverse", "zero and pair not 1", {"zero": 1.0, "zero_phase": 1.0}, {"zero": 0.9, "zero_phase": 1.0}),
    ("MultiLoopKarnopp", "CV_den[1] and G_den[1] not 0", {"CV_den[1]": 0.0, "CV_den[2]": 1.0}, {"CV_den[2]": 1.0}),
    ("MultiLoopKarnopp", "CV_den[1] and G_den[1] not 0", {"G_den[1]": 0.0, "G_den[2]": 1.0}, {"G_den[2]": 1.0}),
    *[
        ("MultiLoopKarnopp", "2/Ts is not a pole of CV, G or CV G/(1 + CV G)", {"Ts": 0.5, **refused}, {"Ts": 0.5})
        for refused in ({"CV_den[2]": -4.0}, {"G_den[2]": -4.0}, {"CV_num[1]": -4.0})
    ],
    ("DiscreteInverse", "preview >= 2 with a pair", PAIR | {"preview": 1.9}, PAIR | {"preview": 2.0}),
]


@pytest.mark.parametrize(("name", "text", "refused", "accepted"), CASES)
def test_a_condition_is_refused_and_its_inside_accepted(
    name: str, text: str, refused: Mapping[str, float], accepted: Mapping[str, float], build_fmu: Callable[..., Path]
) -> None:
    library = load(build_fmu(name))
    for values, status in ((refused, ERROR), (accepted, OK)):
        with Instance(library) as run:
            run.setup()
            run.must("EnterInitializationMode")
            run.set(values)
            assert run.call("ExitInitializationMode") == status
            if status == ERROR:
                assert f'the parameters of "instance" must satisfy {text}' in run.messages[-1][3].decode()


def test_every_condition_has_a_case() -> None:
    told = {(law.name, text) for law in LAWS.values() for text in law.conditions.texts if text != "u_min <= u_max"}
    assert told == {case[:2] for case in CASES}


@settings(max_examples=few(200), deadline=None, derandomize=True, database=None)
@given(*[st.floats(-3.0, 3.0)] * 3)
def test_prefilter_conditions_are_those_of_its_poles(a: float, b: float, c: float) -> None:
    """The recursion of d and D as a matrix, for gains over six decades."""
    Ts, Kp, Kd, Ki = 1e-3, 10.0**a, 1e-3 * 10.0**b, 1e3 * 10.0**c
    matrix = np.array([[1.0 - Ts * Kp / Kd, -Ts * Ki / Kd], [Ts, 1.0]])
    radius = np.abs(np.linalg.eigvals(matrix)).max()
    if not math.isclose(radius, 1.0, abs_tol=1e-9):
        held = not LAWS["Prefilter"].conditions.violated({"Ts": Ts, "Kp": Kp, "Kd": Kd, "Ki": Ki})
        assert held == (radius < 1.0)


def test_above_half_the_sampling_rate_a_dither_is_another_one() -> None:
    """Of 900 Hz at 1 kHz samples are seen that are those of 100 Hz, backwards."""
    seen = []
    for frequency in (900.0, 100.0):
        phase, wave = 0.0, []
        for _ in range(20):
            found = LAWS["Dither"].evaluate({"Ts": 1e-3, "frequency": frequency, "phase": phase, "Ad": 1.0})
            phase = found["phase"]
            wave.append(found["u"])
        seen.append(np.array(wave))
    assert seen[0] == pytest.approx(-seen[1], abs=1e-9)
