"""Model exchange under fmpy's CVode against co-simulation: two independent computations of the same model."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from ctypes import c_double
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from exchange.cases import CASES, Case, agreement, covered, wanted
from exchange.solver import Exchange
from fmpy import extract
from shell.instance import MODEL_EXCHANGE, Instance, load
from thorough import THOROUGH, nightly, some

from friction_fmus import build

SEEDS = (1, 2)
CHOSEN = (
    *("LuGre asymmetric", "RateAndState", "Viscous", "ElastoPlastic", "GMS damped", "Leuven", "Coulomb"),
    *("KarnoppMass", "TwoMass", "Quantiser", "Circle", "Record"),
)
"""One for each way to have states, decisions and events."""


@pytest.mark.parametrize("seed", some(SEEDS, SEEDS[:1]))
@pytest.mark.parametrize("name", some([*CASES], CHOSEN[::2]))
def test_both_kinds_agree(name: str, seed: int, build_fmu: Callable[..., Path]) -> None:
    """Within 1e-6 of the force level; decisions at the same times to 1e-6 s."""
    agreement(CASES[name], build_fmu, seed)


def test_every_block_is_compared() -> None:
    assert covered() == wanted()


@nightly
@pytest.mark.parametrize("name", some([*CASES], ["GMS"]))
def test_rotational_twins_agree(name: str, tmp_path: Path) -> None:
    agreement(CASES[name], lambda block, **start: build(block, tmp_path, start, domain="rotational"), 3)


@pytest.mark.parametrize(("name", "state", "start"), [("Leuven", "z", {}), ("KarnoppMass", "w", {"v0": 0.05})])
def test_states_that_an_event_changes_are_marked(
    name: str, state: str, start: dict[str, float], build_fmu: Callable[..., Path]
) -> None:
    """A reversal; a mass that comes to rest. The other cases of this file check that no other state changes."""
    nodes = np.array([0.0, 0.1, 0.2])
    lines = {"v": np.array([1e-3, -1e-3, 0.0]), "Fn": np.ones(3)} if name == "Leuven" else {"F_ext": np.zeros(3)}
    fmu = build_fmu(name, **start)
    run = Exchange(Path(extract(str(fmu), str(fmu.with_suffix(".marked")))), nodes, lines, {})
    run.model_exchange(["time"])
    assert run.jumps == 1
    assert run.reinitialised == [state]


@pytest.mark.parametrize("s", [1.0, -1.0])
def test_a_mass_that_is_pushed_through_its_band_has_an_event_at_the_end(
    s: float, build_fmu: Callable[..., Path]
) -> None:
    """Inside the band of 1 mm/s, the mass of Karnopp is shown at rest."""
    with Instance(load(build_fmu("KarnoppMass")), kind=MODEL_EXCHANGE) as run:
        run.exchange(F_ext=s * 2.0)
        assert run.get1("stuck") == 0.0
        assert run.vector("GetDerivatives", 2)[1] == s * (2.0 - 1.5)  # over 1 kg, of which 1.5 N hold
        signs = []
        for w in (0.0, 0.999e-3, 1.001e-3):
            run.must("SetContinuousStates", (c_double * 2)(0.0, s * w), 2)
            signs.append(run.vector("GetEventIndicators", 2)[0] > 0.0)
        assert signs[0] == signs[1] != signs[2]
        run.must("EnterEventMode")
        run.event()
        assert run.get1("v") == s * 1.001e-3
        run.must("EnterContinuousTimeMode")
        signs = []
        for w in (2e-3, 1.001e-3, 0.9e-3):
            run.must("SetContinuousStates", (c_double * 2)(0.0, s * w), 2)
            signs.append(run.vector("GetEventIndicators", 2)[0] > 0.0)
        assert signs[0] == signs[1] != signs[2]


@pytest.mark.parametrize("q", [1.0, 0.25])
@pytest.mark.parametrize("s", [1.0, -1.0])
def test_a_quantiser_has_an_event_half_a_step_from_its_level(
    q: float, s: float, build_fmu: Callable[..., Path]
) -> None:
    with Instance(load(build_fmu("Quantiser")), kind=MODEL_EXCHANGE) as run:
        run.exchange(q=q)
        found = []
        for x in (0.0, 0.499, 0.501):
            run.set({"x": s * q * x})
            found.append([indicator > 0.0 for indicator in run.vector("GetEventIndicators", 2)])
        assert found[0] == found[1] != found[2]
        assert run.get1("y") == 0.0  # until the event
        run.must("EnterEventMode")
        run.event()
        assert run.get1("y") == s * q


def test_elements_that_are_not_in_use_never_slip(build_fmu: Callable[..., Path]) -> None:
    """GMS remembers ten directions, in the last 80 bytes of a state."""
    with Instance(load(build_fmu("GMS")), kind=MODEL_EXCHANGE) as run:
        run.exchange(v=1e-3, N=4)
        run.must("SetContinuousStates", (c_double * 10)(*[1.0] * 10), 10)
        run.must("EnterEventMode")
        run.event()
        assert struct.unpack("10d", run.serialised()[-80:]) == (1.0,) * 4 + (0.0,) * 6


HELD = {name: case for name, case in CASES.items() if "v" in case.inputs}


@pytest.mark.parametrize("name", some([*HELD], [*HELD][::8]))
def test_standstill_takes_no_events_and_no_time(name: str, build_fmu: Callable[..., Path]) -> None:
    """1e6 s at v = 0 after a reversal: few events while it moves, at most one when it stops, none at rest."""
    case: Case = HELD[name]
    fmu = build_fmu(case.block, **case.start)
    nodes = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 1e6])
    lines: Mapping[str, np.ndarray] = {
        key: np.array([0.0, 1e-3, 0.0, -1e-3, 0.0, 0.0]) if key == "v" else np.full(6, value)
        for key, value in case.inputs.items()
    }
    run = Exchange(Path(extract(str(fmu), str(fmu.with_suffix(".held")))), nodes, lines, {})
    begin = process_time()
    _, events = run.model_exchange(case.outputs, step=None)
    assert not THOROUGH or process_time() - begin < 1.0
    stops = [t for t in events if t > 0.04 - 1e-9]
    assert len(stops) <= 3 and all(t < 0.04 + 1e-6 for t in stops)


RESTING = ("Coulomb", "Stiction", "Tustin", "Stribeck")


@pytest.mark.parametrize(("F_ext", "each"), [(0.5, 2), (-0.5, 2), (2.0, 1), (-2.0, 1)])
@pytest.mark.parametrize("name", RESTING)
def test_a_reversal_is_one_event_or_a_rest(name: str, F_ext: float, each: int, build_fmu: Callable[..., Path]) -> None:
    """Friction that balances F_ext holds between two events, 1e-10 m/s apart; beyond static friction there is one."""
    fmu = build_fmu(name)
    nodes = np.linspace(0.0, 1.0, 101)
    lines = {"v": 1e-3 * np.sin(20.0 * nodes + 0.3), "F_ext": np.full(101, F_ext), "Fn": np.ones(101)}
    run = Exchange(Path(extract(str(fmu), str(fmu.with_suffix(".reversals")))), nodes, lines, {})
    _, events = run.model_exchange(["F"])
    v = lines["v"]
    before = np.flatnonzero(v[:-1] * v[1:] < 0.0)
    zeros = nodes[before] + 0.01 * v[before] / (v[before] - v[before + 1])
    assert len(zeros) == 6
    assert events == pytest.approx(np.repeat(zeros, each), abs=1e-8)


@pytest.mark.parametrize("name", ["Karnopp", "Stiction"])
def test_a_load_that_reaches_static_friction_is_an_event(name: str, build_fmu: Callable[..., Path]) -> None:
    """F_ext grows by 3 N/s, from 0 to 3 N, at v = 0; static friction is 1.5 N, and 2.4 N with Fn = 1.6 N."""
    fmu = build_fmu(name)
    nodes = np.array([0.0, 1.0])
    extracted = Path(extract(str(fmu), str(fmu.with_suffix(".loaded"))))
    for Fn, breaks in ((1.0, 0.5), (1.6, 0.8)):
        lines = {"v": np.zeros(2), "F_ext": np.array([0.0, 3.0]), "Fn": np.full(2, Fn)}
        _, events = Exchange(extracted, nodes, lines, {"Fs": 1.5}).model_exchange(["F"])
        assert events == pytest.approx([breaks], abs=1e-8)


def test_a_deflection_beyond_the_level_comes_back_to_it(build_fmu: Callable[..., Path]) -> None:
    """With n = 0, dz/dt is -|v| from three times the level Fc/sigma = 10 um on: F = 3 N, 2 N, then 1 N."""
    fmu, nodes = build_fmu("Dahl"), np.array([0.0, 0.01, 0.03])
    lines = {"v": np.full(3, 1e-3), "Fn": np.ones(3)}
    start = {"n": 0.0, "Fc": 1.0, "sigma": 1e5, "z": 3e-5}
    run = Exchange(Path(extract(str(fmu), str(fmu.with_suffix(".beyond")))), nodes, lines, start)
    forces, events = run.model_exchange(["F"])
    assert forces[:, 0] == pytest.approx([3.0, 2.0, 1.0], abs=1e-6)
    assert events == pytest.approx([0.02], abs=1e-6)


def pass_event(run: Instance) -> None:
    run.must("EnterEventMode")
    run.event()
    run.must("EnterContinuousTimeMode")


@pytest.mark.parametrize("arrivals", [(-5e-10, 0.0), (0.0, 0.0)])
def test_a_mass_that_arrives_beside_rest_and_then_stops_stays_at_rest(
    arrivals: tuple[float, float], build_fmu: Callable[..., Path]
) -> None:
    """Until its velocity has changed by 1e-10 m/s."""
    with Instance(load(build_fmu("Stiction")), kind=MODEL_EXCHANGE) as run:
        run.exchange(v=5e-9, F_ext=0.5)
        assert run.get("F", "stuck") == [pytest.approx(1.0), 0.0]
        for v in arrivals:
            run.set({"v": v})
            pass_event(run)
            assert run.get("F", "stuck") == [0.5, 1.0]
            for change in (0.9e-10, -0.9e-10, 1.1e-10, -1.1e-10):
                run.set({"v": v + change})
                rests = run.vector("GetEventIndicators", run.library.indicators)[0] > 0.0
                assert rests == (abs(change) < 1e-10)


def test_a_stop_that_is_left_is_an_event(build_fmu: Callable[..., Path]) -> None:
    """At |z| = z0 the spring has its stiffness of sliding, below it the larger one."""
    with Instance(load(build_fmu("ResetIntegrator")), kind=MODEL_EXCHANGE) as run:
        run.exchange(v=0.0, z=1e-5, sigma0=1e5, z0=1e-5, a=0.5)
        assert run.get("F", "stuck") == [pytest.approx(1.0), 0.0]
        assert run.vector("GetEventIndicators", run.library.indicators)[1] > 0.0
        run.must("SetContinuousStates", (c_double * 1)(1e-5 * (1.0 - 1e-9)), 1)
        assert run.vector("GetEventIndicators", run.library.indicators)[1] < 0.0
        pass_event(run)
        assert run.get("F", "stuck") == [pytest.approx(1.5), 1.0]
