"""FMUs for model exchange as parts: closed forms, events, failures, masters, states."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import fmpy
import numpy as np
import pytest
from python_engine import run_in_python
from scipy.integrate import solve_ivp
from thorough import landing, nightly

from harness import (
    CallablePart,
    Drive,
    Experiment,
    ExperimentError,
    FmuPart,
    PartError,
    Port,
    Result,
    SeriesPart,
    StartValueError,
    System,
    sweep,
)
from harness.errors import BuildError, HarnessError
from harness.parts import integrator
from harness.run import run

MakeFmu = Callable[..., Path]
EXPLICIT = ["jacobi", "gauss-seidel"]
ALL = [*EXPLICIT, "newton", "adaptive"]


def alone(path: Path, stop: float = 1.0, step: float = 0.01, **settings: object) -> Result:
    """Run one FMU as part p; settings that are start values of p."""
    start = {f"p.{key}": settings.pop(key) for key in list(settings) if key not in ("tolerance", "master", "record")}
    with System([FmuPart("p", path)], start=start) as system:
        return system.run(stop=stop, step=step, **settings)


def test_oscillator(exchange: MakeFmu) -> None:
    result = alone(exchange("OSCILLATOR"), stop=10.0, F=0.0, x=0.5, v=3.0, record=["p.x", "p.v", "p.der(v)"])
    t = result["time"].values
    np.testing.assert_allclose(result["p.x"], 0.5 * np.cos(3 * t) + np.sin(3 * t), atol=1e-6)
    np.testing.assert_allclose(result["p.v"], -1.5 * np.sin(3 * t) + 3 * np.cos(3 * t), atol=3e-6)
    np.testing.assert_allclose(result["p.der(v)"], -9.0 * result["p.x"], rtol=1e-12, atol=1e-12)


def test_tolerance(exchange: MakeFmu) -> None:
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        result = alone(exchange("OSCILLATOR"), stop=2.0, F=0.0, tolerance=tolerance)
        errors.append(float(np.abs(result["p.x"] - np.cos(3 * result["time"])).max()))
    assert all(error < 3e2 * tolerance for error, tolerance in zip(errors, (1e-4, 1e-6, 1e-8, 1e-10), strict=True))
    assert all(second < 0.1 * first for first, second in pairwise(errors))


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_bouncing_ball(exchange: MakeFmu, step: float) -> None:
    """The bounces are at t0, t0 (1 + 2 e), t0 (1 + 2 e + 2 e^2), ... with t0 = sqrt(2 h / g)."""
    g, e = 9.81, 0.7
    result = alone(exchange("BALL"), stop=2.0, step=step)
    times = np.cumsum([math.sqrt(2 / g), *(2 * math.sqrt(2 / g) * e**k for k in range(1, 6))])
    t = result["time"].values
    count = np.searchsorted(times, t)
    np.testing.assert_array_equal(result["p.bounces"], count)
    since = t - np.concatenate([[0.0], times])[count]
    up = np.where(count == 0, 0.0, e**count * math.sqrt(2 * g))
    height = np.where(count == 0, 1.0, 0.0) + up * since - 0.5 * g * since**2
    np.testing.assert_allclose(result["p.h"], height, atol=1e-7)


@pytest.mark.parametrize("step", [0.1, 0.07, 1.0])
def test_time_events_without_states(exchange: MakeFmu, step: float) -> None:
    result = alone(exchange("STAIR"), stop=21 * step, step=step)
    t = result["time"].values
    # a level at a communication point is reached in the step from there
    np.testing.assert_array_equal(result["p.level"], np.maximum(np.ceil(t / 0.3 - 1e-9) - 1, 0))


@nightly
def test_van_der_pol(exchange: MakeFmu) -> None:
    for mu in (5.0, 100.0):
        result = alone(exchange("VANDERPOL"), stop=20.0, step=0.05, mu=mu, tolerance=1e-10)
        exact = solve_ivp(
            lambda _, z, mu=mu: [z[1], mu * (1 - z[0] ** 2) * z[1] - z[0]],
            (0.0, 20.0),
            (2.0, 0.0),
            method="Radau",
            t_eval=result["time"].values,
            rtol=1e-11,
            atol=1e-11,
        )
        np.testing.assert_allclose(result["p.x"], exact.y[0], atol=2e-7)


@pytest.mark.parametrize("step", [1e-3, 0.05])
def test_stick_slip_on_a_belt(exchange: MakeFmu, step: float) -> None:
    """With a = (Fs - Fc) / k, sticking lasts 2 a / V and sliding 2 (pi - atan(a w / V)) / w."""
    k, V, Fs, Fc, w = 100.0, 0.1, 5.0, 3.0, 10.0
    result = alone(exchange("BELT"), stop=5.0, step=step)
    a = (Fs - Fc) / k
    stick, slip = 2 * a / V, 2 * (math.pi - math.atan(a * w / V)) / w
    t = result["time"].values
    phase = np.mod(t - Fs / k / V, stick + slip)  # since the last break-away
    slips = (t > Fs / k / V) & (phase < slip)
    clear = np.minimum(np.abs(phase - slip), np.minimum(phase, stick + slip - phase)) > 1e-6
    np.testing.assert_array_equal(result["p.slips"].values[clear], slips[clear])
    sliding = Fc / k + a * np.cos(w * phase) + V / w * np.sin(w * phase)
    sticking = Fc / k - a + V * (phase - slip)
    x = np.where(slips, sliding, np.where(t < Fs / k / V + 1e-9, V * t, sticking))
    np.testing.assert_allclose(result["p.x"], x, atol=1e-6)


def test_an_fmu_without_states(exchange: MakeFmu) -> None:
    """Its indicator is the input, which crosses zero within the step with the implicit masters."""
    source = CallablePart("s", lambda t, u, x: [math.sin(t)], outputs=["u"])
    with System([FmuPart("p", exchange("GAIN")), source], ["s.u -> p.u"]) as system:
        result = system.run(stop=10.0, step=0.1, master="newton")
    t = result["time"].values
    np.testing.assert_allclose(result["p.y"], 2 * np.sin(t), atol=1e-14)
    np.testing.assert_array_equal(result["p.above"], np.sin(t) > 0)


def test_an_event_of_a_linear_input_is_located(exchange: MakeFmu) -> None:
    """The last event before t = 0.6 is the one at 0.537, in the middle of a step; its time is read in the step."""
    drive = Drive(FmuPart("p", exchange("GAIN")))
    rows = drive.run({"u": np.array([-0.537, 0.463])}, ["y"], 1.0, between="linear")
    drive.close()
    np.testing.assert_allclose(rows[:, 0], [-1.074, 0.926], atol=1e-14)
    source = CallablePart("s", lambda t, u, x: [t - 0.537], outputs=["u"])
    with System([FmuPart("p", exchange("GAIN")), source], ["s.u -> p.u"]) as system:
        result = system.run(stop=1.0, step=0.1, master="newton")
    np.testing.assert_array_equal(result["p.above"], result["time"] > 0.537)


@pytest.mark.parametrize("master", ALL)
def test_inputs_held_and_linear(exchange: MakeFmu, master: str) -> None:
    """The integral of u = 2 t: held values make a rectangle rule, linear ones are exact."""
    source = CallablePart("s", lambda t, u, x: [2 * t], outputs=["u"])
    with System([source, FmuPart("p", exchange("INTEGRATOR"))], ["s.u -> p.u"]) as system:
        result = system.run(stop=1.0, step=0.1, master=master)
    t = result["time"].values
    exact = t**2
    # gauss-seidel passes the value at the end of the step, jacobi the one at its beginning
    off = {"jacobi": -0.1 * t, "gauss-seidel": 0.1 * t}.get(master, 0.0 * t)
    np.testing.assert_allclose(result["p.x"], exact + off, atol=1e-9)


def test_discrete_inputs_change_between_steps(exchange: MakeFmu) -> None:
    heat = CallablePart("s", lambda t, u, x: [t >= 0.5], outputs=[Port("on", type="Boolean")], sampled=True)
    with System([heat, FmuPart("p", exchange("ROOM"))], ["s.on -> p.heat"]) as system:
        result = system.run(stop=1.0, step=0.125)
    t = result["time"].values
    cooling = 15 + 5 * np.exp(-t)
    heating = 25 + (15 + 5 * math.exp(-0.5) - 25) * np.exp(-(t - 0.5))
    np.testing.assert_allclose(result["p.T"], np.where(t <= 0.5, cooling, heating), atol=1e-7)


def test_a_completed_step_can_ask_for_an_event(exchange: MakeFmu) -> None:
    """At x = 0.45 or later, x jumps by 10."""
    result = alone(exchange("ASKS"), stop=2.0, step=1.0)
    np.testing.assert_allclose(result["p.x"], [0.0, 11.0, 12.0], atol=1e-9)
    np.testing.assert_array_equal(result["p.events"], [0, 1, 1])
    # without the calls, the jump comes at the beginning of the next step
    late = alone(exchange("ASKS", needed=False), stop=2.0, step=1.0)
    np.testing.assert_allclose(late["p.x"], [0.0, 1.0, 12.0], atol=1e-9)


def test_an_event_at_a_communication_point_takes_the_inputs_of_this_point(exchange: MakeFmu) -> None:
    """A sampled law: y = 2 u at each multiple of 0.2 s; u = t reaches it before the step from there."""
    clock = CallablePart("clock", lambda t, u, x: [t], outputs=["t"])
    with System([clock, FmuPart("p", exchange("SAMPLER"))], ["clock.t -> p.u"]) as system:
        for master in ("jacobi", "newton"):
            result = system.run(stop=1.0, step=0.1, master=master)
            t = result["time"].values
            np.testing.assert_allclose(
                result["p.y"], 0.4 * np.maximum(np.ceil(t / 0.2 - 1e-9) - 1, 0), atol=1e-12, err_msg=master
            )


HELD = SeriesPart("s", [0.0, 0.35, 0.5, 1.1], {"u": [1.0, 2.0, 3.0, 4.0]}, interpolation="previous")
JUMPS = np.array([(0.0, 1.0), (0.35, 1.0), (0.35, 2.0), (0.5, 2.0), (0.5, 3.0), (1.1, 3.0)])


@pytest.mark.parametrize(("kind", "name", "step"), [("STAIR", "level", 0.1), ("SAMPLER", "y", 0.05)])
def test_events_show_the_values_before_and_after(exchange: MakeFmu, kind: str, name: str, step: float) -> None:
    """As fmpy does: two rows at a multiple of the period. Nothing else changes."""
    sampler = kind == "SAMPLER"
    part = FmuPart("p", exchange(kind))
    with System([part, HELD] if sampler else [part], ["s.u -> p.u"] if sampler else []) as system:
        settings = {"stop": 1.0, "step": step, "record": [f"p.{name}"]}
        plain, shown = system.run(**settings), system.run(**settings, events=True)  # type: ignore[arg-type]
    t, values = shown["time"].to_numpy(), shown[f"p.{name}"].to_numpy()
    second = np.append(False, np.diff(t) == 0.0)
    assert np.array_equal(values[~second], plain[f"p.{name}"])
    inputs = np.array([*map(tuple, JUMPS)], dtype=[("time", float), ("u", float)]) if sampler else None
    fmpys = fmpy.simulate_fmu(
        str(exchange(kind)), stop_time=1.0, output_interval=step, fmi_type="ModelExchange", input=inputs, output=[name]
    )
    # fmpy has two rows at each event, also if it changes nothing, as for the inputs between samples
    changes = np.append(True, (np.diff(fmpys["time"]) > 1e-9) | (np.abs(np.diff(fmpys[name])) > 1e-9))
    np.testing.assert_allclose(t, fmpys["time"][changes], atol=1e-12)
    np.testing.assert_allclose(values, fmpys[name][changes], atol=1e-12)
    if sampler:  # y = 2 u at multiples of 0.2 s
        assert t[second] == pytest.approx([0.4, 0.6])
        assert values[second].tolist() == [4.0, 6.0]
    else:
        assert t[second] == pytest.approx([0.3, 0.6, 0.9])
        assert values[second].tolist() == [1, 2, 3]


def test_events_of_an_fmu_that_cannot_save_its_state(exchange: MakeFmu, caplog: pytest.LogCaptureFixture) -> None:
    with System([FmuPart("p", exchange("STAIR", states=False))]) as system:
        assert system.run(stop=1.0, step=0.1, events=True).sizes["time"] == 11
        assert "'p' cannot save its state: its values after events have no rows" in caplog.text
        with pytest.raises(ExperimentError, match="run it without events"):
            system.run(stop=1.0, step=0.1, events=True, accuracy=True)


@pytest.mark.parametrize("kind", ["ENDS", "STOPS"])
def test_an_fmu_that_ends_the_simulation(exchange: MakeFmu, kind: str) -> None:
    """A normal end (FMI 2.0.5, section 3.2.2): the result ends there."""
    found = alone(exchange(kind), step=0.1)
    assert str(found.attrs["ended"]).startswith("part 'p' ended the simulation in the step from t = 0.5")
    t = found["time"].to_numpy()
    np.testing.assert_allclose(t[:6], np.arange(6) * 0.1, atol=1e-12)
    assert t.size == 7
    assert 0.55 <= t[6] < 0.6
    np.testing.assert_allclose(found["p.x"], t, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("UNSETTLED", "its event iteration does not end: after 100 calls it still asks for another"),
        ("TWOFACED", "it has more than 10000 events in one communication step: it chatters, or the step is too long"),
        ("DUE", "it has more than 10000 events in one communication step: it chatters, or the step is too long"),
    ],
)
def test_events_without_end(exchange: MakeFmu, kind: str, reason: str) -> None:
    with pytest.raises(PartError) as caught:
        alone(exchange(kind), step=0.1)
    assert caught.value.function == "its integration"
    assert caught.value.reason == reason


def test_an_indicator_that_jumps_at_its_own_event_does_not_stop_the_run(exchange: MakeFmu) -> None:
    result = alone(exchange("CHATTERS"), step=0.1)
    np.testing.assert_allclose(result["p.x"], result["time"], atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"status": 3.0},
            "part 'p' failed in fmi2GetDerivatives at t = 0.5: it returned Error and logged 'the spindle has seized'",
        ),
        (
            {"status": 4.0},
            "part 'p' failed in fmi2GetDerivatives at t = 0.5: it returned Fatal and logged 'the spindle has seized'",
        ),
        (
            {"status": 2.0},
            "part 'p' failed in fmi2GetDerivatives at t = 0.5: it returned Discard and logged 'the spindle has seized'",
        ),
        ({"nan": 1.0}, "part 'p' failed in its integration at t = 0.5: the derivative of x is not finite"),
    ],
)
def test_failing_derivatives_name_part_time_and_reason(
    exchange: MakeFmu, settings: dict[str, float], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(PartError) as caught:
        alone(exchange("FAILS"), step=0.1, **settings)
    error = caught.value
    assert error.time == pytest.approx(0.5, abs=0.1)
    error.time = None
    assert str(error) == message.replace(" at t = 0.5", "")
    assert error.result is not None
    np.testing.assert_allclose(error.result["p.x"], np.arange(error.result.sizes["time"]) * 0.1, atol=1e-12)
    assert error.result.sizes["time"] in (5, 6)
    assert capfd.readouterr().err == ""  # the solver prints nothing


def test_the_solver_tries_shorter_steps_where_there_is_no_derivative(exchange: MakeFmu) -> None:
    """x grows by 10/s up to 0.9 and nears 1 from there, but steps of the solver grow until one passes 1.2."""
    result = alone(exchange("NEARS"), stop=2.0, step=1.0)
    np.testing.assert_allclose(result["p.x"], [0.0, 1.0, 1.0], atol=1e-5)


def test_wrong_number_of_states(exchange: MakeFmu) -> None:
    with pytest.raises(PartError, match=r"fmi2GetContinuousStates at t = 0 s: .*another number of values"):
        alone(exchange("OSCILLATOR", derivatives=1), F=0.0)


def test_an_output_without_declared_dependencies_closes_an_algebraic_loop(exchange: MakeFmu) -> None:
    """y = 2 u with u = 1 - y / 4: y = 4/3, at the start and in each step."""
    half = CallablePart("half", lambda t, u, x: [1.0 - 0.25 * u[0]], ["y"], ["u"])
    with System([FmuPart("p", exchange("GAIN")), half], ["p.y -> half.y", "half.u -> p.u"]) as system:
        result = system.run(stop=0.3, step=0.1, master="newton")
    np.testing.assert_allclose(result["p.y"], 4 / 3, rtol=1e-7)


def test_a_rejected_parameter(exchange: MakeFmu, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR, "harness"), pytest.raises(StartValueError, match="the mass must be positive"):
        alone(exchange("OSCILLATOR"), F=0.0, mass=-1.0)
    assert [record.name for record in caplog.records] == ["harness.p"]


@pytest.mark.parametrize("master", ALL)
def test_two_oscillators_exchange_their_force(exchange: MakeFmu, master: str) -> None:
    """Both masses have a spring to the ground, and one in Python joins them: modes with w^2 = 9 and 9 + 2 c."""
    c = 4.0
    spring = CallablePart(
        "spring", lambda t, u, x: [c * (u[1] - u[0]), c * (u[0] - u[1])], ["a", "b"], ["on_a", "on_b"]
    )
    parts = [FmuPart(name, exchange("OSCILLATOR")) for name in ("a", "b")]
    wires = ["a.x -> spring.a", "b.x -> spring.b", "spring.on_a -> a.F", "spring.on_b -> b.F"]
    with System([*parts, spring], wires, {"b.x": 0.0}) as system:
        result = system.run(stop=2.0, step=1e-3, master=master)
    t = result["time"].values
    both, against = 0.5 * np.cos(3 * t), 0.5 * np.cos(math.sqrt(9 + 2 * c) * t)
    tolerance = 5e-6 if master in ("newton", "adaptive") else 2e-2
    np.testing.assert_allclose(result["a.x"], both + against, atol=tolerance)
    np.testing.assert_allclose(result["b.x"], both - against, atol=tolerance)


def test_a_loop_needs_saved_states(exchange: MakeFmu) -> None:
    parts = [FmuPart("a", exchange("OSCILLATOR", states=False)), FmuPart("b", exchange("OSCILLATOR"))]
    with (
        System(parts, ["a.x -> b.F", "b.x -> a.F"]) as system,
        pytest.raises(ExperimentError, match="'a' is part of a loop and cannot save its state"),
    ):
        system.run(stop=1.0, step=0.1, master="newton")


@pytest.mark.parametrize("kind", ["BALL", "BELT", "STAIR", "OSCILLATOR"])
def test_engine_python_and_another_run_give_the_same_bits(exchange: MakeFmu, kind: str) -> None:
    start = {"p.F": 0.0} if kind == "OSCILLATOR" else {}
    with System([FmuPart("p", exchange(kind))], start=start) as system:
        experiment = Experiment(stop=1.5, step=0.01)
        first = run(system, experiment)
        assert first.identical(run(system, experiment))
        assert first.equals(run_in_python(system, experiment))


@pytest.mark.parametrize("kind", ["BALL", "BELT", "STAIR", "OSCILLATOR"])
def test_a_checkpoint_continues_bit_for_bit(exchange: MakeFmu, tmp_path: Path, kind: str) -> None:
    start = {"p.F": 0.0} if kind == "OSCILLATOR" else {}
    with System([FmuPart("p", exchange(kind))], start=start) as system:
        whole = system.run(stop=1.5, step=0.1)
        system.run(stop=0.9, step=0.1, checkpoint=tmp_path / "state")
        rest = system.run(stop=1.5, step=0.1, resume=tmp_path / "state")
    for name in whole:
        np.testing.assert_array_equal(rest[name].values, whole[name].values[9:])


def test_a_checkpoint_needs_a_state_that_can_be_serialised(exchange: MakeFmu, tmp_path: Path) -> None:
    with (
        System([FmuPart("p", exchange("BALL", states=False))]) as system,
        pytest.raises(PartError, match="cannot serialise its state"),
    ):
        system.run(stop=0.1, step=0.1, checkpoint=tmp_path / "state")


@pytest.mark.parametrize("kind", ["OSCILLATOR", "BALL", "BELT"])
def test_fmpy_integrates_the_same(exchange: MakeFmu, kind: str) -> None:
    theirs = fmpy.simulate_fmu(
        str(exchange(kind)),
        stop_time=1.0,
        output_interval=0.1,
        relative_tolerance=1e-10,
        output=["x", "v"] if kind != "BALL" else ["h", "v"],
        record_events=False,
    )
    ours = alone(exchange(kind), step=0.1, tolerance=1e-8, **({"F": 0.0} if kind == "OSCILLATOR" else {}))
    for name in theirs.dtype.names[1:]:
        np.testing.assert_allclose(ours[f"p.{name}"], theirs[name], atol=1e-6)


@pytest.mark.parametrize("master", ["gauss-seidel", "newton"])
def test_an_oscillator_against_lugre_is_mass_against_lugre(exchange: MakeFmu, build_fmu: MakeFmu, master: str) -> None:
    """Presliding and sliding under a sinusoidal force; the block Mass has a closed form for its step."""
    net = CallablePart("net", lambda t, u, x: [2.0 * math.sin(10 * t) - u[0]], ["friction"], ["F"])
    push = CallablePart("push", lambda t, u, x: [2.0 * math.sin(10 * t)], outputs=["F"])
    friction = {"friction.sigma0": 1e4, "friction.sigma1": 100.0, "friction.sigma2": 0.4}
    with System(
        [net, FmuPart("body", exchange("OSCILLATOR")), FmuPart("friction", build_fmu("LuGre"))],
        ["net.F -> body.F", "body.v -> friction.v", "friction.F -> net.friction"],
        {"body.omega": 20.0, "body.x": 0.0} | friction,
    ) as system:
        foreign = system.run(stop=1.0, step=1e-3, master=master)
    still = {"mass.m": 1.0, "mass.k": 400.0, "mass.d": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0, "mass.x0": 0.0}
    with System(
        [push, FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu("LuGre"))],
        ["push.F -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"],
        still | friction,
    ) as system:
        own = system.run(stop=1.0, step=1e-3, master=master)
    assert float(np.abs(own["mass.x"]).max()) > 1e-3
    np.testing.assert_allclose(foreign["body.x"], own["mass.x"], atol=1e-7)
    np.testing.assert_allclose(foreign["friction.F"], own["friction.F"], atol=2e-4)  # sigma0 times 2e-8 m


def test_an_instance_is_reused(exchange: MakeFmu) -> None:
    """It gets its inputs in initialisation mode again."""
    parts = [FmuPart("off", exchange("GAIN")), FmuPart("p", exchange("OSCILLATOR"))]
    for part in parts:
        part.reuse = True
    with System(parts, ["off.y -> p.F"], {"off.u": 0.0}) as system:
        assert system.run(stop=1.0, step=0.1).identical(system.run(stop=1.0, step=0.1))


@landing
def test_a_sweep_in_processes(exchange: MakeFmu) -> None:
    """The FMUs of a sweep keep one instance, which is reset for each run."""
    parts = [FmuPart("off", exchange("GAIN")), FmuPart("p", exchange("OSCILLATOR"))]
    with System(parts, ["off.y -> p.F"], {"off.u": 0.0}, name="swept") as system:
        table = sweep(
            system,
            [{"p.omega": omega} for omega in (1.0, 2.0, 3.0, 4.0, 5.0)],
            measure="final(p.x)",
            workers=2,
            experiment=Experiment(stop=2.0, step=0.01),
        )
    np.testing.assert_allclose(table["final(p.x)"], np.cos([2.0, 4.0, 6.0, 8.0, 10.0]), atol=1e-6)


def test_an_installation_without_a_solver(exchange: MakeFmu, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> object:
        raise OSError(f"{name} cannot be loaded")

    monkeypatch.setattr(integrator, "import_module", absent)
    integrator._sundials.cache_clear()
    with pytest.raises(HarnessError, match=r"fmpy has no CVODE that runs here \(fmpy.sundials.*export the FMU for co"):
        alone(exchange("BALL"))
    assert list(alone(exchange("STAIR"), stop=0.1)["p.level"])[-1] == 0  # it needs none


def test_a_motion_far_too_fast_for_the_step_is_an_error(exchange: MakeFmu) -> None:
    with pytest.raises(PartError, match="the solver needs more than a million steps for one communication step"):
        alone(exchange("OSCILLATOR"), F=0.0, omega=1e7, stop=1.0, step=1.0)


def test_system_file_and_ssp(exchange: MakeFmu, tmp_path: Path) -> None:
    path = exchange("OSCILLATOR")
    (tmp_path / "system.toml").write_text(
        f'[parts.p]\nfmu = "{path.as_posix()}"\nstart = {{ F = 0.0, omega = 2.0 }}\n'
        "[experiment]\nstop = 1.0\nstep = 0.1\ntolerance = 1e-9\n"
    )
    with System.from_toml(tmp_path / "system.toml") as system:
        result = system.run()
        system.to_ssp(tmp_path / "system.ssp")
    np.testing.assert_allclose(result["p.x"], np.cos(2 * result["time"]), atol=1e-6)
    with System.from_ssp(tmp_path / "system.ssp") as system:
        assert result.equals(system.run())
        with pytest.raises(BuildError, match="'p' is an FMU for model exchange, whose solver"):
            system.to_fmu(tmp_path / "composite.fmu")
