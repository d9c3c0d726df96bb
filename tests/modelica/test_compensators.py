"""The compensators: blocks that another compiler accepts, and external functions with the bits of the FMUs."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rumoca
from fmpy import read_model_description
from modelica.library import SHORT_STEPS, Library
from shell.instance import Instance, RefusedError, load
from thorough import landing, nightly

from friction_fmus import build
from friction_fmus.blocks.catalogue import catalogue, laws_folder, source_folder
from friction_fmus.codegen.emulation import samples
from friction_fmus.codegen.law_export import make_export
from friction_fmus.lawkit.declarations import BOOLEANS, PARAMETERS, VECTORS, Kind
from friction_fmus.lawkit.law import Law, discover_laws
from harness.compiling import toolchain

PAGE = Path(__file__).parents[2] / "docs" / "modelica.md"
LAWS = {law.name: law for law in discover_laws(laws_folder())}
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")
COMPILER = ["gcc"] if shutil.which("gcc") else toolchain.compiler()
SAMPLES = 500
UTILITIES = "void ModelicaError(const char *string);\n"
FAILS = "void ModelicaError(const char *string) { (void)string; abort(); }\n"


@dataclass(frozen=True)
class External:
    """An external function, as section 12.9 of the Modelica specification maps its declaration to C."""

    name: str
    result: str
    """C types of the result and, by name, of the arguments."""
    arguments: Mapping[str, str]
    sizes: Mapping[str, int]  # lengths of vectors

    @property
    def pointer(self) -> str:
        """Declaration of a pointer to it."""
        return f"{self.result}(*const to_{self.name})({', '.join(self.arguments.values()) or 'void'})"

    def load(self, library: ctypes.CDLL) -> Callable[..., Any]:
        """The function in a library that has this pointer."""
        types = [TYPES[kind] for kind in (self.result, *self.arguments.values())]
        address = ctypes.c_void_p.in_dll(library, f"to_{self.name}").value
        return ctypes.CFUNCTYPE(*types)(address)


SCALARS = {"Real": "double ", "Integer": "int ", "Boolean": "int "}
TYPES: Mapping[str, Any] = {
    **{"double ": ctypes.c_double, "int ": ctypes.c_int, "void *": ctypes.c_void_p, "void ": None},
    **{"double *": ctypes.POINTER(ctypes.c_double), "int *": ctypes.POINTER(ctypes.c_int)},
    "const double *": ctypes.POINTER(ctypes.c_double),
}


def external_functions(block: str) -> dict[str, External]:
    """The external functions of a block by their names in Modelica."""
    found = {}
    for name, body in re.findall(r"^ *impure function (\w+)(.*?)^ *end \1;", block, re.M | re.S):
        declared = re.findall(r"^ *(input|output) (\w+) ('?\w+'?)(?:\[(\d+)\])?;$", body, re.M)
        result, function, listed = re.findall(r'external "C" (?:(\w+) = )?(\w+)\((.*?)\) annotation', body, re.S)[0]
        types = {}
        for direction, kind, variable, size in declared:
            plain = SCALARS.get(kind, "void *")  # an external object
            pointer = plain.replace(" ", " *") if size or (direction == "output" and variable != result) else plain
            types[variable] = f"const {pointer}" if size else pointer
        returned = types.pop(result) if result else "void "
        order = [argument.strip() for argument in listed.split(",") if argument.strip()]
        assert sorted(order) == sorted(types)
        sizes = {variable.strip("'"): int(size) for _, _, variable, size in declared if size}
        found[name] = External(function, returned, {v.strip("'"): types[v] for v in order}, sizes)
    return found


@pytest.fixture(scope="module")
def blocks(whole_library: Library) -> dict[str, str]:
    folder = Path(whole_library.roots[0]) / "Compensators"
    return {name: (folder / f"{name}.mo").read_text(encoding="utf-8") for name in LAWS}


@pytest.fixture(scope="module")
def compiled(
    whole_library: Library, blocks: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[ctypes.CDLL]:
    """All laws in one library, each included twice in each of two C files, with a pointer of the expected type."""
    folder = tmp_path_factory.mktemp("compensators")
    (folder / "ModelicaUtilities.h").write_text(UTILITIES)
    included = "".join(f'#include "FrictionFMUs_{name}.h"\n' for name in blocks)
    functions = [function for block in blocks.values() for function in external_functions(block).values()]
    for file in ("one", "two"):
        pointers = "".join(f"extern {function.pointer};\n" for function in functions)
        pointers += "".join(f"{function.pointer} = {function.name};\n" for function in functions)
        text = included + included + (pointers + FAILS if file == "one" else pointers.replace("to_", "also_"))
        (folder / f"{file}.c").write_text(text)
    include = Path(whole_library.roots[0]) / "Resources" / "Include"
    command = [*COMPILER, *STRICT, "-O1", "-shared", "-fPIC", f"-I{folder}", f"-I{include}", "one.c", "two.c"]
    subprocess.run([*command, "-o", "laws.so", "-lm"], cwd=folder, check=True)
    yield ctypes.CDLL(str(folder / "laws.so"))


def changed(law: Law, factor: float, *, flip: bool) -> dict[str, tuple[float, ...]]:
    """Values of the parameters away from their start values, as far as their ranges and relations allow."""
    values: dict[str, tuple[float, ...]] = {v.name: v.starts for v in law.select(*PARAMETERS)}
    for v in law.select(*PARAMETERS):
        moved = tuple(min(max(factor * start + 0.01 * (v.min < 0.0), v.min), v.max) for start in v.starts)
        other = tuple(1.0 - start for start in v.starts) if flip else v.starts
        new = {**values, v.name: other if v.kind in BOOLEANS else moved}
        values = values if law.conditions.violated(shaped(law, new)) else new
    return values


def shaped(law: Law, values: Mapping[str, tuple[float, ...]]) -> dict[str, Any]:
    return {v.name: values[v.name] if v.kind in VECTORS else values[v.name][0] for v in law.select(*PARAMETERS)}


def scalars(law: Law, values: Mapping[str, tuple[float, ...]], *, fixed: bool = True) -> dict[str, float]:
    """The same as variables of the FMU."""
    found: dict[str, float] = {}
    for v in law.select(*PARAMETERS):
        if v.kind in VECTORS:
            found |= {f"{v.name}[{i}]": value for i, value in enumerate(values[v.name], 1)}
        elif fixed or v.kind is not Kind.SAMPLE_TIME:
            found[v.name] = values[v.name][0]
    return found


class Object:
    """An external object with the parameters of its block."""

    def __init__(self, functions: Mapping[str, External], library: ctypes.CDLL, values: Mapping[str, Any]) -> None:
        self._step, self._free = functions["step"], functions["destructor"].load(library)
        self._call = self._step.load(library)
        self.memory, self.values = functions["constructor"].load(library)(), dict(values)

    def step(self, clock: float, inputs: Mapping[str, float]) -> tuple[int, dict[str, float]]:
        """The violated rule and the outputs of a sample."""
        given = {"memory": self.memory, "clock": clock, **self.values, **inputs}
        arguments, outputs = [], {}
        for name, kind in self._step.arguments.items():
            if name in self._step.sizes:
                arguments.append((ctypes.c_double * self._step.sizes[name])(*given[name]))
            elif kind.endswith("*") and name != "memory":
                outputs[name] = (ctypes.c_int if "int" in kind else ctypes.c_double)(-7)
                arguments.append(ctypes.byref(outputs[name]))
            else:
                arguments.append(int(given[name]) if kind == "int " else given[name])
        violated = self._call(*arguments)
        return violated, {name: float(value.value) for name, value in outputs.items()}

    def free(self) -> None:
        self._free(self.memory)


@landing
@pytest.mark.parametrize("name", LAWS)
def test_outputs_have_the_bits_of_the_fmu(
    name: str, blocks: dict[str, str], compiled: ctypes.CDLL, build_fmu: Callable[..., Path]
) -> None:
    """Two instances in turn, over changes of parameters, an input that is not finite, and repeated samples."""
    law, functions = LAWS[name], external_functions(blocks[name])
    given = samples(make_export(name), SAMPLES, seed=7)
    first = law.select(Kind.INPUT, Kind.OPTIONAL)[0].name
    given[first][SAMPLES // 4 : SAMPLES // 4 + 2] = np.nan
    sets = [changed(law, 1.1, flip=False), changed(law, 0.9, flip=True)]
    later = [changed(law, 1.2, flip=True), changed(law, 0.8, flip=False)]
    library = load(build_fmu(name))
    pairs = [(Instance(library), Object(functions, compiled, shaped(law, values))) for values in sets]
    outputs = library.names("output")
    for k in range(SAMPLES):
        for number, (fmu, block) in enumerate(pairs):
            inputs = {v: float(column[k if number else -k]) for v, column in given.items()}
            Ts = sets[number]["Ts"][0]
            if k == 0:
                fmu.initialise(**scalars(law, sets[number]), **inputs)
                block.step(0.0, {v: value + 0.5 * (v == first) for v, value in inputs.items()})  # an iteration
                assert block.step(0.0, inputs) == (0, dict(zip(outputs, fmu.get(*outputs), strict=True)))
            if k == SAMPLES // 2:
                fmu.set(scalars(law, later[number], fixed=False))
                block.values = {**shaped(law, later[number]), "Ts": Ts}
            fmu.set(inputs)
            fmu.step(k * Ts, Ts)
            assert block.step(k * Ts, inputs) == (0, dict(zip(outputs, fmu.get(*outputs), strict=True)))
    for fmu, block in pairs:
        fmu.free()
        block.free()


def test_every_law_is_a_block_and_every_other_controller_has_a_reason(
    blocks: dict[str, str], whole_library: Library
) -> None:
    order = (Path(whole_library.roots[0]) / "Compensators" / "package.order").read_text().split()
    assert order == [*sorted(LAWS), "Rotational"]
    reasons = re.findall(r"^\| (\w+) \| .+ \|$", PAGE.read_text().split("<!-- compensators in C -->")[1], re.M)
    others = {file.stem for file in (source_folder() / "controllers").glob("*.c")}
    assert {name for name in reasons if name in catalogue()} == others
    rotational = (Path(whole_library.roots[0]) / "Compensators" / "Rotational.mo").read_text()
    assert re.findall(r"block (\w+) = Compensators\.(\w+)\(", rotational) == [(name, name) for name in sorted(LAWS)]


@pytest.mark.parametrize("name", LAWS)
def test_variables_are_those_of_the_fmu(name: str, blocks: dict[str, str], build_fmu: Callable[..., Path]) -> None:
    """Names, start values, units, ranges and descriptions in the description of the FMU."""
    code = re.sub(r"\n    annotation", " annotation", blocks[name].split("protected")[0])
    lines = dict(re.findall(r"^  (?:parameter )?[\w.]+ '?(\w+)'?(.*)$", code, re.M))
    uses = {name: lines.pop(name) for name in [*lines] if re.match("use[A-Z]", name)}
    del lines["Modelica"]  # extends
    seen = set()
    for v in read_model_description(str(build_fmu(name))).modelVariables:
        if v.causality in ("local", "independent"):
            continue
        name, _, index = v.name.partition("[")
        line, each, optional = lines[name], "each " if index else "", v.description.startswith("optional: ")
        seen.add(name)
        assert f' "{v.description.removeprefix("optional: ")}"' in line
        assert (f'{each}unit = "{v.unit}"' in line) == (v.unit is not None)
        limits = {end: float(limit) for end, limit in (("min", v.min), ("max", v.max)) if limit is not None}
        found = dict(re.findall(rf"\b{each}(min|max) = ([\w.+-]+)", line))
        assert {end: float(limit) for end, limit in found.items()} == limits
        assert (f" if use{name[0].upper()}{name[1:]} " in line) == optional
        if optional:
            start = re.findall('it is (.*?)"', uses.pop(f"use{name[0].upper()}{name[1:]}"))
        elif v.causality == "parameter":
            start = re.findall(r" = (?:\{(.*?)\}|([^ ]+)) \"", line)[0]
            start = start[0].split(", ")[int(index[:-1]) - 1 :] if index else start[1:]
        else:
            continue
        assert start[0] == v.start if v.type == "Boolean" else float(start[0]) == float(v.start)
    assert seen == set(lines)
    assert not uses


@pytest.mark.parametrize(
    "name", [name if name == "GMSFeedforward" else pytest.param(name, marks=nightly) for name in LAWS]
)
def test_rotational_units_are_those_of_the_fmu(
    name: str, whole_library: Library, build_fmu: Callable[..., Path], tmp_path: Path
) -> None:
    text = (Path(whole_library.roots[0]) / "Compensators" / "Rotational.mo").read_text(encoding="utf-8")
    modified, summary = re.findall(rf'block {name} = Compensators.{name}\((.*?)\) "([^"]*)";\n', text, re.S)[0]
    found = re.findall(r"'?(\w+)'?\((?:each\s+)?unit\s+=\s+\"([^\"]+)\"\)", modified)
    files = build_fmu(name), build(name, tmp_path, domain="rotational")
    linear, rotary = ({v.name: v for v in read_model_description(str(file)).modelVariables} for file in files)
    changed = {v: each.unit for v, each in rotary.items() if each.unit != linear[v].unit and each.causality != "local"}
    assert dict(found) == {v.partition("[")[0]: unit for v, unit in changed.items()}
    assert str(read_model_description(str(files[1])).description).startswith(f"{summary} (")


@pytest.mark.parametrize("name", LAWS)
def test_each_rule_has_its_sentence(name: str, blocks: dict[str, str], whole_library: Library) -> None:
    """The numbers of the rules in the header are those of the assertions."""
    include = Path(whole_library.roots[0]) / "Resources" / "Include"
    header = (include / f"FrictionFMUs_{name}.h").read_text(encoding="utf-8").split("the first violated rule:")[1]
    rules = dict(re.findall(r"^ +(\d+): (.*?)(?: \*/)?$", header.split("int32_t")[0], re.M))
    relations = {number: text for number, text in rules.items() if not re.match(r"'?\w+ is finite", text)}
    block = blocks[name]
    sentences = re.findall(r'assert\(violated <> (\d+), "The parameters must satisfy (.*)"\);', block)
    assert dict(sentences) == relations
    ranges = re.findall(r"assert\(violated < 1 or violated > (\d+), ", block)
    assert ranges == [str(len(rules) - len(relations))]


COULOMB = """    violated = if u_min <= u_max then 0 else {number};
    F_hat = Fc*sign(rd);
    u = if enable_ then min(max(m*rdd + gain*F_hat, u_min), u_max) else 0;
    u_sat = 0;
    fault = false;
"""


@pytest.fixture(scope="module")
def in_modelica(blocks: dict[str, str]) -> str:
    """CoulombFeedforward with its equations in place of the external function, which rumoca does not call."""
    text = blocks["CoulombFeedforward"].split("\n", 1)[1]
    text = re.sub(r"^  Memory memory.*?^  end step;\n", "", text, flags=re.M | re.S)
    number = re.findall(r"violated <> (\d+)", text)[0]
    return re.sub(r"^    \(violated, .*?\);\n", COULOMB.format(number=number), text, flags=re.M | re.S)


TEST = """model Test
{block}
  CoulombFeedforward law({parameters});
  Real y, p(start = 1, fixed = true), q(start = 0, fixed = true);
equation
  law.rd = cos(time);
  law.rdd = sin(time);
  y = law.u;
  der(p) = 20*q;
  der(q) = -20*p;
{more}end Test;"""


def test_the_block_samples_and_holds(in_modelica: str, library: Library) -> None:
    more = "  law.enable = time < 1.25;\n"
    values = "Ts = 0.1, m = 2, Fc = 0.5, useEnable = true, gain = 0.5"
    result = library.run(TEST.format(block=in_modelica, parameters=values, more=more), 2.0, 0.025)
    t, y = np.array(result.time), np.array(result["y"])
    between = np.abs(t / 0.1 - np.round(t / 0.1)) > 0.1
    sample = 0.1 * np.floor(t / 0.1)
    expected = 2.0 * np.sin(sample) + 0.5 * 0.5 * np.sign(np.cos(sample))
    assert y[between] == pytest.approx(np.where(sample < 1.25, expected, 0.0)[between], abs=1e-9)
    assert np.count_nonzero(between) > 50


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ("Fc = -1", "Fc = -1 is outside [0, inf]"),
        ("gain = 1.5", "gain = 1.5 is outside [0, 1]"),
        ("u_min = 2, u_max = 1", "The parameters must satisfy u_min <= u_max"),
    ],
)
def test_parameters_are_refused_with_the_sentence_of_the_fmu(
    values: str, sentence: str, in_modelica: str, library: Library, build_fmu: Callable[..., Path]
) -> None:
    with pytest.raises(rumoca.SimulationError, match=re.escape(sentence)):
        library.run(TEST.format(block=in_modelica, parameters=values, more=""), 1.0, 0.1)
    with Instance(load(build_fmu("CoulombFeedforward"))) as fmu, pytest.raises(RefusedError) as caught:
        fmu.initialise(**{name: float(value) for name, value in re.findall(r"(\w+) = ([\w.-]+)", values)})
    assert sentence.removeprefix("The parameters ") in str(caught.value)


def test_the_library_is_valid(whole_library: Library) -> None:
    """A compiler parses every file without a remark and finds all names."""
    for file in Path(whole_library.roots[0]).rglob("*.mo"):
        assert not rumoca.validate_source(file.read_text(encoding="utf-8")), file
    with pytest.raises(rumoca.CompileError, match=r"`Memory\.memory` has unsupported type `Memory`"):
        whole_library.model("model Test extends FrictionFMUs.Examples.FrictionCompensation; end Test;")


FEEDFORWARD = """within FrictionFMUs.Compensators;
block LuGreFeedforward "The equations of the documentation"
  parameter Real sigma0 = 1e5, sigma1 = sqrt(1e5), sigma2 = 0.4, Fc = 1, Fs = 1.5, vs = 1e-3, m = 1, Ts = 1e-3;
  Modelica.Blocks.Interfaces.RealInput r, rd, rdd;
  Modelica.Blocks.Interfaces.RealOutput u;
protected
  Real z(start = 0, fixed = true), last(start = 0, fixed = true), g, steady, dr;
equation
  when {initial(), sample(0, Ts)} then
    dr = r - pre(last);
    last = r;
    g = Interfaces.stribeck(dr/Ts, Fc, Fs, vs, 2);
    z = sign(dr)*g/sigma0 + (pre(z) - sign(dr)*g/sigma0)*exp(-sigma0*abs(dr)/g);
    steady = Interfaces.stribeck(rd, Fc, Fs, vs, 2);
    u = m*rdd + sigma0*z + sigma1*(rd - sigma0*abs(rd)*z/steady) + sigma2*rd;
  end when;
end LuGreFeedforward;
"""


@landing
def test_the_example_tracks_better(whole_library: Library, tmp_path: Path) -> None:
    shutil.copytree(whole_library.roots[0], tmp_path / "FrictionFMUs")
    (tmp_path / "FrictionFMUs" / "Compensators" / "LuGreFeedforward.mo").write_text(FEEDFORWARD)
    peaks = {}
    for name in ("ServoReversal", "FrictionCompensation"):
        model = f"model Test extends FrictionFMUs.Examples.{name};\n{SHORT_STEPS}end Test;"
        result = Library(tmp_path / "FrictionFMUs").run(model, 2.0, 1e-3, 1e-7)
        peaks[name] = np.max(np.abs(np.array(result["e"])[np.array(result.time) > 0.4]))
    assert peaks["ServoReversal"] > 3e-4
    assert peaks["FrictionCompensation"] < 3e-6


PROGRAM = """{included}{fails}
int main(void)
{{
{body}    return 0;
}}
"""


@landing
def test_memory_is_freed(whole_library: Library, blocks: dict[str, str], tmp_path: Path) -> None:
    """Three objects of each law, two of them stepped, under the sanitizer of addresses and leaks."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is not installed")
    body = "    double y;\n    int flag;\n"
    for name, block in blocks.items():
        new, free, step = (external_functions(block)[each] for each in ("constructor", "destructor", "step"))
        values = shaped(LAWS[name], {v.name: v.starts for v in LAWS[name].select(*PARAMETERS)})
        places = {"void *": "memory", "double *": "&y", "int *": "&flag"} | {"double ": "0.0", "int ": "1"}
        arguments = [{"clock": "k"}.get(each, places.get(kind, each)) for each, kind in step.arguments.items()]
        for each, value in values.items():
            if each in step.sizes:
                body += f"    const double {name}_{each}[] = {{{', '.join(map(repr, value))}}};\n"
            arguments[[*step.arguments].index(each)] = f"{name}_{each}" if each in step.sizes else repr(float(value))
        body += f"    for (int i = 0; i < 3; i++) {{\n        void *memory = {new.name}();\n"
        body += f"        for (int k = 0; k < 5 * i; k++) {step.name}({', '.join(arguments)});\n"
        body += f"        {free.name}(memory);\n    }}\n"
    included = "".join(f'#include "FrictionFMUs_{name}.h"\n' for name in blocks)
    (tmp_path / "ModelicaUtilities.h").write_text(UTILITIES)
    (tmp_path / "main.c").write_text(PROGRAM.format(included=included, fails=FAILS, body=body))
    include = Path(whole_library.roots[0]) / "Resources" / "Include"
    flags = ("-std=c99", "-fsanitize=address,undefined", "-fno-sanitize-recover", f"-I{tmp_path}", f"-I{include}")
    subprocess.run(["gcc", *flags, "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    subprocess.run([tmp_path / "main"], check=True, timeout=60)
