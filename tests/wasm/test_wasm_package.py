"""The npm package of a module: its files, types and README, and the JavaScript class in Node and Chromium."""

from __future__ import annotations

import gzip
import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from fmpy import read_model_description
from thorough import landing, nightly, some
from wasm.engines import ENGINES, node, run_in

from friction_fmus import build, fmu
from friction_fmus.cli.inputs import open_system
from friction_fmus.cli.main import main
from friction_fmus.export.block_fmu import block_source
from friction_fmus.export.targets.wasm.npm_package import class_script, first_import, wasm_model
from harness.errors import BuildError, OutputError

EXAMPLES = Path(__file__).parents[2] / "examples"
LARGEST = 25 * 1024
"""Bytes that a block's module may have when it is compressed."""

pytestmark = landing
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("GMS", tmp_path_factory.mktemp("packages"), platforms=("wasm32",))


def in_package(package: Path, program: str) -> Any:
    """What a program prints as JSON; it has `load`, the `model` and `thrown(f)`, the error of a function."""
    return json.loads(
        node(
            f"""
            const {{ load, description, FmuError }} = await import({json.dumps((package / "index.js").as_uri())});
            const model = await load();
            const thrown = (f) => {{
              try {{ f(); }} catch ({{ name, message }}) {{ return `${{name}}: ${{message}}`; }}
            }};
            const print = (value) => console.log(JSON.stringify(value));
            {program}
            """
        )
    )


# ---- files


def test_the_command_writes_a_folder_and_prints_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", "LuGre", "--platform", "wasm32", "-o", str(tmp_path)]) == 0
    folder = tmp_path / "LuGre-wasm"
    assert capsys.readouterr().out == f"{folder}\n"
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        (
            *("LuGre.json", "LuGre.script.js", "LuGre.wasm", "README.md", "index.d.ts", "index.js"),
            *("model.d.ts", "model.js", "package.json"),
        )
    )
    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    build("LuGre", tmp_path, platforms=("wasm32",))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == first
    assert [path.name for path in tmp_path.iterdir()] == ["LuGre-wasm"]


def test_a_module_needs_nothing_and_is_small() -> None:
    module = wasm_model(block_source("ElastoPlastic")).module  # one of the largest
    assert first_import(module) is None
    assert len(gzip.compress(module, 9)) <= LARGEST


def test_an_import_is_read_from_a_module() -> None:
    """Two imports after a type section, as in the specification: env.f, a function, and env.m, a memory of 1 to 2."""
    text = b"\x02\x03env\x01f\x00\x00\x03env\x01m\x02\x01\x01\x02"
    module = b"\0asm\x01\0\0\0" + b"\x01\x04\x01\x60\0\0" + bytes([2, len(text)]) + text
    assert first_import(module) == "env.f"


def test_the_description_is_that_of_the_xml(package: Path) -> None:
    found = json.loads((package / "GMS.json").read_text())
    xml = read_model_description(str(fmu("GMS")))
    assert [v["name"] for v in found["variables"]] == [v.name for v in xml.modelVariables]
    for v, expected in zip(found["variables"], xml.modelVariables, strict=True):
        assert (v["type"], v["reference"], v["causality"]) == (
            expected.type,
            expected.valueReference,
            expected.causality,
        )
        unit = expected.unit or (expected.declaredType.unit if expected.declaredType else None)
        assert v.get("unit") == unit
        for key in ("min", "max"):
            text = getattr(expected, key)
            assert v.get(key) == (None if text is None else float(text))
    assert found["guid"] == xml.guid
    assert found["arrays"]["k"] == [f"k[{i}]" for i in range(1, 11)]


@pytest.mark.parametrize(
    ("platforms", "fmi", "message"),
    [
        (("wasm32", "win64"), 2, "the platform wasm32 makes an npm package, not an FMU: build it without other plat"),
        (("wasm32",), 3, "the platform wasm32 makes an npm package: build it without fmi3"),
    ],
)
def test_other_platforms_and_fmi_3_are_refused(
    tmp_path: Path, platforms: tuple[str, ...], fmi: Any, message: str
) -> None:
    with pytest.raises(BuildError, match=message):
        build("LuGre", tmp_path, platforms=platforms, fmi=fmi)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "LuGre-wasm").mkdir()
    (tmp_path / "LuGre-wasm" / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputError, match="exists and is not a package of this command: give another folder"):
        build("LuGre", tmp_path, platforms=("wasm32",))
    assert (tmp_path / "LuGre-wasm" / "thesis.tex").read_text() == "years of work"


def test_a_block_that_needs_an_operating_system_is_refused(tmp_path: Path) -> None:
    block = tmp_path / "Noisy.c"
    block.write_text(
        '#define MODEL Noisy\n#define VARIABLES INPUT(u, NO_UNIT, 0.0, "u") OUTPUT(y, NO_UNIT, "y")\n'
        "#include <stdio.h>\n#include <stdlib.h>\n"
        '#include "block.h"\n'
        'static void equations(Model *m) { if (m->u > 1.0) puts(getenv("HOME")); m->y = m->u; }\n'
    )
    with pytest.raises(BuildError, match=r"Noisy needs wasi_.* of an operating system"):
        build(block, tmp_path / "out", platforms=("wasm32",))


@nightly
@pytest.mark.skipif(shutil.which("tsc") is None, reason="tsc is not installed")
def test_typescript_accepts_the_types_and_rejects_wrong_names(package: Path, tmp_path: Path) -> None:
    good = """
        import { load, Block, FmuError } from "./GMS-wasm/index.js";
        const model = await load();
        const block: Block = model.instantiate({ N: 3, k: [1, 2, 3], "k[2]": 5 }, { tolerance: 1e-6 });
        block.set("v", 0.1);
        block.set({ v: 0.1, Fs: 2 });
        const F: number = block.get("F"), k: number[] = block.get("k"), moving: boolean = block.get("slipping[1]");
        const rows: Float64Array = block.run({ inputs: { v: (t) => Math.sin(t) }, steps: 10, outputs: ["F"] }).F;
        block.restore(block.save());
        try {
            block.step(-1);
        } catch (error) {
            if (error instanceof FmuError) console.log(error.status, F, k, rows, moving);
        }
    """
    bad = ['block.get("sigma9");', 'block.set("v", true);', 'block.set("F", 1);', "block.run({ inputs: { F: 1 } });"]
    shutil.copytree(package, tmp_path / "GMS-wasm")
    file = tmp_path / "program.mts"
    command = [str(shutil.which("tsc")), "--noEmit", "--strict", "--target", "es2022", "--module", "node16", str(file)]
    file.write_text(good)
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    file.write_text(good + "\n".join(bad))
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.stdout.count("error TS") == len(bad), run.stdout


# ---- the class


@needs_node
def test_values_steps_and_states(package: Path) -> None:
    found = in_package(
        package,
        """
        const block = model.instantiate({ N: 2, k: [5e4, 3e4], sigma2: 0.5 }, { startTime: 1 });
        const before = [block.time, block.get("N"), block.get("k").slice(0, 3), block.get("slipping[1]")];
        block.set({ v: 0.01 });
        const state = block.save();
        block.step(1e-3);
        const after = [block.time, block.get("F")];
        block.step(1e-3);
        block.restore(state);
        block.step(1e-3);
        const again = [block.time, block.get("F")];
        block.reset({ sigma2: 0.75 });
        print({ before, after, again, reset: [block.time, block.get("N"), block.get("sigma2"), block.get("v")] });
        """,
    )
    start = in_package(package, 'print(model.variables.get("k[3]").start)')
    assert found["before"] == [1, 2, [5e4, 3e4, start], False]
    assert found["after"] == found["again"]
    assert found["after"][0] == 1.001
    assert found["reset"] == [1, 2, 0.75, 0]


@nightly
@needs_node
def test_commands_and_program_of_the_page_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (EXAMPLES.parent / "docs" / "browser.md").read_text()
    (commands,), (program,) = (re.findall(rf"```{kind}\n(.*?)```", page, re.S) for kind in ("console", "js"))
    (tmp_path / "examples").symlink_to(EXAMPLES)
    monkeypatch.chdir(tmp_path)
    for command in commands.splitlines():
        assert main(shlex.split(command)[1:]) == 0
    assert (tmp_path / "web" / "stick_slip-wasm" / "stick_slip.wasm").is_file()
    rows, last, after = node(program.replace("./web/", (tmp_path / "web").as_uri() + "/")).split()
    assert int(rows) == 2001
    assert abs(float(last)) < 1.2
    assert float(after) != float(last)


@needs_node
def test_a_run_equals_its_steps(package: Path) -> None:
    found = in_package(
        package,
        """
        const v = Float64Array.from({ length: 101 }, (_, k) => 0.01 * Math.sin(0.2 * k));
        const options = { step: 1e-3, inputs: { v }, interpolation: "hold", outputs: ["F", "time"] };
        const run = model.instantiate().run(options);
        const block = model.instantiate(), F = [], time = [];
        for (let k = 0; k <= 100; k++) {
          if (k > 0) { block.set("v", v[k - 1]); block.step(1e-3); } else block.set("v", v[0]);
          F.push(block.get("F"));
        }
        const halves = model.instantiate();
        const first = halves.run({ step: 1e-3, inputs: { v: v.slice(0, 51) }, interpolation: "hold" }).F;
        const second = halves.run({ step: 1e-3, inputs: { v: v.slice(50) }, interpolation: "hold" }).F;
        const inputs = { v: (t) => t, Fn: 2 };
        const given = model.instantiate().run({ step: 1e-3, steps: 4, inputs, outputs: ["v", "Fn"] });
        print({ run: [...run.F], F, halves: [...first, ...second.slice(1)], names: Object.keys(run), end: run.time[100],
                given: [[...given.v], [...given.Fn]] });
        """,
    )
    assert found["run"] == found["F"] == found["halves"]
    assert found["names"] == ["time", "F"]
    assert found["end"] == 0.1
    assert found["given"][0] == pytest.approx([0.0, 1e-3, 2e-3, 3e-3, 4e-3], rel=1e-15)
    assert found["given"][1] == [2.0] * 5


@needs_node
def test_a_refused_call_says_why_and_changes_nothing(package: Path) -> None:
    found = in_package(
        package,
        """
        const block = model.instantiate({ N: 2 });
        block.run({ step: 1e-3, steps: 20, inputs: { v: 0.01 } });
        const all = () => JSON.stringify([block.time, description.variables.map(({ name }) => block.get(name))]);
        const before = all(), messages = {};
        for (const [name, call] of Object.entries({
          unknown: () => block.get("sigma9"),
          input: () => block.run({ steps: 1, inputs: { Fs: 1 } }),
          type: () => block.set("v", "fast"),
          whole: () => model.instantiate({ N: 2.5 }),
          limit: () => block.set({ v: 3, Fs: -1 }),
          fixed: () => block.set({ v: 3, N: 4 }),
          many: () => block.set("k", Array(11).fill(1)),
          array: () => block.set("k", 5),
          start_array: () => model.instantiate({ k: null }),
          big: () => block.set("v", 1n),
          object: () => block.run({ steps: 3, inputs: { v: {} } }),
          set: () => block.run({ steps: 3, inputs: { v: new Set([1, 2]) } }),
          null: () => block.run({ steps: 3, inputs: { v: null } }),
          rows_of_all: () => block.run({ steps: 1e12 }),
          nan: () => block.run({ inputs: { v: [1, 2, NaN, 3] } }),
          rows: () => block.run({ steps: 3, inputs: { v: [1, 2, 3] } }),
          none: () => block.run(),
          step: () => block.step(-1),
          text: () => block.step("0.001"),
          run_text: () => block.run({ steps: 1, step: "0.001" }),
          start: () => model.instantiate({}, { startTime: "1" }),
          inside: () => block.run({ steps: 1, inputs: { v: () => (block.step(1e-3), 0) } }),
          set_inside: () => block.run({ steps: 1, inputs: { v: () => (block.set("v", 1), 0) } }),
          run_inside: () => block.run({ steps: 1, inputs: { v: () => block.run({ steps: 1 }).F[1] } }),
          length: () => block.run({ steps: 1, step: 0 }),
          mode: () => block.run({ steps: 1, interpolation: "cubic" }),
          reset: () => block.reset({ Fs: -2 }),
          state: () => block.restore({ time: 0 }),
        })) messages[name] = [thrown(call), all() === before];
        block.dispose();
        messages.disposed = [thrown(() => block.get("v")), true];
        print(messages);
        """,
    )
    assert [name for name, (_, same) in found.items() if not same] == []
    expected = {
        "unknown": 'RangeError: GMS has no variable "sigma9": did you mean sigma, sigma2?',
        "input": "RangeError: Fs is not an input of GMS: known are v, Fn",
        "type": 'TypeError: v is "fast": give a number',
        "whole": "TypeError: N is 2.5: give a whole number",
        "limit": "FmuError: fmi2SetReal: Fs = -1 is outside [1e-09, inf]",
        "fixed": 'FmuError: fmi2SetInteger: N cannot be set in the mode "step complete"',
        "many": "RangeError: k has 10 elements: 11 are given",
        "array": "TypeError: k is 5: give an array",
        "start_array": "TypeError: k is null: give an array",
        "big": "TypeError: v is 1: give a number",
        "object": "RangeError: the input v has 0 values: 3 steps need 4",
        "set": "RangeError: the input v has 2 values: 3 steps need 4",
        "null": "TypeError: v is null: give a number",
        "rows_of_all": "RangeError: there is no memory for 1000000000001 rows: make several runs",
        "nan": "FmuError: fmi2SetRealInputDerivatives: the derivative nan of v is not finite",
        "rows": "RangeError: the input v has 3 values: 3 steps need 4",
        "none": "RangeError: the number of steps is undefined: give a whole number, or an input as an array with a "
        "value more",
        "step": "FmuError: fmi2DoStep: step size -1 at t = 0.02 s must be positive and finite",
        "text": 'TypeError: the step is "0.001": give a number of seconds',
        "run_text": 'TypeError: the step is "0.001": give a number of seconds',
        "start": 'TypeError: the start time is "1": give a number of seconds',
        **dict.fromkeys(
            ("inside", "set_inside", "run_inside"),
            "Error: an input function of run() may read the block, but not change it: use another block",
        ),
        "length": "RangeError: the step is 0 s: give a positive number of seconds",
        "mode": 'RangeError: the interpolation is "cubic": give "linear" or "hold"',
        "reset": "FmuError: fmi2SetReal: Fs = -2 is outside [1e-09, inf]",
        "state": "RangeError: the state is not from this block: give what its save() has returned",
        "disposed": "Error: this block of GMS has been disposed of: instantiate another",
    }
    assert {name: text for name, (text, _) in found.items()} == expected


@nightly
@pytest.mark.parametrize("engine", some(ENGINES, ENGINES[:1]))
def test_classic_scripts_run_without_network_under_a_strict_policy(engine: str, tmp_path: Path) -> None:
    """A composite too: the stick-slip of examples/, whose belt starts to pull."""
    (tmp_path / "class.js").write_text(class_script())
    with open_system(EXAMPLES / "stick_slip.toml", open_inputs=True) as system:
        system.to_fmu(tmp_path / "pulled-wasm", platforms=("wasm32",))
    script = tmp_path / "pulled-wasm" / "pulled.script.js"  # class and model in one file
    case = {"model": "pulled", "start": {}, "options": {"steps": 3, "outputs": ["time"]}}
    (found,) = run_in(engine, [script], [case], tmp_path)
    assert found == [[0.0, 0.001, 0.002, 0.003]]


def test_a_composite_cannot_be_written_to_the_path_of_an_fmu(tmp_path: Path) -> None:
    with (
        open_system(EXAMPLES / "stick_slip.toml", open_inputs=True) as system,
        pytest.raises(BuildError, match=r"makes a folder, but .*pulled\.fmu names an FMU: give pulled-wasm"),
    ):
        system.to_fmu(tmp_path / "pulled.fmu", platforms=("wasm32",))
