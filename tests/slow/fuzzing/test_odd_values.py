"""Odd values in every key of every file that is written by hand: a run, or one sentence with status 2."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from robustness.cases import run_cases
from thorough import nightly

from friction_fmus import build

DEEP = 10_000
EVERY = 1 if "ALL_ODD_VALUES" in os.environ else 83  # a prime: all keys have their turn
"""A test run tries a few of the 2000 system files, `tests/nightly.sh` all of them."""

ODD: dict[str, str] = {
    "true": "true",
    "zero": "0",
    "one": "1",
    "three": "3",
    "minus one": "-1",
    "minus zero": "-0.0",
    "half": "0.5",
    "small": "1e-6",
    "denormal": "1e-320",
    "huge": "1e300",
    "minus huge": "-1e300",
    "beyond float": "1e999",
    "inf": "inf",
    "minus inf": "-inf",
    "nan": "nan",
    "2^31": str(2**31),
    "2^32 + 1": str(2**32 + 1),
    "2^53 + 1": str(2**53 + 1),
    "2^63 - 1": str(2**63 - 1),
    "2^63": str(2**63),
    "-2^63": str(-(2**63)),
    "1000 digits": "9" * 1000,
    "5000 digits": "9" * 5000,
    "hexadecimal": "0x" + "f" * 5000,
    "empty text": '""',
    "blank": '" "',
    "name": '"LuGre"',
    "long text": '"' + "x" * 1_000_000 + '"',
    "text of 4000": '"' + "x" * 4000 + '"',
    "stars": '"' + "*a" * 40 + '"',
    "control characters": '"a\\u0000b"',
    "escape": '"\\u001b[31mred"',
    "lines": '"a\\nb"',
    "markup": '"[/b][x]{}%s%n"',
    "arrow": '"a.b -> c.d -> e.f"',
    "device": '"/dev/zero"',
    "folder": '"/"',
    "empty list": "[]",
    "list of a text": '["a"]',
    "list of a number": "[1]",
    "mixed list": '[1, "a", [2], {a = 1}, true]',
    "deep list": "[" * DEEP + "]" * DEEP,
    "list 60 deep": "[" * 60 + "]" * 60,
    "wide list": "[" + "1, " * 3000 + "]",
    "empty table": "{}",
    "table": '{ a = 1, "b c" = [2] }',
    "deep table": "{ a = " * DEEP + "1" + " }" * DEEP,
    "dotted table": "{ " + "a." * 100_000 + "a = 1 }",
    "date": "1979-05-27T07:32:00Z",
    "time": "07:32:00",
}


SYSTEM = """
name = {name}
wires = {wires}

[experiment]
{experiment}

{manipulators}

[parts.mass]
model = {mass}
every = {every}
start = {start}

[parts.friction]
fmu = {friction}

[parts.record]
record = {record}
interpolation = {interpolation}
beyond = {beyond}
{tail}
"""
WIRE = '["mass.v -> friction.v", "friction.F -> mass.F_friction", {{ wire = "record.F -> mass.F_drive", {} }}]'
GOOD = {
    "name": '"system"',
    "wires": WIRE.format("gain = 1.0"),
    "experiment": "stop = 0.01\nstep = 1e-3",
    "manipulators": "",
    "mass": '"Mass"',
    "every": "1",
    "start": "{ m = 1.0, k = 2.0, v_support = 0.1 }",
    "friction": '"LuGre.fmu"',
    "record": '"record.csv"',
    "interpolation": '"linear"',
    "beyond": '"hold"',
    "tail": "",
}
MANIPULATORS = {
    "override": {"value": "1.0"},
    "noise": {"sigma": "1.0", "seed": "1"},
    "drop-out": {"probability": "0.5", "seed": "1"},
    "delay": {"ticks": "2"},
}


def manipulator(kind: str, changes: dict[str, str]) -> str:
    values = {"kind": f'"{kind}"', "input": '"mass.F_drive"', "start": "0.002", "stop": "0.008", **MANIPULATORS[kind]}
    return "[[experiment.manipulators]]\n" + "\n".join(f"{key} = {value}" for key, value in (values | changes).items())


def systems() -> Iterator[tuple[str, str]]:
    """Label and text of each system file."""
    for odd, value in ODD.items():
        for key in ("name", "wires", "mass", "every", "start", "friction", "record"):
            yield f"{key} = {odd}", SYSTEM.format(**GOOD | {key: value})
        for key in ("interpolation", "beyond"):
            yield f"{key} = {odd}", SYSTEM.format(**GOOD | {key: value})
        for key in ("stop", "step", "start", "master", "record", "decimate", "tolerance", "order", "extrapolation"):
            given = {"stop": "0.01", "step": "1e-3"} | {key: value}
            lines = "\n".join(f"{name} = {text}" for name, text in given.items())
            yield f"experiment.{key} = {odd}", SYSTEM.format(**GOOD | {"experiment": lines})
        lines = f'stop = 0.01\nstep = 1e-3\nmaster = "jacobi"\nextrapolation = {value}'
        yield f"jacobi, extrapolation = {odd}", SYSTEM.format(**GOOD | {"experiment": lines})
        for key in ("gain", "offset", "delay", "wire"):
            text = WIRE.format(f"{key} = {value}")
            text = text.replace('wire = "record.F -> mass.F_drive", ', "") if key == "wire" else text
            yield f"wire.{key} = {odd}", SYSTEM.format(**GOOD | {"wires": text})
        yield f"wires = [{odd}]", SYSTEM.format(**GOOD | {"wires": f"[{value}]"})
        for key in ("m", "k", "F_friction", "none", "nonlinear"):
            yield f"start.{key} = {odd}", SYSTEM.format(**GOOD | {"start": f"{{ {key} = {value} }}"})
        for kind, own in MANIPULATORS.items():
            for key in (*own, "kind", "input", "start", "stop"):
                if kind == "override" or key in own:
                    text = manipulator(kind, {key: value})
                    yield f"{kind}.{key} = {odd}", SYSTEM.format(**GOOD | {"manipulators": text})
        yield f"manipulators = {odd}", SYSTEM.format(**GOOD | {"manipulators": f"manipulators = {value}"})
        for key in ("experiment", "parts", "parts.friction", "parts.x", "parts.mass.start", "unknown", '"a\\nb"'):
            yield f"{key} itself = {odd}", f"{key} = {value}\n" + SYSTEM.format(**GOOD)
            yield f"{key} alone = {odd}", f"wires = []\n{key} = {value}\n"
    for label, key in {"control": '"a\\u001bb"', "long": "x" * 100_000, "empty": '""', "lines": '"a\\nb"'}.items():
        for table in ("parts", "parts.mass", "parts.friction.start", "experiment", "unknown"):
            yield f"a key of {table}: {label}", SYSTEM.format(**GOOD | {"tail": f"[{table}.{key}]\nmodel = 'Mass'"})
    yield "a header with many parts", "[" + "a." * 100_000 + "a]\n"
    yield "a text that ends nowhere", 'name = """' + "x" * 100_000
    yield "too large", "# " + "x" * (1 << 23)


def test_system_files(tmp_path: Path) -> None:
    build("LuGre", tmp_path)
    (tmp_path / "record.csv").write_text("time [s],F [N]\n0,1\n2,1\n")
    cases = [(label, "odd.toml", text, ["run", "odd.toml", "-o", "out.csv"]) for label, text in systems()]
    assert len(cases) >= 2000
    cases = cases[::EVERY]
    counts = run_cases(tmp_path, cases)
    assert counts["runs"] > 0.05 * len(cases)  # the files are right but for the odd value
    assert counts["sentences"] > 0.5 * len(cases)


def test_sweeps_of_system_files(tmp_path: Path) -> None:
    build("LuGre", tmp_path)
    (tmp_path / "record.csv").write_text("time [s],F [N]\n0,1\n2,1\n")
    sweep = ["sweep", "odd.toml", "--vary", "mass.m=1,2", "--executor", "serial", "-o", "sweep"]
    cases = [(label, "odd.toml", text, sweep) for label, text in list(systems())[:: 9 * EVERY]]
    assert run_cases(tmp_path, cases)["sentences"] > 0.4 * len(cases)


STUDY = """
[data]
{data}

[columns]
time = {time}
position = {position}
force = {force}
{role}

[windows]
train = {train}
validation = {validation}

[servo]
{servo}

[identify]
models = {models}

[compensation]
{compensation}
{tail}
"""
STUDY_GOOD = {
    "data": 'file = "log.csv"',
    "time": '{ column = "t", unit = "s" }',
    "position": '{ column = "x", unit = "mm" }',
    "force": '{ column = "u", unit = "V", gain = "35.15 N/V", sign = -1 }',
    "role": "",
    "train": "[0.0, 1.0]",
    "validation": "[1.0, 2.0]",
    "servo": 'law = "PID"\nKp = 1e4\nKd = 100.0\nTs = 1e-3\nforce_limit = 50.0',
    "models": '["LuGre"]',
    "compensation": "",
    "tail": "",
}
SERVO = {"law": '"PID"', "Kp": "1e4", "Kd": "100.0", "Ts": "1e-3", "force_limit": "50.0"}


def studies() -> Iterator[tuple[str, str]]:
    """Label and text of each configuration of a study."""
    for odd, value in ODD.items():
        for key in ("time", "position", "force", "train", "validation", "models"):
            yield f"{key} = {odd}", STUDY.format(**STUDY_GOOD | {key: value})
        for key in ("column", "unit", "gain", "sign", "period"):
            entry = {"column": '"u"', "unit": '"V"'} | {key: value}
            text = "{ " + ", ".join(f"{name} = {item}" for name, item in entry.items()) + " }"
            yield f"force.{key} = {odd}", STUDY.format(**STUDY_GOOD | {"force": text})
            yield f"time.{key} = {odd}", STUDY.format(**STUDY_GOOD | {"time": text.replace('"V"', '"s"')})
        for key in ("law", "Kp", "Kd", "Ki", "Ts", "force_limit", "window", "quantum", "velocity_feedforward", "mass"):
            text = "\n".join(f"{name} = {item}" for name, item in (SERVO | {key: value}).items())
            yield f"servo.{key} = {odd}", STUDY.format(**STUDY_GOOD | {"servo": text})
        for key in ("compensators", "gains", "mismatch", "motion_feedforward", "duration", "unknown"):
            yield f"compensation.{key} = {odd}", STUDY.format(**STUDY_GOOD | {"compensation": f"{key} = {value}"})
        for key in ("file", "name", "citation", "record"):
            text = f"{key} = {value}" + ("" if key in ("file", "record") else '\nfile = "log.csv"')
            yield f"data.{key} = {odd}", STUDY.format(**STUDY_GOOD | {"data": text})
        for key in ("data", "columns", "windows", "servo", "identify", "unknown"):
            yield f"{key} itself = {odd}", f'{key} = {value}\n[compensation]\n[data2]\nfile = "log.csv"\n'
            yield f"{key} alone = {odd}", f'{key} = {value}\n[data]\nfile = "log.csv"\n' * (key != "data")
        yield f"window of = {odd}", STUDY.format(**STUDY_GOOD | {"train": f"[0.0, {value}]"})
        yield f"role = {odd}", STUDY.format(**STUDY_GOOD | {"role": f"reference = {value}"})
    yield "a header with many parts", "[" + "a." * 100_000 + "a]\n"


@nightly
def test_studies_and_mappings(tmp_path: Path) -> None:
    """The record is too short for a study, so that each ends with a sentence."""
    (tmp_path / "log.csv").write_text("t,x,u\n0,1,2\n")
    cases = [(label, "odd.toml", text, ["study", "odd.toml", "-o", "out"]) for label, text in list(studies())[::2]]
    mapped = [(label, text) for label, text in studies() if not label.startswith(("servo", "compensation"))]
    for label, text in mapped[1::4]:
        text = text.replace("[compensation]", "").partition("[servo]")[0]
        cases.append(
            (f"identify, {label}", "odd.toml", text, ["identify", "odd.toml", "--model", "LuGre", "-o", "fit"])
        )
    counts = run_cases(tmp_path, cases)
    assert counts["runs"] == 0 and counts["sentences"] > 1000


ALONE = """
wires = []
experiment = { stop = 0.002, step = 1e-3 }
parts.mass = { model = "Mass", start = { F_drive = 1.0, F_friction = 0.0 } }
"""
CELLS = (
    *("1", "-1", "0", "1e300", "-1e999", "nan", "inf", "", " ", "true", "x", "'", '""', "1_000", "0x10", "1e-320"),
    *(
        str(2**31),
        str(2**53 + 1),
        str(2**63 - 1),
        str(2**63),
        "9" * 400,
        "9" * 5000,
        "x" * 200_000,
        "[/b]",
        "\0",
        "\x1b[1m",
    ),
    *("=1+1", "@a", "1;2", '"a', "a\rb", "\ud800".encode("utf-8", "surrogatepass").decode("latin-1"), "٣", "1.0,2.0"),
)
NAMES = (
    "mass.m",
    "mass.F_drive",
    "step",
    "stop",
    "master",
    "mass.none",
    "none.m",
    "x",
    "",
    ".",
    "mass.",
    "time",
    "start",
)


@nightly
def test_parameter_sets_of_sweeps(tmp_path: Path) -> None:
    (tmp_path / "system.toml").write_text(ALONE)
    own = ["--executor", "serial", "-o"]
    cases = []
    for number, (name, cell) in enumerate((name, cell) for name in NAMES for cell in CELLS):
        if number % 2 == 0:
            table = ["sweep", "system.toml", "--samples", "odd.csv", *own, f"table{number}"]
            cases.append((f"{name} = {cell[:50]!r} in a table", "odd.csv", f"{name}\n{cell}\n", table))
        if number % 5 == 0:
            varied = ["sweep", "system.toml", f"--vary={name}={cell[:5000]}", *own, f"option{number}"]
            cases.append((f"--vary {name}={cell[:50]!r}", "unused", "", varied))
    for number, cell in enumerate(cell for cell in CELLS if len(cell) <= 5000 and cell != "1_000"):
        for form in (f"mass.m=1:2:{cell}", f"mass.m=1:{cell}:3", f"mass.m={cell}:2:3:log", f"mass.m={cell}:3"):
            rest = ["--sobol", "4"] if form.count(":") == 1 else []
            ranged = ["sweep", "system.toml", f"--vary={form}", *rest, *own, f"range{number}-{form.find(cell)}"]
            cases.append((f"--vary {form[:50]}", "unused", "", ranged))
        for option in ("--latin-hypercube", "--sobol", "--seed"):
            points = [] if option != "--seed" else ["--sobol=2"]
            given = ["sweep", "system.toml", "--vary=mass.m=1:2", *points, f"{option}={cell[:5000]}", "-o", "o"]
            if cell.lstrip("-").isdecimal() and len(cell) < 400:  # others are refused by argparse
                cases.append((f"{option} {cell[:50]}", "unused", "", [*given, "--executor=serial", "--stop=-1"]))
    for text in (
        "",
        "mass.m\n",
        "\n\n",
        "mass.m,mass.m\n1,2\n",
        "mass.m,mass.k\n1\n",
        "\0",
        "mass.m\n" + "1\n" * 3 + "true\n",
    ):
        table = ["sweep", "system.toml", "--samples", "odd.csv", *own, f"whole{len(cases)}"]
        cases.append((f"the table {text[:30]!r}", "odd.csv", text, table))
    assert run_cases(tmp_path, cases)["sentences"] > 0.4 * len(cases)
