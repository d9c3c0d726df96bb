"""Every law and controller: limits wind nothing up, and it comes back from a pause as from its start.

What may happen to a state while u is limited depends on what it is. A state that remembers what u was meant to do, an
integral or an adapted parameter, may not move so that u would be pushed further into the limit. All others follow
measurements or the reference; they must not grow: under inputs that do not change they end somewhere.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from shell.instance import Instance, Library, load, signals
from thorough import some

from friction_fmus.blocks.catalogue import catalogue, laws_folder
from friction_fmus.lawkit.law import Kind, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
BLOCKS = [block.name for block in catalogue().values() if block.kind == "compensator"]
LIMITED = [name for name in BLOCKS if "u_sat" in catalogue()[name].code]
ENABLED = [name for name in BLOCKS if re.search(r"\bCOMMAND\s*\(enable,", catalogue()[name].code)]
ESTIMATING = [name for name in BLOCKS if re.search(r"\bOUTPUT\s*\(F_hat,", catalogue()[name].code)]
Ts = 1e-3
LIMIT = 0.05

START = {
    "CascadePPI": {"ki": 6e3},
    "LuGreObserver": {"k": 50.0},
    "GMSObserver": {"k_e": 50.0},
    "IterativeLearning": {"N": 20, "fq": 0.0},
    "RepetitiveController": {"N": 20, "M": 2},
    "DisturbanceObserver": {"fq": 30.0},
    "Dither": {"Ad": 1.0},
    "ElastoPlasticEstimator": {"Fv": 1e3},
    "DiscreteInverse": {"a[1]": -0.5},
    "MultiLoopKarnopp": {"CV_num[2]": 6e3},
}
"""Parameters with which states move that rest at the start values, or with which u meets its limits."""

INTEGRALS = {
    "PID": ("integral",),
    "ResetPID": ("integral",),
    "CascadePPI": ("integral",),
    "AdaptiveLuGre": ("learned",),
    "AdaptiveSlidingMode": ("learned_c", "learned_v"),
    "ANDFC": ("learned0", "learned1", "learned2"),
    "ImplicitSuperTwisting": ("w",),
    "MultiLoopKarnopp": ("in_loop",),
}
"""States that remember what u was meant to do."""


PI_CONTROL = {"MultiLoopKarnopp": {"CV_num": (127.0, 6e3, 0.0)}}
"""Parameters of laws whose integral is off at the start values."""


BY_TIME = ("ImpulsiveControl", "IterativeLearning")
"""Limits of the first act on pulses one by one; the second learns between trials, see below."""


@pytest.fixture(params=some([name for name in LIMITED if name not in BY_TIME], ["PID", "ResetPID", "AdaptiveLuGre"]))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu(request.param, Ts=Ts))


def limits_of(library: Library) -> dict[str, float]:
    return {"u_min": -LIMIT, "u_max": LIMIT} | START.get(library.identifier, {})


def states(run: Instance) -> list[float]:
    """Of the variables those that show how it stands, but for the phase of a wave, which goes round."""
    return run.get(*(v for v in run.library.names("output", "local") if v not in ("phase", "fault", "u")))


def strong(library: Library, seed: int) -> Iterator[dict[str, float]]:
    """Constant inputs far beyond the limits, those of a loop that cannot move: enabled, no reset."""
    for values in signals(library, seed, 20):
        steady = {name: library.start(name) for name in library.names("input", type="Boolean")}
        yield {name: 3.0 * value for name, value in values.items()} | steady


def test_a_long_saturation_leaves_what_a_short_one_leaves(library: Library) -> None:
    """After 1 s and after 11 s in a limit: the states, and the way back. An integral would be 11 times as large."""
    compared = 0
    for inputs in strong(library, 1):
        back = [{key: 0.01 * value for key, value in values.items()} for values in signals(library, 5, 60)]
        runs = []
        for seconds in (1, 11):
            with Instance(library) as run:
                run.initialise(**limits_of(library))
                run.set(inputs)
                limited = True
                for k in range(seconds * 10):
                    run.step(k * 0.1, 0.1)
                    limited = limited and (run.get1("u_sat") != 0.0 or k == 0)
                stands = states(run)
                outputs = []
                for k, values in enumerate(back):
                    run.set(values)
                    run.step(seconds + k * Ts, Ts)
                    outputs += run.get("u", "u_sat")
                runs.append((limited, stands, outputs))
        (limited, short, after_short), (still, long, after_long) = runs
        if limited and still:
            compared += 1
            assert long == pytest.approx(short, rel=1e-2, abs=1e-9)
            assert after_long == pytest.approx(after_short, rel=1e-3, abs=1e-3 * LIMIT)
    assert compared > 0


def test_many_trials_in_the_limit_teach_no_more_than_few(build_fmu: Callable[..., Path]) -> None:
    """3 and 30 trials with an error that drives the learned force into u_max, then trials with the opposite one."""
    forces = []
    for trials in (3, 30):
        with Instance(load(build_fmu("IterativeLearning", Ts=Ts))) as run:
            run.initialise(N=10, fq=0.0, rate=0.1, u_max=5.0)
            shown = []
            for k in range(10 * (trials + 6)):
                run.set({"r": 1e-2 if k < 10 * trials else -1e-2, "trial_end": float(k % 10 == 0)})
                run.step(k * Ts, Ts)
                if k >= 10 * trials:
                    shown.append(run.get1("u"))
            forces.append(shown)
    assert forces[0][0] == 5.0
    assert forces[0][-1] < 0.0
    assert forces[0] == forces[1]


def test_many_periods_in_the_limit_teach_no_more_than_few(build_fmu: Callable[..., Path]) -> None:
    """5 and 50 periods with an error that drives the learned force into u_max, then the opposite one."""
    forces = []
    for periods in (5, 50):
        with Instance(load(build_fmu("RepetitiveController", Ts=Ts))) as run:
            run.initialise(N=10, M=2, rate=0.1, u_max=5.0)
            shown = []
            for k in range(10 * (periods + 6)):
                run.set({"r": 1e-2 if k < 10 * periods else -1e-2})
                run.step(k * Ts, Ts)
                if k >= 10 * periods:
                    shown.append(run.get1("u"))
            forces.append(shown)
    assert forces[0][0] == 5.0
    assert forces[0][-1] < 0.0
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


@pytest.mark.parametrize("name", INTEGRALS)
def test_an_integral_never_pushes_further_into_the_limit(name: str, build_fmu: Callable[..., Path]) -> None:
    """Random inputs in every sample: what w would become by the change of the integrals alone."""
    law = LAWS[name]
    library = load(build_fmu(name, Ts=Ts))
    kept = {v.name: v.start for v in law.select(Kind.STATE, Kind.STATES)}
    limited = 0
    free = {"u_min": -1e300, "u_max": 1e300}
    for sample in signals(library, 2, 400):
        commands = {"enable": 1.0, "reset": 0.0, "track": 0.0}
        values = {**kept, **sample, **{key: value for key, value in commands.items() if key in library.variables}}
        values |= PI_CONTROL.get(name, {})
        found = law.evaluate({**values, "u_min": -LIMIT, "u_max": LIMIT})
        if found["u_sat"] and not found.get("jumped"):
            limited += 1
            moved = {key: found[key] for key in INTEGRALS[name]}
            before, after = (law.evaluate({**values, **free, **change})["u"] for change in ({}, moved))
            assert (after - before) * found["u_sat"] <= 1e-9 * abs(before)
        kept = {key: found[key] for key in kept}
    assert limited > 100


# ---- enable


def disabled(library: Library, seed: int, count: int) -> list[dict[str, float]]:
    silent = {name: 0.0 for name in ("enable", "track") if name in library.variables}
    return [values | silent for values in signals(library, seed, count)]


def enabled(library: Library, seed: int, count: int) -> list[dict[str, float]]:
    others = [name for name in ("reset", "track", "trial_end") if name in library.variables]
    calm = {"enable": 1.0} | {name: library.start(name) for name in others}
    return [values | calm for values in signals(library, seed, count)]


@pytest.fixture(params=some(ENABLED, ENABLED[::6]))
def any_library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu(request.param, Ts=Ts))


REMEMBERS = {
    "IterativeLearning": "what was learned stays",
    "PreviewPrefilter": "the line of references goes on",
    "ImpulsiveControl": "the count of pulses goes on",
    "LocalFunctionEstimator": "the velocity of the sample before is known",
}
"""Blocks that say in their documentation that they keep something while they are not enabled."""


def test_a_pause_ends_as_a_start(any_library: Library) -> None:
    """While enable is false u, F_hat and u_sat are 0; then bit for bit what an instance gives that begins there."""
    library = any_library
    silent = [name for name in ("u", "F_hat", "u_sat") if name in library.variables]
    start = START.get(library.identifier, {})
    with Instance(library) as run, Instance(library) as other:
        run.initialise(**start)
        other.initialise(**start)
        k = 0
        for values in (*enabled(library, 3, 50), *disabled(library, 4, 20)):
            run.set(values)
            run.step(k * Ts, Ts)
            k += 1
            assert values["enable"] or not any(run.get(*silent))
        for j, values in enumerate(enabled(library, 5, 50)):
            for one, at in ((run, k), (other, j)):
                one.set(values)
                one.step(at * Ts, Ts)
            k += 1
            if library.identifier not in REMEMBERS:
                assert run.get(*library.names("output")) == other.get(*library.names("output"))


def test_switching_on_at_rest_is_no_bump(any_library: Library) -> None:
    """An axis that rests on its reference, far from 0, after any inputs: no force but gravity, from then on."""
    library = any_library
    place = random.Random(library.identifier).uniform(1.0, 2.0)
    gravity = math.sin(place) if library.identifier == "LoadFeedforward" else 0.0
    rest = {name: library.start(name) for name in library.names("input", type="Boolean")}
    rest |= {name: place if name in ("r", "x") else 0.0 for name in library.names("input", type="Real")}
    with Instance(library) as run:
        run.initialise()
        for k, values in enumerate(
            (*enabled(library, 6, 50), *disabled(library, 7, 20), rest | {"enable": 0.0}, *[rest] * 50)
        ):
            run.set(values)
            run.step(k * Ts, Ts)
            if values is rest and "u" in library.variables and library.identifier != "Dither":
                assert abs(run.get1("u") - gravity) < 1e-9 * max(1.0, place)


@pytest.mark.parametrize("any_library", ESTIMATING, indirect=True)
def test_an_estimate_of_friction_has_a_gain_that_does_not_scale_it(any_library: Library) -> None:
    """Estimates that do not hear u are the same with gain 0.5, and u then has half of what they give with gain 1."""
    library = any_library
    wide = {"u_min": -1e9, "u_max": 1e9}
    with Instance(library) as full, Instance(library) as half, Instance(library) as none:
        for run, gain in ((full, 1.0), (half, 0.5), (none, 0.0)):
            run.initialise(gain=gain, **wide)
        for k, values in enumerate(enabled(library, 8, 50)):
            for run in (full, half, none):
                run.set(values)
                run.step(k * Ts, Ts)
            (u1, F1), (u2, F2), (u3, _) = (run.get("u", "F_hat") for run in (full, half, none))
            if library.identifier != "TustinFeedback":  # gain scales cogging, too
                assert u1 - u3 == pytest.approx(F1, rel=1e-6, abs=1e-9 * (1.0 + abs(u3)))
            assert F1 == F2
            assert u2 == pytest.approx(0.5 * (u1 + u3), rel=1e-9, abs=1e-12)
