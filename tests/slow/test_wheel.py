"""The wheel as pip builds it, installed where there is no compiler and nothing but what the package itself requires."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import math
import os
import re
import subprocess
import sys
import zipfile
from importlib.metadata import Distribution
from pathlib import Path

import fmpy
import pytest
from packaging.requirements import Requirement
from thorough import THOROUGH, nightly, some

from friction_fmus import catalogue
from harness.compiling.platforms import PLATFORMS

ROOT = Path(__file__).parents[2]

CHOSEN = ("linux64",)
"""Platforms of the FMUs, but for the wheel of each night; test_platforms.py has all five."""
BLOCKS = some((*catalogue(),), ("LuGre", "Mass", "PID", "Coulomb"))

LARGEST = 700e6
"""Bytes of the package and everything it requires, installed without extras."""

SESSION = """
import sys
from pathlib import Path
import friction_fmus
from harness import System, sweep
assert Path(friction_fmus.__file__).is_relative_to(sys.argv[1]), friction_fmus.__file__
assert friction_fmus.fmu("LuGre") == Path(sys.argv[1], "friction_fmus", "fmus", "LuGre.fmu")
copy = friction_fmus.build("PID", sys.argv[1] + "/copy")
assert copy.read_bytes() == friction_fmus.fmu("PID").read_bytes()
with System.from_toml(sys.argv[2], friction_fmus.fmu) as system:
    print(system.run().sizes["time"])
    runs = sweep(system, [{"stop": 0.1}, {"stop": 0.2}], executor="serial")
    print(runs.sizes["run"], runs["error"].to_numpy().tolist())
try:
    friction_fmus.build("LuGre", sys.argv[1] + "/own", {"Fc": 2.0})
except friction_fmus.BuildError as error:
    print(error)
"""

W = 2.0 * math.pi * 5.0
LOG = "t [s],x [m],force [N]\n" + "".join(
    f"{k * 1e-3},{-1e-2 * math.cos(W * k * 1e-3)},"
    f"{2e-2 * W**2 * math.cos(W * k * 1e-3) + math.copysign(3.0, math.sin(W * k * 1e-3))}\n"
    for k in range(1000)
)
"""A mass of 2 kg with Coulomb friction of 3 N on a sine."""


DONE = [
    ["list"],
    ["show", "LuGre"],
    ["cite", "LuGre"],
    ["check", "{wheel}/friction_fmus/fmus/PID.fmu"],
    ["export", "--to", "modelica", "-o", "modelica"],
    ["run", "{examples}/stick_slip.toml", "--stop", "0.1", "-o", "run.nc"],
    ["run", "{examples}/stick_slip.toml", "--stop", "0.1", "-o", "run.csv", "--plot", "run.png"],
]
"""Commands that need no extra."""

REFUSED = [
    (["codegen", "PID", "-o", "pid"], "casadi", "build"),
    (["show", "PID"], "casadi", "build"),
    (["study", "demo", "-o", "out"], "plotly", "study"),
    (["build", "LuGre", "-o", "own", "--set", "Fc=2"], "ziglang", "build"),
    (["build", "LuGre", "-o", "own", "--fmi", "3"], "ziglang", "build"),
    (["compose", "{examples}/stick_slip.toml", "-o", "axis.fmu"], "ziglang", "build"),
    (["sweep", "{examples}/stick_slip.toml", "-o", "out", "--vary", "mass.m=1,2"], "pyarrow", "parquet"),
    (["run", "{examples}/stick_slip.toml", "--stop", "0.1", "-o", "run.parquet"], "pyarrow", "parquet"),
    (["identify", "log.parquet", "--model", "Coulomb", "-o", "out"], "pyarrow", "parquet"),
    (["identify", "log.mcap", "--model", "Coulomb", "-o", "out"], "mcap", "mcap"),
]
"""Commands that need one, the package that is missing, and the extra that brings it."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    command += ["--wheel-dir", str(folder), str(ROOT)]
    chosen = (
        {}
        if THOROUGH
        else {"FRICTION_FMUS_PLATFORMS": ",".join(CHOSEN), "FRICTION_FMUS_WHEEL_BLOCKS": ",".join(BLOCKS)}
    )
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run(command, check=True, timeout=590, env=inherited | chosen)
    (wheel,) = folder.glob("friction_fmus-*-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def required(distribution: Distribution) -> dict[str, Distribution]:
    """What pip installs for a distribution without extras: all it requires, and what that requires."""
    found: dict[str, Distribution] = {}
    pending = [Requirement(text) for text in distribution.requires or ()]
    while pending:
        requirement = pending.pop()
        extras = requirement.extras or {""}
        if requirement.marker is None or any(requirement.marker.evaluate({"extra": extra}) for extra in extras):
            other = importlib.metadata.distribution(requirement.name)
            if found.setdefault(other.name, other) is other:
                pending += [Requirement(text) for text in other.requires or ()]
    return found


@pytest.fixture(scope="module")
def requirements(installed: Path) -> dict[str, Distribution]:
    """What the wheel requires, as it is installed here."""
    (information,) = installed.glob("friction_fmus-*.dist-info")
    return required(Distribution.at(information))


@pytest.fixture(scope="module")
def environment(
    installed: Path, requirements: dict[str, Distribution], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, str]:
    """Variables of a process that finds the wheel and what it requires, and no other package and no compiler."""
    folder = tmp_path_factory.mktemp("packages")
    for distribution in requirements.values():
        for top in {file.parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}:
            if not (folder / top).exists():
                (folder / top).symlink_to(Path(str(distribution.locate_file(top))))
    variables = {name: value for name, value in os.environ.items() if name != "CC"}
    cache = tmp_path_factory.mktemp("cache")
    return variables | {
        "PYTHONPATH": os.pathsep.join(map(str, (installed, folder))),
        "FRICTION_FMUS_CACHE": str(cache),
    }


def run(command: list[str], environment: dict[str, str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run Python without the packages of this environment."""
    whole = [sys.executable, "-S", *command]
    return subprocess.run(whole, env=environment, cwd=folder, capture_output=True, text=True, check=False)


def test_wheel_carries_library_engine_and_fmus_for_all_platforms(installed: Path) -> None:
    assert {path.stem for path in (installed / "friction_fmus" / "fmus").iterdir()} == set(BLOCKS)
    assert (installed / "friction_fmus" / "modelica" / "Compensators" / "PID.mo").is_file()
    for platform in PLATFORMS.values():
        engine = installed / "harness" / "engine" / "binaries" / platform.folder / f"engine{platform.suffix}"
        assert engine.stat().st_size > 10_000
    for fmu in (installed / "friction_fmus" / "fmus").iterdir():
        with zipfile.ZipFile(fmu) as archive:
            entries = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        assert entries == set(PLATFORMS if THOROUGH else CHOSEN)


def test_a_wheel_is_small(installed: Path) -> None:
    (wheel,) = installed.parent.glob("*.whl")
    assert wheel.stat().st_size < 20e6


def test_what_a_wheel_requires_is_small(installed: Path, requirements: dict[str, Distribution]) -> None:
    optional = {"casadi", "distributed", "mcap", "plotly", "pyarrow", "ziglang"}
    assert not optional & set(requirements)
    files = [Path(str(d.locate_file(file))) for d in requirements.values() for file in d.files or ()]
    sizes = [path.stat().st_size for path in (*files, *installed.rglob("*")) if path.is_file()]
    assert sum(sizes) < LARGEST


def test_wheel_needs_no_compiler(installed: Path, environment: dict[str, str], tmp_path: Path) -> None:
    arguments = ["-c", SESSION, str(installed), str(ROOT / "examples" / "stick_slip.toml")]
    session = run(arguments, environment | {"CC": "/no/compiler"}, tmp_path)
    assert session.returncode == 0, session.stderr
    rows, runs, refusal = session.stdout.splitlines()
    assert int(rows) == 25_001
    assert runs == "2 ['', '']"
    assert refusal.startswith("The C compiler '/no/compiler' does not run")


@pytest.mark.parametrize("arguments", some(DONE, DONE[::3]), ids=" ".join)
def test_commands_without_extras(
    arguments: list[str], installed: Path, environment: dict[str, str], tmp_path: Path
) -> None:
    filled = [argument.format(wheel=installed, examples=ROOT / "examples") for argument in arguments]
    done = run(["-m", "friction_fmus", *filled], environment, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_fmi_3_is_compiled_on_demand(environment: dict[str, str], tmp_path: Path) -> None:
    """With the compiler, and without casadi."""
    spec = importlib.util.find_spec("ziglang")
    assert spec is not None and spec.origin is not None
    (tmp_path / "zig").mkdir()
    (tmp_path / "zig" / "ziglang").symlink_to(Path(spec.origin).parent)
    found = environment | {"PYTHONPATH": os.pathsep.join((environment["PYTHONPATH"], str(tmp_path / "zig")))}
    done = run(["-m", "friction_fmus", "build", "PID", "--fmi", "3", "-o", "own"], found, tmp_path)
    assert done.returncode == 0
    assert re.fullmatch(r"compiling PID for \S+\n(\(the first compilation for a platform .*\)\n)?", done.stderr)
    assert fmpy.read_model_description(str(tmp_path / "own" / "PID.fmu")).fmiVersion == "3.0"


@pytest.mark.parametrize(("arguments", "package", "extra"), some(REFUSED, REFUSED[::8]), ids=str)
def test_a_missing_extra_is_one_sentence(
    arguments: list[str], package: str, extra: str, environment: dict[str, str], tmp_path: Path
) -> None:
    for name in ("log.parquet", "log.mcap"):
        (tmp_path / name).touch()
    filled = [argument.format(examples=ROOT / "examples") for argument in arguments]
    refused = run(["-m", "friction_fmus", *filled], environment, tmp_path)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line.startswith(f"friction-fmus: {package} is not installed; ")
    assert line.endswith(f": pip install 'friction-fmus[{extra}]'")


@nightly
def test_an_identification_without_a_compiler_leaves_out_the_fmus(environment: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(LOG, encoding="utf-8")
    done = run(["-m", "friction_fmus", "identify", "log.csv", "--model", "Coulomb", "-o", "out"], environment, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "the results are written without FMUs: ziglang is not installed" in done.stderr
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".json", ".png", ".ssv", ".toml"}
