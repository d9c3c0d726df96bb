"""Steps of a composite FMU: any communication point, refusals, saved states, several instances."""

from __future__ import annotations

import itertools
import math
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from shell.instance import DISCARD, ERROR, OK, WARNING, Instance, Library, load
from thorough import nightly

from friction_fmus import fmu
from harness import Experiment, FmuPart, System

NAMES = ("mass.x", "mass.v", "friction.F")


@pytest.fixture
def library(compose: Callable[[str], Path]) -> Library:
    return load(compose("stick_slip"))


def trajectory(library: Library, points: Sequence[float]) -> np.ndarray:
    """The outputs at these communication points."""
    rows = []
    with Instance(library) as run:
        run.initialise()
        for t, end in itertools.pairwise(points):
            run.step(t, end - t)
            rows.append(run.get(*NAMES))
    return np.array(rows)


def test_points_between_grid_points_do_not_move_the_grid(smooth: tuple[System, Library]) -> None:
    """Against a run whose grid contains the points; the motion is smooth, so that both are exact to 1e-9."""
    system, library = smooth
    result = system.run(master="newton", step=1e-5, record=["mass.x", "mass.v", "friction.F"])
    expected = np.array([result[name].to_numpy() for name in NAMES]).T
    ticks = np.cumsum([0, *[5, 3, 1, 4] * 700])[:2000]  # of 1e-5 s; every second tick is between grid points
    found = trajectory(library, [1e-5 * tick for tick in ticks])
    error = np.abs(found - expected[ticks[1:]]).max(axis=0)
    assert (error <= 1e-9 * np.abs(expected).max(axis=0)).all()


@pytest.mark.parametrize("master", ["newton", "adaptive", "composite"])
def test_a_light_mass_creeps_on_a_stiff_contact(tmp_path: Path, master: str) -> None:
    """The contact stays far below its limit, so that it and the spring stretch in proportion: v = k V/(k + sigma0). A
    relative error of 1e-9 in the force would be most of the velocity."""
    m, k, V, sigma0, sigma1, step, stop = 1.3e-5, 1.36, 0.035, 2e5, 0.15, 1e-2, 1.7
    start = {"mass.m": m, "mass.k": k, "mass.v_support": V, "mass.F_drive": 0.0, "friction.sigma0": sigma0}
    start |= {"friction.sigma1": sigma1, "friction.sigma2": 0.0, "friction.Fc": 1e3, "friction.Fs": 1e3}
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("LuGre"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    with System(parts, wires, start, Experiment(stop=stop, step=step)) as system:
        if master == "composite":
            system.to_fmu(tmp_path / "light.fmu", name="light")
            v = trajectory(load(tmp_path / "light.fmu"), 0.0031 * np.arange(round(stop / 0.0031)))[:, 1]
        else:
            v = system.run(master=master, record=["mass.v"])["mass.v"].to_numpy()
    # 20 steps after the start, which is a jump of the speed of the support
    np.testing.assert_allclose(v[70 if master == "composite" else 20 :], k * V / (k + sigma0), rtol=2e-3)


@nightly
def test_points_between_grid_points_change_no_value_at_them(tmp_path: Path) -> None:
    """A light mass, whose loop amplifies the errors of unequal steps: the grid alone decides, bit for bit; between its
    points the position is that of a line through them up to a slip, which is faster than the step."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("LuGre"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"mass.m": 1e-6, "mass.k": 200.0, "mass.v_support": 0.01, "mass.F_drive": 0.0}
    start |= {"friction.sigma0": 3e4, "friction.sigma1": 0.3, "friction.sigma2": 0.3, "friction.Fc": 0.8}
    start |= {"friction.Fs": 1.2, "friction.vs": 0.01}
    with System(parts, wires, start, Experiment(stop=1.0, step=1e-3)) as system:
        system.to_fmu(tmp_path / "light.fmu", name="light")
    library = load(tmp_path / "light.fmu")
    expected = trajectory(library, [1e-3 * tick for tick in range(1001)])
    for hundredths in (30, 79, 370):  # of the inner step
        points = [1e-5 * k for k in range(0, 100_001, hundredths)]
        found = trajectory(library, points)
        on_grid = [(row, k // 100 - 1) for row, k in enumerate(range(hundredths, 100_001, hundredths)) if k % 100 == 0]
        assert np.array_equal(found[[row for row, _ in on_grid]], expected[[k for _, k in on_grid]])
        between = np.interp(points[1:], 1e-3 * np.arange(1, 1001), expected[:, 0])
        assert np.abs(found[:, 0] - between).max() < 0.05 * np.ptp(expected[:, 0])


HOLDING = ("Stiction", "Tustin", "Karnopp")
FREE = ("mass.F_drive", "mass.F_load", "mass.F_friction", "mass.v_support")


@pytest.fixture(scope="module")
def rigid(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """A mass on each of these models, ``mass_NAME`` and ``NAME``, and a free ``mass``: none acts on another."""
    parts, wires, start = [FmuPart("mass", fmu("Mass"))], [], dict.fromkeys(FREE, 0.0) | {"mass.m": 1.0}
    for model in HOLDING:
        mass = f"mass_{model}"
        parts += [FmuPart(mass, fmu("Mass")), FmuPart(model, fmu(model))]
        wires += [f"{mass}.v -> {model}.v", f"{model}.F -> {mass}.F_friction", f"{mass}.F_ext -> {model}.F_ext"]
        start |= {f"{mass}.F_drive": 0.0, f"{model}.Fc": 1.0, f"{model}.Fs": 1.5}
    path = tmp_path_factory.mktemp("rigid") / "rigid.fmu"
    with System(parts, wires, start | {"Stiction.Fv": 0.0}, Experiment(stop=1.0, step=1e-3)) as system:
        system.to_fmu(path)
    return load(path)


@pytest.mark.parametrize("h", [0.31e-3, 0.79e-3, 2.5e-3, 3.7e-3])
def test_a_force_that_jumps_between_grid_points_moves_a_mass_on_rigid_friction(rigid: Library, h: float) -> None:
    """1 kg, Fc = 1 N, Fs = 1.5 N: 0.7 N is held; 3 N for a time T moves it with 2 m/s^2; without force it stops after
    2 T, 3 T^2 from its start. The force within the time at rest is that at the point, not a mean."""
    moved = round(10e-3 / h)
    x, v = "mass_Stiction.x", "mass_Stiction.v"
    with Instance(rigid) as run:
        run.initialise()
        for k in range(round(0.1 / h)):
            force = {1: 0.7, 11: 3.0, 11 + moved: 0.0}.get(k)
            if force is not None:
                run.set({"mass_Stiction.F_drive": force})
            run.step(k * h, h)
            if k < 11:
                assert run.get(x, v, "Stiction.F") == pytest.approx([0.0, 0.0, 0.7 if k else 0.0], abs=1e-12)
        assert run.get(x, v) == pytest.approx([3.0 * (moved * h) ** 2, 0.0], rel=4e-4, abs=1e-12)


def test_an_input_that_jumps_between_grid_points_has_its_impulse(rigid: Library) -> None:
    """A free mass of 1 kg: 2 N from 3.7 ms to 8.2 ms of a grid of 1 ms, v = 9 mm/s, also after a state."""
    with Instance(rigid) as run:
        run.initialise()
        run.step(0.0, 3.7e-3)
        run.set({"mass.F_drive": 2.0})
        state = run.serialised()
        run.step(3.7e-3, 4.5e-3)
        assert run.get1("mass.a") == pytest.approx(2.0)
        run.set({"mass.F_drive": 0.0})
        run.step(8.2e-3, 1.8e-3)
        assert run.get1("mass.v") == pytest.approx(9e-3, rel=1e-9)
        assert run.get1("mass.x") == pytest.approx(4.5e-3**2 + 9e-3 * 1.8e-3, rel=1e-9)
        run.restore(state)
        run.step(3.7e-3, 6.3e-3)
        assert run.get1("mass.v") == pytest.approx(2.0 * 6.3e-3, rel=1e-9)


@pytest.mark.parametrize("model", HOLDING)
def test_setting_an_input_keeps_the_holding_force(rigid: Library, model: str) -> None:
    """0.7 N is held by friction of 1 N, also when the force is set again before the outputs are read."""
    drive, names = f"mass_{model}.F_drive", (f"mass_{model}.x", f"mass_{model}.v", f"{model}.F", f"mass_{model}.a")
    with Instance(rigid) as run:
        run.initialise()
        for k in range(5):
            run.set({drive: 0.7})
            run.step(k * 1e-3, 1e-3)
        before = run.get(*names)
        run.set({drive: 0.7})
        assert run.get(*names) == before
        assert before == pytest.approx([0.0, 0.0, 0.7, 0.0], abs=1e-12)


@nightly
@pytest.mark.parametrize("off", [3e-7, -3e-7, 1e-5, -1e-5])
def test_points_beside_the_grid_give_the_values_of_the_grid(tmp_path: Path, off: float) -> None:
    """Jumps just beside grid points: parts of steps that are much shorter than a step are no evidence that steps are
    short enough for the light mass."""
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("MaxwellSlip"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"mass.m": 1e-4, "mass.k": 200.0, "mass.d": 1.0, "mass.F_drive": 0.0, "friction.N": 2.0}
    start |= {"friction.k[1]": 2e4, "friction.k[2]": 1e4, "friction.W[1]": 0.5, "friction.W[2]": 0.4}
    with System(parts, wires, start, Experiment(stop=1.0, step=1e-3)) as system:
        system.to_fmu(tmp_path / "light.fmu")
    found = []
    for h in (1e-3, 1e-3 * (1.0 + off)):
        with Instance(load(tmp_path / "light.fmu")) as run:
            run.initialise()
            rows = []
            for k in range(100):
                t = (k + 0.5) * 1e-3
                run.set({"mass.F_drive": 1.5 * math.sin(14.0 * math.pi * t) + 0.4 * math.sin(62.0 * math.pi * t)})
                run.step(k * h, h)
                rows.append(run.get1("mass.x"))
        found.append(np.array(rows))
    assert np.abs(found[1] - found[0]).max() < 0.01 * np.ptp(found[0])


def test_samples_are_taken_at_the_grid_whatever_the_importer_does(compose: Callable[[str], Path]) -> None:
    library = load(compose("compensated_axis"))
    held = {}
    for h in (0.5e-3, 0.1e-3, 0.3e-3):
        with Instance(library) as run:
            run.initialise()
            values = []
            for k in range(round(30e-3 / h)):
                run.step(k * h, h)
                values.append(((k + 1) * h, *run.get("friction_model.u")))
        held[h] = dict((round(1e7 * t), u) for t, u in values)
    for t, u in held[0.1e-3].items():  # the value of the sample at the last grid point before t
        assert u == pytest.approx(held[0.5e-3][-(-t // 5000) * 5000], rel=1e-12)
    for t, u in held[0.3e-3].items():
        assert u == pytest.approx(held[0.1e-3][t], rel=1e-12)


def test_rounding_of_communication_points_adds_no_piece(library: Library) -> None:
    points = np.cumsum([0.0, *[1e-3] * 300])  # sums of a step that is not a binary fraction
    assert np.array_equal(trajectory(library, list(points)), trajectory(library, [k * 1e-3 for k in range(301)]))


def test_a_step_much_shorter_than_rounding_is_accepted(library: Library) -> None:
    with Instance(library) as run:
        run.initialise()
        for k in range(100):
            run.step(k * 1e-12, 1e-12)
        run.step(1e-10, 1e-3 - 1e-10)
        assert run.get(*NAMES) == trajectory(library, [0.0, 1e-3]).tolist()[0]


def test_a_step_of_more_inner_steps_than_a_run_can_take_is_refused(library: Library) -> None:
    """Of 1e8 inner steps of 1 ms."""
    with Instance(library) as run:
        run.initialise()
        assert run.call("DoStep", 0.0, 1.01e5, 0) == DISCARD
        assert b"more than 100000000 inner steps of 0.001 s" in run.messages[-1][-1]


def test_a_refused_step_changes_nothing(library: Library) -> None:
    with Instance(library) as run:
        run.initialise()
        for k in range(50):
            run.step(k * 1e-3, 1e-3)
        before = run.serialised()
        run.set({"mass.F_drive": 1e308})
        with run.saved() as state:
            assert run.call("DoStep", 0.05, 1e-3, 0) == DISCARD
            assert "mass" in run.messages[-1][-1].decode() or "finite" in run.messages[-1][-1].decode()
            assert run.call("DoStep", 0.05, 1e-3, 0) == ERROR  # FMI: after Discard, the state must be set first
            run.must("SetFMUstate", state)
        run.set({"mass.F_drive": 0.0})
        assert without_flags(run.serialised()) == without_flags(before)
        run.step(0.05, 1e-3)
        again = run.get(*NAMES)
    assert again == trajectory(library, [k * 1e-3 for k in range(52)]).tolist()[-1]


def without_flags(data: bytes) -> bytes:
    """A serialised state without its checksum and the flag that a value was set."""
    return data[:56] + data[64:68] + data[72:]


def test_a_rejected_value_changes_nothing(library: Library) -> None:
    with Instance(library) as run:
        run.initialise()
        run.step(0.0, 1e-3)
        before = run.serialised()
        references = [run.reference(name) for name in ("mass.m", "friction.Fs", "friction.sigma0")]
        assert run.call_values("SetReal", references, [2.0, 3.0, -1.0]) == DISCARD
        assert "friction.sigma0" in run.messages[-1][-1].decode()
        assert run.serialised() == before
        assert run.call_values("SetReal", [run.reference("mass.x0")], [1.0]) == ERROR


@nightly
def test_a_violated_relation_of_parameters_can_be_corrected(tmp_path: Path) -> None:
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("LoadDependentDahl"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    with System(parts, wires, {"mass.F_drive": 1.0}, Experiment(stop=1.0, step=1e-3)) as system:
        system.to_fmu(tmp_path / "axis.fmu")
    with Instance(load(tmp_path / "axis.fmu")) as run:
        run.setup()
        run.set({"friction.mu_dif": 0.5})
        run.must("EnterInitializationMode")
        assert run.call("ExitInitializationMode") == ERROR
        assert "|mu_dif| <= mu_avg" in run.messages[-1][-1].decode()
        run.set({"friction.mu_dif": 0.05})
        run.must("ExitInitializationMode")
        run.step(0.0, 1e-3)


CONTINUE = """
import sys
sys.path[:0] = [{tests!r}]
from pathlib import Path
from shell.instance import Instance, load
with Instance(load(Path(sys.argv[1]))) as run:
    run.restore(bytes.fromhex(sys.stdin.read()))
    for k in range(500, 700):
        run.step(k * 1e-3, 1e-3)
    print(run.serialised().hex())
"""


def test_another_process_continues_bit_for_bit(compose: Callable[[str], Path], tmp_path: Path) -> None:
    path = shutil.copy(compose("stick_slip"), tmp_path)  # each process unpacks the FMU beside the file
    with Instance(load(compose("stick_slip"))) as run:
        run.initialise()
        for k in range(500):
            run.step(k * 1e-3, 1e-3)
        state = run.serialised()
        for k in range(500, 700):
            run.step(k * 1e-3, 1e-3)
        expected = run.serialised()
    code = CONTINUE.format(tests=str(Path(__file__).parents[1]))
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], input=state.hex(), capture_output=True, text=True, check=True
    )
    assert bytes.fromhex(done.stdout.strip()) == expected


@pytest.mark.parametrize("place", [0, 20, 60, 100, 300, -20])
def test_damaged_states_are_rejected(library: Library, place: int) -> None:
    with Instance(library) as run:
        run.initialise()
        run.step(0.0, 1e-3)
        state = bytearray(run.serialised())
        state[place] ^= 0x40
        assert run.try_restore(bytes(state)) == ERROR
        assert run.try_restore(bytes(state[:-8])) == ERROR
        run.step(1e-3, 1e-3)


def test_a_state_inside_a_tick_continues(library: Library) -> None:
    points = [0.0, 0.4e-3, 1.7e-3, 2e-3, 2.2e-3, 4e-3]
    expected = trajectory(library, points)
    with Instance(library) as run:
        run.initialise()
        run.step(0.0, 0.4e-3)
        state = run.serialised()
    with Instance(library) as run:
        run.restore(state)
        for t, end in itertools.pairwise(points[1:]):
            run.step(t, end - t)
        assert run.get(*NAMES) == expected[-1].tolist()


def test_reset_starts_again(library: Library) -> None:
    with Instance(library) as run:
        for _ in range(2):
            run.initialise()
            for k in range(20):
                run.step(k * 1e-3, 1e-3)
            values = run.get(*NAMES)
            assert values == trajectory(library, [k * 1e-3 for k in range(21)]).tolist()[-1]
            run.must("Terminate")
            run.must("Reset")


def test_inputs_vary_linearly_within_a_step(rigid: Library) -> None:
    """A free mass of 1 kg under a ramp force: v = F t^2/2 with F = 2 N/s, over 100 inner steps."""
    with Instance(rigid) as run:
        run.initialise()
        run.set({"mass.F_drive": 0.0})
        assert run.input_derivatives({"mass.F_drive": 2.0}) == OK
        run.step(0.0, 0.1)
        assert run.get1("mass.v") == pytest.approx(0.01, rel=1e-12)
        assert run.get1("mass.x") == pytest.approx(2.0 * 0.1**3 / 6.0, rel=1e-12)
        run.step(0.1, 0.1)  # no derivative is set again: the force is held at 0.2 N
        assert run.get1("mass.v") == pytest.approx(0.01 + 0.02, rel=1e-12)


def test_outputs_follow_inputs_without_a_step(library: Library) -> None:
    with Instance(library) as run:
        run.initialise()
        run.step(0.0, 1e-3)
        held = run.get1("mass.a")
        run.set({"mass.F_drive": 3.0})
        assert run.get1("mass.a") == pytest.approx(held + 3.0, rel=1e-9)
        run.set({"mass.F_drive": 0.0})
        assert run.get1("mass.a") == pytest.approx(held, rel=1e-9)
        for k in range(1, 20):
            run.step(k * 1e-3, 1e-3)
        assert run.get(*NAMES) == trajectory(library, [k * 1e-3 for k in range(21)]).tolist()[-1]


def test_outputs_follow_parameters_without_a_step(library: Library) -> None:
    """a = (F_drive - k (x - x_support) - F)/m: twice the mass halves it, and the next step begins with this mass."""
    with Instance(library) as run:
        run.initialise()
        run.step(0.0, 1e-3)
        a = run.get1("mass.a")
        run.set({"mass.m": 2.0})
        assert run.get1("mass.a") == pytest.approx(0.5 * a, rel=1e-8)


def test_errors_that_remain_are_told_at_the_end_of_the_run(compose: Callable[[str], Path]) -> None:
    """A mass of 1 ug on 1e6 N/m swings 5000 times in an inner step of 1 ms, which 512 pieces of it do not resolve."""
    with Instance(load(compose("stick_slip"))) as run:
        run.initialise(**{"mass.m": 1e-9, "mass.k": 1e6, "mass.v0": 1.0})
        run.step(0.0, 1e-3)
        run.must("Terminate")
        ((_, status, category, message),) = run.messages
        assert (status, category) == (WARNING, "logStatusWarning")
        assert b"changes too fast for the step of 0.001 s" in message
        assert b"the result is wrong" in message


def test_a_law_inside_reports_a_fault(compose: Callable[[str], Path]) -> None:
    """An input that is not finite reaches a sampled law, which holds its outputs; a continuous part refuses it."""
    with Instance(load(compose("compensated_axis"))) as run:
        run.initialise()
        run.step(0.0, 0.5e-3)
        run.set({"pid.rdd": math.nan})
        assert run.call("DoStep", 0.5e-3, 0.5e-3, 0) == WARNING
        assert "pid" in run.messages[-1][-1].decode()
        assert run.get1("pid.fault") == 1.0
        run.set({"pid.rdd": 0.0})
        run.step(1e-3, 0.5e-3)
        assert run.get1("pid.fault") == 0.0
        assert run.try_set({"axis.F_load": math.nan}) == [DISCARD]


def test_a_slow_part_is_stepped_at_the_end_of_its_last_inner_step(tmp_path: Path) -> None:
    """A free mass, v = 0.2 t, that is stepped every two inner steps, by an importer with half of that.

    Beside it, a mass of 1 kg with v = 0.2 m/s stops after 0.2 s under 1 N, so that an inner step is solved in parts.
    """
    parts = [FmuPart("stopping", fmu("Mass")), FmuPart("friction", fmu("Coulomb"))]
    parts.append(FmuPart("mass", fmu("Mass"), every=2))
    wires = ["stopping.v -> friction.v", "friction.F -> stopping.F_friction", "stopping.F_ext -> friction.F_ext"]
    start = {"mass.F_drive": 0.2, "mass.F_friction": 0.0, "mass.m": 1.0}
    start |= {"stopping.F_drive": 0.0, "stopping.v0": 0.2, "stopping.m": 1.0, "friction.Fc": 1.0}
    with System(parts, wires, start, Experiment(stop=1.0, step=0.125)) as system:
        system.to_fmu(tmp_path / "slow.fmu")
    with Instance(load(tmp_path / "slow.fmu")) as run:
        run.initialise()
        found = []
        for k in range(16):
            run.step(0.0625 * k, 0.0625)
            found.append(run.get1("mass.v"))
        assert run.get1("stopping.x") == pytest.approx(0.02, rel=1e-6)
    assert found == pytest.approx([0.2 * 0.25 * ((k + 1) // 4) for k in range(16)], abs=1e-15)


@pytest.mark.parametrize("model", HOLDING)
def test_a_mass_that_has_stopped_between_grid_points_is_held_by_friction(rigid: Library, model: str) -> None:
    """1 kg under 0.3 N, Fc = 1 N: it stops before v0 / 0.7; then v = 0 and F = 0.3 N, also after an input was set to
    the same value, which has the outputs that depend on it computed again."""
    load, names, h = f"mass_{model}.F_drive", (f"mass_{model}.v", f"{model}.F"), 0.37e-3
    for v0 in np.linspace(1e-3, 5e-3, 20):
        with Instance(rigid) as run:
            run.initialise(**{f"mass_{model}.v0": float(v0), load: 0.3, "Karnopp.DV": 0.0})
            for k in range(math.ceil(v0 / 0.7 / h) + 4):
                run.step(k * h, h)
                for force in (None, 0.3) if k * h > v0 / 0.7 + h else ():
                    run.set({} if force is None else {load: force})
                    v, F = run.get(*names)
                    assert v == 0.0, (v0, k, force)
                    assert abs(F - 0.3) < 1e-9, (v0, k, force)
