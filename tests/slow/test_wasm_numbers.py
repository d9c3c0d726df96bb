"""Every block as a WebAssembly module, in Node and Chromium, against its library for this machine."""

from __future__ import annotations

import gzip
import random
import subprocess
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import lief
import numpy as np
import pytest
from every_block.test_block_package import another_value
from lxml import etree
from shell.instance import Instance, Library, RefusedError, load, signals
from shell.selection import COMPOSITES, built
from thorough import nightly, some
from wasm.engines import CASES, ENGINES, NODE, in_node, run_in
from wasm.test_wasm_package import LARGEST

from friction_fmus import catalogue
from friction_fmus.export.targets import SourceFmu
from friction_fmus.export.targets.wasm.npm_package import WasmModel, class_script, first_import, wasm_model
from harness.compiling.toolchain import compiler, header_folder, source_folder
from harness.system.experiment import LOOP_TOLERANCE

NAMES = some((*catalogue(), *COMPOSITES), ("LuGre", "GMS", "PID", "SwitchMass", COMPOSITES[0]))
STEPS, PART = 300, 6
TOLERANCE = 1e-12

AMPLIFIED: Mapping[str, float] = {"SwitchMass": 1e-11, "stick_slip": LOOP_TOLERANCE}
"""Where a difference of rounding grows: at each instant of switching, and up to the tolerance of loops."""

ROUNDED = frozenset(
    (
        *("pow", "exp", "expm1", "exp2", "log", "log1p", "log2", "sin", "cos", "sincos", "tan", "atan", "atan2"),
        *("asin", "acos", "sinh", "cosh", "tanh", "asinh", "acosh", "cbrt", "hypot", "erf"),
    )
)
"""Functions that the C libraries round in different ways."""


@dataclass(frozen=True)
class Case:
    """A run: what JavaScript gets, and the rows of the library for this machine."""

    request: Mapping[str, Any]
    expected: np.ndarray


@cache
def module(fmu: Path) -> WasmModel:
    return wasm_model(SourceFmu(fmu.stem, fmu.read_bytes()))


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmus")
    found = {name: built(name, folder) for name in NAMES}
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(module, found.values()))
    return found


@pytest.fixture(scope="module")
def cases(fmus: Mapping[str, Path]) -> list[Case]:
    return [case(load(fmu), seed) for fmu in fmus.values() for seed in range(4)]


def case(library: Library, seed: int) -> Case:
    """Random parameters, inputs that ramp and hold with reversals, of linear or held inputs; a step of any size."""
    draw = random.Random(f"{library.identifier} {seed}")
    linear, composite = seed % 2 == 0, library.identifier in COMPOSITES
    step = 5e-4 if composite else 10.0 ** draw.uniform(-4.0, -2.0)
    inputs = motion(library, seed)
    outputs = library.names("output")
    for _ in range(1000):
        start = {} if composite or seed == 0 else parameters(library, draw)
        with Instance(library) as run:
            try:
                rows = native(run, start, inputs, outputs, step, linear=linear)
            except RefusedError:
                continue  # a relation between parameters, or a step that the block refuses
        options = {"step": step, "steps": STEPS, "inputs": inputs, "outputs": outputs}
        options["interpolation"] = "linear" if linear else "hold"
        return Case({"model": library.identifier, "start": start, "options": options}, rows)
    raise AssertionError(f"no valid parameters for {library.identifier}")


def parameters(library: Library, draw: random.Random) -> dict[str, float]:
    """Values of about a third of the parameters."""
    names = library.names("parameter")
    return {name: another_value(library, name, draw) for name in names if draw.random() < 0.3}


def motion(library: Library, seed: int) -> dict[str, list[float]]:
    """A value per row for each input: it moves to a random value, and stays there; Boolean ones jump."""
    knots = signals(library, seed, STEPS // (2 * PART) + 1)
    columns = {}
    for name in library.names("input"):
        values = [knots[0][name]]
        for before, after in pairwise(knots):
            rises = np.linspace(before[name], after[name], PART + 1)[1:].tolist()
            real = library.variables[name].type == "Real"
            values += [*(rises if real else [after[name]] * PART), *[after[name]] * PART]
        columns[name] = values
    return columns


def native(
    run: Instance,
    start: Mapping[str, float],
    inputs: Mapping[str, list[float]],
    outputs: list[str],
    step: float,
    *,
    linear: bool,
) -> np.ndarray:
    """The outputs at the start and at the end of each step."""
    run.setup()
    run.set(start)
    run.must("EnterInitializationMode")
    run.must("ExitInitializationMode")
    reals = [name for name in inputs if run.library.variables[name].type == "Real"]
    run.set({name: values[0] for name, values in inputs.items()})
    rows = [run.get(*outputs)]
    for k in range(STEPS):
        run.set({name: values[k] for name, values in inputs.items()})
        if linear and reals:
            assert run.input_derivatives({name: (inputs[name][k + 1] - inputs[name][k]) / step for name in reals}) == 0
        run.step(k * step, step)
        rows.append(run.get(*outputs))
    return np.array(rows)


def rounded(library: Library) -> set[str]:
    """The functions in `ROUNDED` that the block calls."""
    binary = lief.parse(str(library.binary))
    return {str(symbol.name) for symbol in binary.imported_symbols} & ROUNDED


def test_modules_need_nothing_and_are_small(fmus: Mapping[str, Path]) -> None:
    for name, fmu in fmus.items():
        found = module(fmu).module
        assert first_import(found) is None
        assert name in COMPOSITES or len(gzip.compress(found, 9)) <= LARGEST, name


@pytest.mark.parametrize("engine", ENGINES)
def test_a_module_computes_what_the_library_for_this_machine_computes(
    engine: str, fmus: Mapping[str, Path], cases: list[Case], tmp_path: Path
) -> None:
    scripts = [tmp_path / "class.js", *(tmp_path / f"{name}.js" for name in fmus)]
    for script, text in zip(scripts, (class_script(), *(module(fmu).script() for fmu in fmus.values())), strict=True):
        script.write_text(text)
    found = run_in(engine, scripts, [each.request for each in cases], tmp_path)
    errors: dict[str, float] = {}
    for each, rows in zip(cases, found, strict=True):
        name = each.request["model"]
        assert isinstance(rows, list), f"{name}: {rows}"
        apart = np.abs(np.array(rows).T - each.expected).max(axis=0)
        scale = np.abs(each.expected).max(axis=0)
        errors[name] = max(errors.get(name, 0.0), float((apart / np.where(scale > 0.0, scale, 1.0)).max()))
    differing = {name: error for name, error in sorted(errors.items()) if error > 0.0}
    print(f"{engine}: {len(errors) - len(differing)} of {len(errors)} with the same bits")
    for name, error in differing.items():
        functions = rounded(load(fmus[name]))
        print(f"{name}: {error:.1e} {', '.join(sorted(functions))}")
        assert functions, f"{name} differs by {error}, but calls no function that rounds in another way"
        assert error <= AMPLIFIED.get(name, TOLERANCE), f"{name}: {error}"


@pytest.mark.skipif(NODE is None, reason="node is not installed")
@nightly  # builds a C library first
@pytest.mark.parametrize("name", (*catalogue(), *COMPOSITES))
def test_a_program_with_the_same_math_library_has_the_same_bits(name: str, tmp_path: Path) -> None:
    """Nothing else differs: the same sources, compiled for this processor with zig's C library."""
    library = load(built(name, tmp_path))
    program = compiled_program(library, tmp_path)
    (tmp_path / "class.js").write_text(class_script())
    (tmp_path / "model.js").write_text(module(library.fmu).script())
    requests = [case(library, seed).request for seed in range(2)]
    found = in_node([tmp_path / "class.js", tmp_path / "model.js"], requests, tmp_path)
    for request, rows in zip(requests, found, strict=True):
        names, numbers = for_program(library, request)
        texts = [str(program), library.identifier, library.description.guid]
        run = subprocess.run(texts, input=numbers, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        printed = np.array([float.fromhex(text) for text in run.stdout.split()]).reshape(len(names), -1)
        outputs = request["options"]["outputs"]
        assert np.array_equal(printed, np.array([rows[outputs.index(each)] for each in names]))


def compiled_program(library: Library, folder: Path) -> Path:
    """`run.c` with the block, for x86-64 and linked with zig's C library, which no other one can replace."""
    sources = library.folder / "sources"
    xml = etree.parse(str(library.folder / "modelDescription.xml"))
    units = [str(file.get("name")) for file in xml.iterfind("CoSimulation/SourceFiles/File")]
    shell = [source_folder() / "wasm" / name for name in ("functions.c", "wasm.c")]
    program = folder / "program"
    command = [
        *compiler("x86_64-linux-musl"),
        "-static",
        "-w",
        "-std=c99",
        "-Os",
        "-ffp-contract=off",
        "-fno-math-errno",
    ]
    command += [
        "-DFMI2_OVERRIDE_FUNCTION_PREFIX",
        "-Dexp2=wasm_exp2",
        "-Dlog=wasm_log",
        "-isystem",
        str(header_folder()),
    ]
    command += ["-o", str(program), *units, *map(str, (*shell, CASES.with_name("run.c")))]
    subprocess.run(command, cwd=sources, check=True, capture_output=True)
    return program


def for_program(library: Library, request: Mapping[str, Any]) -> tuple[list[str], str]:
    """The outputs in the order of the program, and the numbers that it reads."""
    options, start = request["options"], request["start"]

    def type_of(name: str) -> int:
        return ("Real", "Integer", "Boolean").index(library.variables[name].type)

    def reference(name: str) -> int:
        return int(library.variables[name].valueReference)

    inputs, outputs = (sorted(options[key], key=type_of) for key in ("inputs", "outputs"))
    numbers: list[float] = [len(start)]
    for name, value in start.items():
        numbers += [type_of(name), reference(name), value]
    numbers += [options["step"], options["steps"] + 1, options["interpolation"] == "linear"]
    numbers += [sum(type_of(name) == k for name in some) for some in (inputs, outputs) for k in range(3)]
    numbers += [reference(name) for name in (*inputs, *outputs)]
    for name in inputs:
        numbers += options["inputs"][name]
    return outputs, " ".join(float(number).hex() for number in numbers)
