"""Systems, their composite FMUs, and runs of both."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

from friction_fmus import fmu
from harness import Experiment, FmuPart, HarnessError, SeriesPart, System, Wire
from harness.units import units_agree

STEP = 1e-3
BINARY_STEP = 2.0**-10
"""A step whose halves and sums are exact, so that an importer and the harness compute the same lengths."""

POOL = (
    *("Mass", "TwoMass", "LuGre", "Dahl", "Viscous", "MaxwellSlip", "ElastoPlastic", "Actuator"),
    *("Sine", "Sum", "Quantiser", "PID", "LuGreFeedforward", "DisturbanceObserver", "Differentiator"),
)


def run_composite(path: Path, stop: float, step: float) -> dict[str, np.ndarray]:
    """The outputs of a composite FMU, run alone with the start values of its inputs."""
    part = FmuPart("composite", path)
    start = {f"composite.{port.name}": port.start for port in part.inputs if port.start is not None}
    with System([part], start=start) as system:
        result = system.run(stop=stop, step=step, master="gauss-seidel")
        return {port.name: result[f"composite.{port.name}"].to_numpy() for port in part.outputs}


def run_parts(system: System, stop: float, master: str = "newton") -> dict[str, np.ndarray]:
    """The outputs of all parts in the harness."""
    result = system.run(stop=stop, master=master, record=["*"])
    return {str(name): result[name].to_numpy() for name in result.data_vars}


def differing(found: Mapping[str, np.ndarray], expected: Mapping[str, np.ndarray], every: int = 1) -> list[str]:
    """The outputs that are not equal bit for bit."""
    return [name for name in found if not np.array_equal(found[name], expected[name][::every], equal_nan=True)]


@st.composite
def random_systems(draw: st.DrawFn, pool: Sequence[str] = POOL, *, plain: bool = False) -> System:
    """Systems of 2 to 8 parts with loops, sampled and continuous parts.

    Unless they are plain, they have delays, gains, offsets, recorded series, and parts that are stepped less often.
    """
    step = draw(st.sampled_from((STEP, BINARY_STEP)))
    models = draw(st.lists(st.sampled_from(pool), min_size=2, max_size=8))
    parts: list[FmuPart | SeriesPart] = [
        FmuPart(f"p{k}", fmu(model), every=1 if plain else draw(st.sampled_from((1, 1, 1, 2, 3))))
        for k, model in enumerate(models)
    ]
    if not plain and draw(st.booleans()):
        values = draw(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=6))
        held = draw(st.booleans())
        parts.append(
            SeriesPart(
                "record",
                np.linspace(0.0, 0.05, len(values)),
                {"a": values, "b": values[::-1]},
                {"a": "N", "b": "m/s"},
                interpolation="previous" if held else "linear",
                beyond="hold",
            )
        )
    outputs = [(part, port) for part in parts for port in part.outputs]
    wires, start = [], {}
    for part in parts:
        for port in part.inputs:
            fitting = [
                (other, source)
                for other, source in outputs
                if source.type == port.type
                and (source.unit or port.unit is None)
                and units_agree(source.unit, source.base, port.unit, port.base) is not False
            ]
            name = f"{part.name}.{port.name}"
            if fitting and draw(st.integers(0, 3)) > 0:
                other, source = draw(st.sampled_from(fitting))
                real = port.type == "Real"
                # the master solves loops between parts that move; a connection back through others needs a delay
                solved = part.moves and other.moves and real
                back = not solved and parts.index(other) >= parts.index(part)
                if plain and back:
                    start[name] = 0.0 if real else bool(port.start)
                    continue
                if plain:
                    wires.append(Wire(f"{other.name}.{source.name}", name))
                    continue
                wires.append(
                    Wire(
                        f"{other.name}.{source.name}",
                        name,
                        gain=draw(st.sampled_from((1.0, 1.0, 0.5, -0.1))) if real else 1.0,
                        offset=draw(st.sampled_from((0.0, 0.0, 0.01))) if real else 0.0,
                        delay=draw(st.sampled_from((1, 2) if back else (0, 0, 0, 1, 3))),
                    )
                )
            elif port.type == "Real":
                start[name] = draw(st.sampled_from((0.0, 0.01, 1.0, -0.3)))
            else:
                start[name] = bool(port.start)
        if isinstance(part, FmuPart):
            sample_time = [port.name for port in part.parameters if port.name == "Ts"]
            start |= {f"{part.name}.{name}": part.every * step for name in sample_time}
    return System(parts, wires, start, Experiment(stop=50 * step, step=step), name="random")


def equal_or_both_fail(system: System, path: Path, every: int) -> None:
    """Compare a system in the harness with its composite FMU; errors of a run must occur in both."""
    assert system.experiment is not None
    step = system.experiment.step
    compare(system, path, 48 * step, every * step, every)
    if step == BINARY_STEP and not any(wire.delay for wire in system.wires):  # delays count steps
        compare(system, path, 48 * step, 0.5 * step, 1, pieces=2)


def compare(system: System, path: Path, stop: float, step: float, every: int, pieces: int = 1) -> None:
    """Compare a composite FMU, run with `every` steps of the system or in `pieces` of one, with it."""
    try:
        expected = run_parts(system, stop)
    except HarnessError:
        expected = None
    try:
        found = run_composite(path, stop, step)
    except HarnessError as error:
        assert expected is None, error
        return
    assert expected is not None
    assert found
    assert differing({name: values[::pieces] for name, values in found.items()}, expected, every) == []


_NUMBERS = itertools.count()


def check_random_system(folder: Path, data: st.DataObject) -> None:
    """Draw a system and compare it with its composite; systems that the harness refuses are left out."""
    path = folder / f"random{next(_NUMBERS)}.fmu"
    try:
        system = data.draw(random_systems())
        system.to_fmu(path, name="random_system")
    except HarnessError:
        return
    with system:
        equal_or_both_fail(system, path, data.draw(st.sampled_from((1, 2, 3))))
    path.unlink()


def random_seed_settings(count: int) -> settings:
    """Settings for as many systems, each compiled once."""
    return settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=[*HealthCheck],
    )
