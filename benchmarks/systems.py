"""Whole systems: the engine with direct calls, with the functions of FMI, and compiled; C by hand, one FMU, batches.

All of a comparison run in turn in one process; the fastest round of each counts, and the median of the ratios of the
rounds. Times are processor times without the start. The servo of a batch is a PD controller at 10 kHz, a mass and LuGre
friction, with a reference position that is held for 1 ms: as copies of the system, as a joint of MuJoCo with a DC motor
and an actuator that is the controller, in steps of 0.1 ms, and in a loop with fmpy. The reference solution is scipy's
Radau from one sample of the controller to the next.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).parents[1])  # in this folder harness.py would hide the package

import ctypes
import logging
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.rows import Row, arguments, report
from benchmarks.step_cost import ratio_rows
from benchmarks.sweep import WIRES, FmpyLoop
from friction_fmus import build
from friction_fmus.cli.inputs import open_system
from harness import FmuPart, System, Tap
from harness.compiling.toolchain import FLAGS, compiler
from harness.parts import fmi2
from harness.processors import available

Values = NDArray[np.float64]
STEP = 1e-4
SERVO = {"profile": "Profile", "pid": "PID", "mass": "Mass", "friction": "LuGre"}
PID = (12e3, 190.0, 250e3, 1000.0)  # Kp, Kd, Ki, limit of u
MOTION = (0.1, 0.25, 2.5, 50.0, 0.2)  # distance, v_max, a_max, j_max, pause
LUGRE = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "sigma0": 1e5, "sigma1": 316.22776601683796, "sigma2": 0.4}
ELEMENTS = (28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3)
GMS = (1.0, 1.5, 1e-3, 2.0, 100.0, 0.4, 10.0, *ELEMENTS, *(10 * (0.1,)))
AXIS = Path(__file__).parents[1] / "examples" / "compensated_axis.toml"

PULLED = {"mass.F_drive": 0.0, "mass.k": 2.0, "mass.v_support": 0.1}
INNER = 10  # inner steps of one FMU in a communication step, where it has more than one
BY_HAND = {"gauss-seidel": 1e-7, "newton": 1e-9}  # difference of positions [m]

KP, KD = 12e3, 190.0
BATCH = {"pid.Kp": KP, "pid.Kd": KD, "pid.Ki": 0.0, "pid.Ts": STEP, "pid.r": 0.0, "pid.rd": 0.0, "pid.rdd": 0.0}
PER = 10  # steps for which the reference position is held
MUJOCO = f"""
<mujoco>
  <option timestep="{STEP}" integrator="{{integrator}}" gravity="0 0 0"/>
  <worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body></worldbody>
  <actuator>
    <general joint="x" gainprm="{KP}" biastype="affine" biasprm="0 -{KP} -{KD}"/>
    <dcmotor joint="x" motorconst="0" resistance="1" input="none" damping="{LUGRE["sigma2"]}"
      lugre="{LUGRE["sigma0"]} {LUGRE["sigma1"]} {LUGRE["Fc"]} {LUGRE["Fs"]} {LUGRE["vs"]}"/>
  </actuator>
</mujoco>
"""


@contextmanager
def functions_of_fmi() -> Iterator[None]:
    """Let the engine load FMUs without their direct calls."""
    kept = fmi2._direct_calls
    fmi2._direct_calls = lambda library: 0
    try:
        yield
    finally:
        fmi2._direct_calls = kept


def engine_time(system: System, n: int, record: str, **settings: Any) -> tuple[float, Values]:
    """Seconds of a step, in the second half of a run, and the recorded values."""
    times: list[float] = []
    watch = Tap(lambda t, values: times.append(time.thread_time()), names=(), every=n // 2)
    result = system.run(stop=n * settings["step"], record=[record], taps=[watch], **settings)
    return (times[2] - times[1]) / (n // 2), result[record].to_numpy()


class ByHand:
    """The loops of servos.c and pulled_mass.c."""

    def __init__(self, folder: Path) -> None:
        """Compile them with the flags of the FMUs."""
        self._run, self._pull = (self._compiled(folder, name) for name in ("servos", "pulled_mass"))

    @staticmethod
    def _compiled(folder: Path, name: str) -> Any:
        target, own = folder / f"{name}.so", Path(__file__).parent
        flags = [flag for flag in FLAGS if flag not in ("-std=c99", "-Werror")]
        flags += [f"-I{own.parent / 'fmu_src' / headers}" for headers in ("numerics", "friction")]
        places = ["-std=gnu99", "-w", *flags, "-fvisibility=default", str(own / f"{name}.c")]
        subprocess.run([*compiler(), *places, "-o", str(target), "-shared", "-lm"], check=True)
        loaded = ctypes.CDLL(str(target))
        run = loaded.run_servo if name == "servos" else loaded.run_pulled_mass
        run.restype = ctypes.c_double
        return run

    def pulled_mass(self, n: int, step: float) -> tuple[float, Values]:
        """Seconds of a step of the pulled mass under newton, and the positions."""
        rows, contact = np.empty(n + 1), np.array([*LUGRE.values()])
        mass = [ctypes.c_double(value) for value in (1.0, PULLED["mass.k"], PULLED["mass.v_support"])]
        places = (ctypes.c_void_p(each.ctypes.data) for each in (contact, rows))
        return self._pull(next(places), *mass, ctypes.c_long(n), ctypes.c_double(step), next(places)) / n, rows

    def __call__(self, n: int, *, gms: bool) -> tuple[float, Values]:
        """Seconds of a step, and the positions."""
        motion, pid, contact = (np.array(each) for each in (MOTION, PID, GMS if gms else [*LUGRE.values()]))
        rows = np.empty(n + 1)
        pointers = [ctypes.c_void_p(each.ctypes.data) for each in (motion, pid, contact)]
        numbers = (ctypes.c_bool(gms), ctypes.c_double(1.0), ctypes.c_long(n), ctypes.c_double(STEP), 10)
        return self._run(*pointers, *numbers, ctypes.c_void_p(rows.ctypes.data)) / n, rows


def compared(
    title: str,
    make: Callable[[], System],
    record: str,
    settings: Mapping[str, Any],
    rounds: int,
    n: int,
    folder: Path,
    by_hand: Callable[[], tuple[float, Values]] | None = None,
) -> list[Row]:
    """The rows of one system.

    Raises
    ------
    SystemExit
        If one of them computes something else.
    """
    kinds = ("direct", "fmi", "compiled", "one", "newton", "hand", "ten", "newton_ten")
    times: dict[str, list[float]] = {kind: [] for kind in kinds}
    explicit = "master" not in settings
    step = settings["step"]
    implicit = {**settings, "master": "newton"}
    path = folder / f"{title.replace('-', '_').replace(' ', '_')}.fmu"
    with make() as system, make() as plain:
        system.to_fmu(path, outputs=[record], inputs=[], step=step, master="newton")
        with functions_of_fmi():
            plain.run(stop=step, **settings)
        with System([FmuPart("one", path)]) as one:
            for _ in range(rounds):
                taken, x = engine_time(system, n, record, **settings)
                times["direct"].append(taken)
                taken, x_fmi = engine_time(plain, n, record, **settings)
                times["fmi"].append(taken)
                if explicit:
                    taken, x_compiled = engine_time(system, n, record, engine="compiled", **settings)
                    times["compiled"].append(taken)
                taken, x_newton = engine_time(system, n, record, **implicit)
                times["newton"].append(taken)
                taken, x_one = engine_time(one, n, f"one.{record}", step=step)
                times["one"].append(taken)
                taken, x_tenth = engine_time(system, n, record, **implicit, decimate=INNER)
                times["newton_ten"].append(taken)
                taken, x_ten = engine_time(one, n // INNER, f"one.{record}", step=INNER * step)
                times["ten"].append(taken / INNER)
                same = np.array_equal(x, x_fmi) and np.array_equal(x_newton, x_one) and np.array_equal(x_ten, x_tenth)
                if not same or (explicit and not np.array_equal(x, x_compiled)):
                    raise SystemExit(f"{title}: they compute different values")
                if by_hand is not None:
                    taken, x_hand = by_hand()
                    times["hand"].append(taken)
                    allowed = BY_HAND[settings.get("master", "gauss-seidel")]
                    if not np.allclose(x_hand, x, rtol=0.0, atol=allowed):
                        raise SystemExit(
                            f"{title}: C by hand computes something else, by {np.abs(x_hand - x).max():.2g} m"
                        )
    rows = [Row(f"{title}: step of the engine", 1e9 * min(times["direct"]), "ns")]
    aim = 0.8 if settings.get("master") == "newton" else 0.6
    rows += ratio_rows(f"{title}: engine / the same with the functions of FMI", times["direct"], times["fmi"], aim)
    if by_hand is not None:
        rows += ratio_rows(f"{title}: engine / C by hand", times["direct"], times["hand"], 1.3)
    if explicit:
        rows += ratio_rows(f"{title}: compiled / engine", times["compiled"], times["direct"], 0.6)
        rows += ratio_rows(f"{title}: compiled / C by hand", times["compiled"], times["hand"], 1.3)
    rows += ratio_rows(f"{title}: one FMU / engine, both newton", times["one"], times["newton"], 1.0)
    longer = f"{title}: one FMU / engine, {INNER} inner steps in a communication step"
    rows += ratio_rows(longer, times["ten"], times["newton_ten"], 1.0)
    return rows


def servo(folder: Path, friction: str = "LuGre") -> System:
    """The closed loop."""
    parts = [FmuPart(name, build(friction if name == "friction" else model, folder)) for name, model in SERVO.items()]
    return System(parts, WIRES, {"profile.cyclic": 1.0})


def stick_slip(folder: Path) -> System:
    """A mass that a spring pulls over LuGre friction."""
    parts = [FmuPart("mass", build("Mass", folder)), FmuPart("friction", build("LuGre", folder))]
    return System(parts, ["mass.v -> friction.v", "friction.F -> mass.F_friction"], PULLED)


def references(n: int, samples: int) -> Values:
    """Reference positions of n servos [m], one for each millisecond: sines of 0.2 to 2 mm at 2 Hz."""
    t = PER * STEP * np.arange(samples)
    return np.linspace(2e-4, 2e-3, n)[:, None] * np.sin(4.0 * np.pi * t)


def exact(r: Values) -> Values:
    """Positions of a servo after each millisecond, by Radau from sample to sample of the controller."""

    def rate(_: float, y: Values, u: float) -> list[float]:
        _, v, bristles = y
        level = LUGRE["Fc"] + (LUGRE["Fs"] - LUGRE["Fc"]) * np.exp(-((v / LUGRE["vs"]) ** 2))
        slip = v - abs(v) * bristles / level
        return [v, u - bristles - LUGRE["sigma1"] * slip - LUGRE["sigma2"] * v, LUGRE["sigma0"] * slip]

    y, found = np.zeros(3), [0.0]
    for position in r:
        for _ in range(PER):
            u = KP * (position - y[0]) - KD * y[1]
            solution = solve_ivp(rate, (0.0, STEP), y, "Radau", args=(u,), rtol=1e-10, atol=[1e-16, 1e-14, 1e-12])
            y = solution.y[:, -1]
        found.append(float(y[0]))
    return np.array(found)


def batch_system(folder: Path) -> System:
    """The servo of a batch."""
    parts = [FmuPart(name, build(model, folder)) for name, model in SERVO.items() if name != "profile"]
    return System(parts, [wire for wire in WIRES if not wire.startswith("profile.")], BATCH)


def batch_rows(folder: Path, short: bool) -> list[Row]:
    """Steps a second of batches and of others, and their errors."""
    rows, samples = [], 100 if short else 500
    r = references(1, samples)
    right = exact(r[0])
    span = float(np.ptp(right))
    with batch_system(folder) as system:
        for master in ("gauss-seidel", "newton"):
            with system.batch(1, inputs=["pid.r"], outputs=["mass.x"], step=STEP, master=master) as one:
                x = [0.0, *(float(one.step(r[:, k, None], PER)[0, 0]) for k in range(samples))]
            rows.append(
                Row(f"Servo in a batch: error of x, {master}", 100.0 * float(np.abs(x - right).max()) / span, "%")
            )
        rows += [
            Row(f"Servo in a batch: error of x, MuJoCo {integrator}", 100.0 * mujoco_error(r, right) / span, "%")
            for integrator, mujoco_error in ((each, MuJoCo(each).error) for each in ("Euler", "implicitfast", "RK4"))
        ]
        loop = FmpyServo(folder)
        error = float(np.abs(loop.positions(r[0]) - right).max())
        rows.append(Row("Servo in a batch: error of x, fmpy", 100.0 * error / span, "%"))
        for n in (1, 100, 10_000):
            rows += speed_rows(system, loop, n, 1 if short else 5)
    return rows


def speed_rows(system: System, loop: FmpyServo, n: int, rounds: int) -> list[Row]:
    """A batch of n servos, MuJoCo's rollout of as many, and a loop over fmpy."""
    peers = {name: MuJoCo(name) for name in ("Euler", "RK4")}
    samples = max(10, 5000 // n)  # of the reference position in one call
    r, ours, others, theirs = references(n, samples), [], {name: [] for name in peers}, []
    compiled: list[float] = []
    with (
        system.batch(n, inputs=["pid.r"], outputs=["mass.x"], step=STEP, engine="compiled") as made,
        system.batch(n, inputs=["pid.r"], outputs=["mass.x"], step=STEP) as batch,
        system.batch(n, inputs=["pid.r"], start={"mass.m": np.ones(n)} if n <= 100 else {}, step=STEP) as varied,
    ):
        held = np.ascontiguousarray(r.T)[:, :, None]
        for each in (batch, made):
            each.step(held[0], PER)  # which compiles
        for _ in range(rounds):
            begin = time.perf_counter()
            for row in held:
                batch.step(row, PER)
            ours.append((time.perf_counter() - begin) / (n * samples * PER))
            begin = time.perf_counter()
            for row in held:
                made.step(row, PER)
            compiled.append((time.perf_counter() - begin) / (n * samples * PER))
            if not np.array_equal(made.values, batch.values):
                raise SystemExit("the compiled batch computes something else")
            for name, peer in peers.items():
                others[name].append(peer.time(r) / (n * samples * PER))
            theirs.append(loop.time(r[0, :10]) / (10 * PER))
        rows = [
            Row(f"{n} servos: steps of a batch", 1e-6 / min(ours), "million/s"),
            Row(f"{n} servos: steps of a compiled batch", 1e-6 / min(compiled), "million/s"),
            Row(f"{n} servos: memory of a copy", batch.size / 1e3, "kB", 1.0),
        ]
        if n <= 100:
            rows.append(Row(f"{n} servos: memory of a copy with parameters of its own", varied.size / 1e3, "kB"))
    rows += ratio_rows(f"{n} servos: compiled batch / batch", compiled, ours)
    for name, times in others.items():
        rows += ratio_rows(f"{n} servos: batch / MuJoCo's rollout with {name}", ours, times)
    return [*rows, *ratio_rows(f"{n} servos: batch / fmpy", ours, theirs)]


class MuJoCo:
    """The servo as a joint, in threads.

    Parameters
    ----------
    integrator : str
        Of MuJoCo.
    """

    def __init__(self, integrator: str) -> None:
        """Load the model."""
        import mujoco
        from mujoco import rollout

        self._model = mujoco.MjModel.from_xml_string(MUJOCO.format(integrator=integrator))
        self._data = [mujoco.MjData(self._model) for _ in range(available())]
        self._size = mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._rollout = rollout.Rollout(nthread=len(self._data))

    def run(self, r: Values) -> tuple[float, Values]:
        """Seconds, and the states after each step."""
        control = np.repeat(r, PER, axis=1)[:, :, None]
        start = np.zeros((len(r), self._size))
        begin = time.perf_counter()
        states, _ = self._rollout.rollout(self._model, self._data, start, control)
        return time.perf_counter() - begin, states

    def time(self, r: Values) -> float:
        """Seconds of as many servos as there are rows; each millisecond a call, as that of a batch."""
        return self.run(r)[0]

    def error(self, r: Values, right: Values) -> float:
        """Largest error of the position [m]."""
        states = self.run(r)[1]
        return float(np.abs(states[0, PER - 1 :: PER, 1] - right[1:]).max())


class FmpyServo(FmpyLoop):
    """The servo of a batch in a loop with fmpy.

    Parameters
    ----------
    folder : Path
        Where to unpack.
    """

    def __init__(self, folder: Path) -> None:
        """Instantiate."""
        fmus = {name: build(model, folder) for name, model in SERVO.items()}
        super().__init__(fmus, folder / "fmpy")
        self.start = {name: value for name, value in BATCH.items() if name in self.references}

    def positions(self, r: Values) -> Values:
        """Positions after each millisecond."""
        found: list[float] = []

        def refer(tick: int, signals: dict[str, float]) -> None:
            signals |= {"profile.r": float(r[tick // PER]), "profile.rd": 0.0, "profile.rdd": 0.0}
            if tick % PER == 0:
                found.append(signals["mass.x"])

        last = self.run(self.start, len(r) * PER, refer)
        return np.array([*found, last])

    def time(self, r: Values) -> float:
        """Seconds of the reference positions."""
        begin = time.perf_counter()
        self.run(self.start, len(r) * PER)
        return time.perf_counter() - begin


def main() -> None:
    """Prints the table."""
    options = arguments(__doc__ or "")
    logging.getLogger("harness").addHandler(logging.NullHandler())
    rounds, n = (2, 10_000) if options.short else (12, 50_000)
    held, implicit = {"step": STEP}, {"step": 1e-3, "master": "newton"}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        hand = ByHand(folder)
        gms, axis = (lambda: servo(folder, "GMS")), (lambda: open_system(AXIS))
        pulled = partial(stick_slip, folder)
        rows = [
            *compared("Servo", lambda: servo(folder), "mass.x", held, rounds, n, folder, lambda: hand(n, gms=False)),
            *compared("GMS loop", gms, "mass.x", held, rounds, n, folder, lambda: hand(n, gms=True)),
            *compared("Pulled mass", pulled, "mass.x", implicit, rounds, n, folder, lambda: hand.pulled_mass(n, 1e-3)),
            *compared("Compensated axis", axis, "axis.x", {**implicit, "step": 5e-4}, rounds, n, folder),
            *batch_rows(folder, options.short),
        ]
    report("Whole systems", rows, options.json)


if __name__ == "__main__":
    main()
