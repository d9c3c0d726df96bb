"""The axis that the report simulates in the browser: the servo alone and the recommendation as WebAssembly modules."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from friction_fmus.axis.loop_assembly import PartPool, block, drive_input
from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.axis.servo_loop import recorded
from friction_fmus.export.composite.composite_archive import composite_source
from friction_fmus.export.targets.wasm.npm_package import WasmModel, wasm_model
from friction_fmus.identification import Array
from friction_fmus.study.evaluation import MASSES, AxisBench, Scheme, off_by, system_of
from friction_fmus.study.study_result import CompensatorResult, Metrics
from harness import FmuPart, HarnessError, System, Wire
from harness.compiling.platforms import WASM
from harness.system.wire import split_name

SOURCES: Final = ("reference", "noise")  # parts whose outputs are inputs of the modules
LONGEST: Final = 40_000  # largest number of samples that the report contains; of a longer record, it has the beginning
DELAYS: Final = 8  # number of delays of the drive from which a reader can choose, in steps of a sample
TERMS: Final = 4  # number of inputs of a sum

Settings = Mapping[str, float]


@dataclass(frozen=True)
class Knob:
    """Property of the axis that a reader of the report can change."""

    name: str
    text: str
    """Name, and what is changed."""
    unit: str  # unit; empty for a factor or a number of samples
    start: float  # value of the study
    least: float
    most: float
    """Range of the slider."""
    settings: tuple[Settings, ...]  # for each run, the parameters and what each is divided by the value of the knob
    zero: bool = False  # whether the value may also be zero
    taps: tuple[str, ...] = ()
    """Parameters of which one is 1 and all others are 0, from the one for the value `least` on, in steps of 1."""


@dataclass(frozen=True)
class PanelRun:
    """Run of the axis."""

    name: str  # compensator, "none" for the servo alone
    metrics: Metrics  # metrics of the study
    model: WasmModel
    """Servo, compensator and axis; the inputs are the reference and, if the measured position is noisy, the noise."""


@dataclass(frozen=True, eq=False)
class WhatIf:
    """The axis in the browser."""

    runs: tuple[PanelRun, ...]  # the recommended compensator, if there is one, and the servo alone
    knobs: tuple[Knob, ...]  # properties that can be changed
    Ts: float  # sample time [s]
    r: Array
    noise: Array = field(default_factory=lambda: np.zeros(0))
    """Reference, and noise of the measured position of standard deviation 1; empty without noise."""
    run_up: int = 0  # number of samples before the first one of the record
    whole: bool = True  # whether the reference is that of the study, not only its first `LONGEST` samples


def panel_of(bench: AxisBench, found: Sequence[tuple[CompensatorResult, Scheme]], noise: Array) -> WhatIf | str:
    """Return the axis for the browser, see `what_if`, or a sentence that says why it cannot be compiled."""
    try:
        return what_if(bench, found, noise)
    except HarnessError as error:
        return f"There are no sliders here, because the axis cannot be compiled for the browser: {error}"


def what_if(bench: AxisBench, found: Sequence[tuple[CompensatorResult, Scheme]], noise: Array) -> WhatIf:
    """Compile the axis for the browser."""
    shown = [(row.name, row.metrics, scheme) for row, scheme in found if row.metrics is not None]
    with ExitStack() as stack:
        # they are started side by side when they are compiled: none shares a part with another one
        systems = [stack.enter_context(variable_system(bench, scheme, PartPool())) for _, _, scheme in shown]
        knobs = knobs_of(bench, [scheme for _, _, scheme in shown], systems)
        with ThreadPoolExecutor(len(systems)) as threads:
            models = list(threads.map(_module, systems, [f"axis{i}" for i in range(len(systems))]))
    runs = tuple(PanelRun(name, metrics, model) for (name, metrics, _), model in zip(shown, models, strict=True))
    kept = slice(LONGEST)
    heard = noise[kept] if "noise" in systems[0].parts else np.zeros(0)
    return WhatIf(runs, knobs, bench.servo.Ts, bench.r[kept], heard, bench.run_up, len(bench.r) <= LONGEST)


def variable_system(bench: AxisBench, scheme: Scheme, pool: PartPool) -> System:
    """Return the axis with a scheme as a system in which delay and encoder step are parameters, too."""
    # Sums of `DELAYS` delayed commands, of which one has the gain 1, are in place of the delay of the connection: it is
    # the same delay, whereas a continuous actuator would add a step. An encoder of step 0 is exact.
    servo = replace(scheme.servo, delay=0, quantum=scheme.servo.quantum or 1.0)
    system = system_of(bench, replace(scheme, servo=servo), pool)
    assert system.experiment is not None
    every = system.experiment.decimate
    chosen = _delays(scheme.servo)
    parts = [
        FmuPart(name, block("SampledSum", bench.trajectory.rotary), every=every)
        for name in ("drive", *dict.fromkeys(tap.partition(".")[0] for tap in chosen))
    ]
    wires = [wire for wire in system.wires if wire.target != drive_input(system.parts)]
    command = recorded(system.parts)[1]
    wires += [Wire(command, tap.replace("gain[", "u").rstrip("]"), delay=n * every) for tap, n in chosen.items()]
    wires += [Wire(f"{part.name}.y", f"drive.u{i}") for i, part in enumerate(parts[1:], start=1)]
    wires.append(Wire("drive.y", drive_input(system.parts)))
    start = {
        **system.start,
        "encoder.q": scheme.servo.quantum,
        **{f"{part.name}.Ts": servo.Ts for part in parts},
        **{tap: float(n == scheme.servo.delay) for tap, n in chosen.items()},
    }
    return System([*system.parts.values(), *parts], wires, start, system.experiment, system.name)


def _delays(servo: Servo) -> dict[str, int]:
    """Return the delays that can be chosen [samples], by the gain of the delayed command."""
    first = max(0, servo.delay - 3)
    return {f"delayed{1 + i // TERMS}.gain[{1 + i % TERMS}]": first + i for i in range(DELAYS)}


def knobs_of(bench: AxisBench, schemes: Sequence[Scheme], systems: Sequence[System]) -> tuple[Knob, ...]:
    """Return what can be changed in systems that `variable_system` returned for some schemes."""
    delays = _delays(bench.servo)
    servo, mass, u = bench.servo, bench.plant.mass, bench.trajectory.words
    plants = [off_by(system, 1.0, 1.0) for system in systems]
    frictions = [{name: value for name, value in each.items() if name not in MASSES} for each in plants]
    masses = [{name: value / mass for name, value in each.items() if name in MASSES} for each in plants]
    # kp of a cascade multiplies kv, so the loop gain is proportional to all others
    gains = [
        {f"servo.{name}": scheme.servo.gains[name] for name in GAINS[servo.law] if name != "kp"} for scheme in schemes
    ]
    step = servo.quantum or 1e-2 * float(np.ptp(bench.r)) / 1e3

    def alike(settings: Settings) -> tuple[Settings, ...]:
        return (settings,) * len(systems)

    return (
        Knob("friction", f"all friction {u.force}s of the axis", "", 1.0, 0.1, 4.0, tuple(frictions)),
        Knob(u.mass, "moved by the drive", u.kg, mass, 0.25 * mass, 4.0 * mass, tuple(masses)),
        Knob(
            "delay",
            f"from command to {u.force}, in samples of {1e3 * servo.Ts:g} ms",
            "samples",
            float(servo.delay),
            float(min(delays.values())),
            float(max(delays.values())),
            alike({}),
            taps=tuple(delays),
        ),
        Knob("controller gains", "all scaled together", "", 1.0, 0.1, 3.0, tuple(gains)),
        Knob(
            "encoder step",
            "resolution of the measured position",
            u.m,
            servo.quantum,
            0.1 * step,
            1e3 * step,
            alike({"encoder.q": 1.0}),
            zero=True,
        ),
    )


def _module(system: System, name: str) -> WasmModel:
    """Return a system as a module with the variables that the report sets and reads."""
    sources = {wire.source for wire in system.wires if split_name(wire.source)[0] in SOURCES}
    inputs, outputs = sorted(sources), [recorded(system.parts)[0], "servo.u"]
    return wasm_model(composite_source(system, name, (WASM,), inputs=inputs, outputs=outputs))
