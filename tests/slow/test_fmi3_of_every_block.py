"""Every block and some composites in FMI 3.0: the numbers of FMI 2.0 bit for bit, and what fmpy says of them."""

from __future__ import annotations

import random
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import mkdtemp

import fmpy
import numpy as np
import pytest
from fmi3.slaves import check_adjoint, three
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmpy.validation import validate_fmu
from shell.selection import COMPOSITES, SHELL_BLOCKS, built
from thorough import some

from friction_fmus import catalogue
from harness import FmuPart

BLOCKS = (*catalogue(), *COMPOSITES)
_AMPLITUDE = {"m": 1e-3, "m/s": 5e-3, "m/s2": 0.5, "rad": 1e-3, "rad/s": 5e-3}


PROFILES = [(name, full) for full in (True, False) for name in BLOCKS]


@pytest.fixture(params=some(PROFILES, [(name, k % 2 == 0) for k, name in enumerate(BLOCKS[::8])]), ids=str)
def pair(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> tuple[Path, Path]:
    """The FMU of a block in both versions; that of FMI 3.0 with arrays and clocks, or as it is by default."""
    name, full = request.param
    return (built(name, mkdtemp()) if name in COMPOSITES else build_fmu(name)), three(name, full)


def signals(part: FmuPart, draw: random.Random) -> Iterator[list[float]]:
    """Random inputs by sample: sums of sines of typical size, holds, and flags."""
    rows = []
    for port in part.inputs:
        size = _AMPLITUDE.get(port.unit or "", 1.0) * draw.choice((0.1, 1.0, 10.0))
        rate, phase = draw.uniform(1.0, 100.0), draw.uniform(0.0, 6.0)
        base = 1.0 if port.name == "Fn" else 0.0
        flag = port.type == "Boolean"
        rows.append((base, size, rate, phase, flag, bool(port.start) if flag else False))
    for k in range(100):
        held = 40 <= k < 50
        yield [
            float(flag_start)
            if flag
            else base + (0.1 if base else 1.0) * size * np.sin(rate * 1e-3 * (40 if held else k) + phase)
            for base, size, rate, phase, flag, flag_start in rows
        ]


def trajectory(path: Path, seed: int) -> bytes:
    """All outputs and local variables after each of 100 steps."""
    part = FmuPart("part", path)
    ports = (*part.outputs, *part.observables)
    names = [port.name for port in ports if not port.name.startswith("event_indicators[")]
    u, y = np.zeros(len(part.inputs)), np.zeros(len(names))
    draw = random.Random(seed)
    rows = list(signals(part, draw))
    part.enter_initialisation(0.0, 1.0, None, {})
    calls = part.bind([port.name for port in part.inputs], names, u, y)
    order = np.argsort(names)
    out, t = [], 0.0
    for k, row in enumerate(rows):
        u[:] = row
        if k == 0:
            calls.set()
            calls.get()
            part.exit_initialisation()
        calls.set()
        h = draw.choice((1e-4, 1e-3, 1.7e-3))
        calls.step(t, h)
        t += h
        calls.get()
        out.append(y[order].tobytes())
    part.close()
    return b"".join(out)


@pytest.mark.parametrize("seed", some([1, 2, 3], [1]))
def test_co_simulation_gives_the_same_numbers(pair: tuple[Path, Path], seed: int) -> None:
    two, other = pair
    first = trajectory(two, seed + zlib.crc32(two.stem.encode()))
    assert first == trajectory(other, seed + zlib.crc32(two.stem.encode()))
    assert len({first[k : k + 8] for k in range(0, len(first), 8)}) > 2


def exchanged(path: Path, seed: int) -> bytes:
    """States, derivatives and indicators of 20 steps in model exchange; empty for an FMU without it."""
    own = fmpy.read_model_description(str(path))
    if own.modelExchange is None:
        return b""
    kind = FMU2Model if own.fmiVersion == "2.0" else FMU3Model
    states, events = own.numberOfContinuousStates, own.numberOfEventIndicators
    fmu = kind(
        guid=own.guid,
        unzipDirectory=fmpy.extract(str(path)),
        modelIdentifier=own.modelExchange.modelIdentifier,
        instanceName="one",
    )
    fmu.instantiate()
    if kind is FMU2Model:
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
    else:
        fmu.enterInitializationMode(startTime=0.0)
    fmu.exitInitializationMode()
    draw = random.Random(seed)
    real = ("Real", "Float64")
    inputs = [v.valueReference for v in own.modelVariables if v.causality == "input" and v.type in real]
    x, rates, left = ((np.ctypeslib.ctypes.c_double * max(n, 1))() for n in (states, states, events))
    rows: list[float] = []
    for k in range(20):
        fmu.newDiscreteStates() if kind is FMU2Model else fmu.updateDiscreteStates()
        fmu.enterContinuousTimeMode()
        fmu.setTime(1e-3 * k)
        if states:
            fmu.getContinuousStates(x, states)
            rows += x[:states]
            for i in range(states):
                x[i] += draw.uniform(-1e-6, 1e-6)
            fmu.setContinuousStates(x, states)
        values = [draw.uniform(0.5e-3, 1.5e-3) for _ in inputs]
        if inputs:
            fmu.setReal(inputs, values) if kind is FMU2Model else fmu.setFloat64(inputs, values)
        if states:
            (fmu.getDerivatives if kind is FMU2Model else fmu.getContinuousStateDerivatives)(rates, states)
            rows += rates[:states]
        if events:
            fmu.getEventIndicators(left, events)
            rows += left[:events]
        fmu.enterEventMode()
    fmu.terminate()
    fmu.freeInstance()
    return np.array(rows).tobytes()


def test_model_exchange_gives_the_same_numbers(pair: tuple[Path, Path]) -> None:
    seed = zlib.crc32(pair[0].stem.encode())
    assert exchanged(pair[0], seed) == exchanged(pair[1], seed)


def test_fmpy_finds_nothing_and_simulates_both_kinds(pair: tuple[Path, Path]) -> None:
    path = pair[1]
    assert validate_fmu(str(path)) == []
    kinds = ["CoSimulation"]
    if fmpy.read_model_description(str(path)).modelExchange is not None:
        kinds.append("ModelExchange")
    for kind in kinds:
        result = fmpy.simulate_fmu(str(path), stop_time=0.05, fmi_type=kind)
        for name in result.dtype.names:
            assert np.isfinite(result[name]).all(), (kind, name)


@pytest.mark.parametrize("name", some(tuple(catalogue()), SHELL_BLOCKS[:2]))
def test_adjoint_is_the_transpose_of_directional(name: str) -> None:
    check_adjoint(name)
