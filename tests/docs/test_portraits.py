"""The figures of the pages of blocks: curves against closed forms, and pictures that depend on nothing else."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import matplotlib as mpl
import numpy as np
import pytest
from thorough import landing, nightly, some

from friction_fmus import catalogue
from friction_fmus.blocks.catalogue import find
from friction_fmus.blocks.probe import describe
from harness import FmuPart

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "docs"))
from portraits.by_ports import Bench  # noqa: E402
from portraits.chart import Curve, Panel, chart, labelled  # noqa: E402
from portraits.experiments import BEGIN, FURTHER, SHOWN, shown  # noqa: E402

Panels = Callable[..., tuple[Panel, ...]]


@pytest.fixture
def panels(build_fmu: Callable[..., Path]) -> Panels:
    """``panels(name, **start_values)`` -> what the experiment of a block gives."""

    def run(name: str, **start: float) -> tuple[Panel, ...]:
        part = FmuPart(name, build_fmu(name, **start))
        part.enter_initialisation(0.0, 1.0, None, {})
        library = Path(str(part.folder)) / "binaries" / fmpy.platform / f"{name}{fmpy.sharedLibraryExtension}"
        bench = Bench(find(name), describe(library), part)
        chosen = shown(bench)
        assert chosen
        return chosen(bench)

    return run


@pytest.mark.parametrize("name", some(["LuGre", "Stribeck", "GMS"], ["LuGre"]))
def test_friction_of_steady_sliding_is_the_stribeck_curve(panels: Panels, name: str) -> None:
    start = {"Fc": 2.0, "Fs": 3.0, "vs": 2e-3} | ({} if name == "GMS" else {"delta": 1.0})
    delta = start.get("delta", 2.0)
    (curve,) = panels(name, **start)[0].curves
    v = curve.x
    expected = np.sign(v) * (2.0 + 1.0 * np.exp(-(np.abs(v / 2e-3) ** delta)))
    viscous = np.polyfit(v, curve.y - expected, 1)
    assert curve.y == pytest.approx(expected + viscous[0] * v, abs=3e-3)
    assert viscous == pytest.approx([0.4, 0.0], abs=0.05)
    assert v.min() == -v.max() == -8e-3


@nightly
def test_the_loop_of_dahl_friction_is_made_of_exponentials(panels: Panels) -> None:
    """F = -+ Fc + c exp(-+ sigma x / Fc) for n = 1, from each end of the motion."""
    Fc, sigma = 2.0, 5e4
    outer, inner = panels("Dahl", Fc=Fc, sigma=sigma)[1].curves
    for curve in (outer, inner):
        turns = np.flatnonzero(np.diff(np.sign(np.diff(curve.x)))) + 1
        assert turns.size == (1 if curve is outer else 2)
        for begin, end in zip([0, *turns], [*turns, curve.x.size - 1], strict=True):
            path = np.abs(curve.x[begin : end + 1] - curve.x[begin])
            level = Fc * np.sign(curve.x[end] - curve.x[begin])
            expected = level + (curve.y[begin] - level) * np.exp(-sigma * path / Fc)
            assert curve.y[begin : end + 1] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "closes"),
    [
        ("MaxwellSlip", True),
        pytest.param("GMS", True, marks=nightly),
        pytest.param("LuGre", False, marks=nightly),
        ("Dahl", False),
    ],
)
def test_inner_loops_close_if_the_model_remembers(panels: Panels, name: str, closes: bool) -> None:
    """Nonlocal memory: behind an inner loop the outer one goes on as if nothing had been."""
    _, inner = panels(name)[1].curves
    turns = np.flatnonzero(np.diff(np.sign(np.diff(inner.x)))) + 1
    before = inner.y[turns[0]]
    after = np.interp(inner.x[turns[0]], inner.x[turns[1] :][::-1], inner.y[turns[1] :][::-1])
    assert abs(after - before) < 2e-2 if closes else abs(after - before) > 0.05


@nightly
def test_static_friction_has_no_loop(panels: Panels) -> None:
    for name in ("Coulomb", "Viscous", "Tustin", "Karnopp", "Stribeck", "Stiction"):
        assert len(panels(name)) == 1


def test_coulomb_friction_is_a_step(panels: Panels) -> None:
    (curve,) = panels("Coulomb", Fc=3.0)[0].curves
    assert np.array_equal(curve.y, 3.0 * np.sign(curve.x))


@nightly
def test_a_pid_controller_jumps_and_ramps(panels: Panels) -> None:
    (curve,) = panels("PID", Kp=1e3, Ki=2e4)[0].curves
    ramp = curve.y > 0.0
    slope, value = np.polyfit(curve.x[ramp], curve.y[ramp], 1)
    assert slope == pytest.approx(2e4 * 1e-3)
    assert curve.y[ramp][0] == pytest.approx(1e3 * 1e-3, rel=0.05)
    assert value + slope * curve.x[ramp][-1] == pytest.approx(curve.y[-1])


@nightly
def test_an_observer_finds_coulomb_friction(panels: Panels) -> None:
    for name in ("DisturbanceObserver", "KalmanFriction", "ExtendedStateObserver", "ImplicitSlidingMode"):
        (curve,) = panels(name)[0].curves
        for side in (-1.0, 1.0):
            fast = side * curve.x > 0.9 * np.abs(curve.x).max()
            assert np.median(curve.y[fast]) == pytest.approx(side * 1.0, abs=0.1), name


@nightly
def test_signals_and_sensors(panels: Panels) -> None:
    (path,) = panels("Circle", radius=0.02)[0].curves
    assert np.hypot(path.x, path.y) == pytest.approx(0.02)
    true, stairs = panels("Quantiser", q=1e-3)[0].curves
    assert true.aside and np.abs(stairs.y - stairs.x).max() <= 0.5e-3 * (1.0 + 1e-9)
    assert stairs.y / 1e-3 == pytest.approx(np.rint(stairs.y / 1e-3))
    (ripple,) = panels("Cogging", pitch=0.01)[0].curves
    assert np.ptp(ripple.x) == pytest.approx(0.02, rel=0.02)
    assert abs(np.fft.rfft(ripple.y)).argmax() == 2  # two periods


def test_a_motor_pushes_and_is_no_friction(panels: Panels) -> None:
    """Force over velocity is that of the duty cycle less K v / R, over the resistance."""
    (panel,) = panels("DCMotor", K=2.0, R=3.0)
    assert "Friction" not in panel.caption
    for curve, duty in zip(panel.curves, (1.0, 0.5, -1.0), strict=True):
        assert curve.y == pytest.approx(2.0 * (12.0 * duty - 2.0 * curve.x) / 3.0, abs=1e-12)


@landing
def test_loads_of_contacts_grow_with_the_force(panels: Panels) -> None:
    """By the equations: 1 / eta - 1 of a load that is lifted, 1 - eta of one that is lowered; gravity of an arm."""
    forward, back = panels("EfficiencyLoad", base=0.1, eta_drive=0.4, eta_back=-0.2)[0].curves
    for curve, direction in ((forward, 1.0), (back, -1.0)):
        share = np.where(curve.x * direction < 0.0, 1.0 / 0.4 - 1.0, 1.2)
        assert curve.y == pytest.approx(0.1 + np.abs(curve.x) * share, abs=1e-12)
    drive, velocity = panels("TransmissionLoad", at_rest=0.5)
    for curve, rest in zip(drive.curves, (0.5, 0.5 * np.exp(-16.0)), strict=True):
        assert curve.y == pytest.approx(1.0 + rest + 0.1 * np.abs(-1.0 - curve.x), abs=1e-12)
    (curve,) = velocity.curves
    assert curve.y == pytest.approx(1.3 + 0.5 * np.exp(-((curve.x / 1e-3) ** 2)), abs=1e-12)
    (arm,) = panels("LoadFeedforward", m=0.0, G_cos=0.3)[0].curves
    assert arm.y == pytest.approx(np.sin(arm.x) + 0.3 * np.cos(arm.x), abs=1e-12)


@pytest.mark.parametrize("name", some(tuple(catalogue()), ["DCMotor", "EfficiencyLoad", "LoadFeedforward"]))
def test_no_figure_is_a_level_line(panels: Panels, name: str) -> None:
    for panel in panels(name, **BEGIN.get(name, {})):
        assert any(np.ptp(curve.y) > 0.0 for curve in panel.curves if not curve.aside), panel.caption


def test_experiments_of_pages_belong_to_blocks() -> None:
    assert {*SHOWN, *FURTHER, *BEGIN} <= set(catalogue())


def test_pictures_do_not_depend_on_the_settings_of_the_user() -> None:
    x = np.linspace(-1.0, 1.0, 101)
    panel = Panel((Curve(x, x**3, "a"), Curve(x, x, "b", aside=True)), ("v", "m/s"), ("F", "N"), "A cube.")
    first = chart(panel, "Cube")
    with mpl.rc_context({"lines.linewidth": 9.0, "font.size": 30.0, "svg.hashsalt": "other", "axes.facecolor": "red"}):
        assert chart(panel, "Cube") == first


@nightly
def test_threads_that_draw_side_by_side_draw_what_one_draws() -> None:
    x = np.linspace(-1.0, 1.0, 51)
    panel = Panel((Curve(x, x**3, "a"),), ("v", "m/s"), ("F", "N"), "A cube.")
    alone = chart(panel, "Cube")
    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(lambda _: chart(panel, "Cube"), range(24))) == {alone}


def test_axes_are_named_with_handy_numbers() -> None:
    assert labelled(("F", "N")) == "F [N]"
    assert labelled(("F", ""), -3) == "F [10⁻³]"
    assert labelled(("v", "m/s"), -6) == "v [10⁻⁶ m/s]"
    assert labelled(("ratio", "")) == "ratio"
    x = np.array([0.0, 4e-5])
    drawn = chart(Panel((Curve(x, 3e7 * x),), ("x", "m"), ("F", "N"), "A spring."), "Spring").decode()
    assert "x [10⁻⁶ m]" in drawn and ">40<" in drawn and "F [N]" in drawn
