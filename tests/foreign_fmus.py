"""FMUs as other tools export them: without dependencies, with or without saved states, in C and by pythonfmu."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType

import fmpy
import pytest

SOURCES = Path(__file__).parent / "harness" / "foreign"

_OUTPUT = 'causality="output"'
_INPUT = 'causality="input"'
_PARAMETER = 'causality="parameter" variability="tunable"'
_DISCRETE = ' variability="discrete"'


def _reals(causality: str, first: int, **starts: float) -> list[tuple[str, int, str, str]]:
    return [(name, first + i, causality, f'<Real start="{start}"/>') for i, (name, start) in enumerate(starts.items())]


# name, value reference, attributes, type: as in foreign.c
VARIABLES = MappingProxyType(
    {
        "PREY": [
            ("x", 0, _OUTPUT, "<Real/>"),
            *_reals(_INPUT, 1, y=1.0),
            *_reals(_PARAMETER, 2, birth=1.1, eaten=0.4),
        ],
        "PREDATOR": [
            ("y", 0, _OUTPUT, "<Real/>"),
            *_reals(_INPUT, 1, x=1.0),
            *_reals(_PARAMETER, 2, death=0.4, growth=0.1),
        ],
        "CONTROLLER": [
            ("u", 0, _OUTPUT, "<Real/>"),
            *_reals(_INPUT, 1, m=0.0),
            *_reals(_PARAMETER, 3, Kp=2.0, Ki=1.0),
            *_reals(_INPUT, 5, reference=1.0),
        ],
        "PLANT": [("x", 0, _OUTPUT, "<Real/>"), *_reals(_INPUT, 1, u=0.0), *_reals(_PARAMETER, 2, T=0.5)],
        "GAIN": [("y", 0, _OUTPUT, "<Real/>"), *_reals(_INPUT, 1, u=0.0), *_reals(_PARAMETER, 2, k=1.0, c=0.0)],
        "PRODUCT": [("y", 0, _OUTPUT, "<Real/>"), *_reals(_INPUT, 1, u=0.0, w=0.0)],
        "THERMOSTAT": [
            ("on", 0, _OUTPUT + _DISCRETE, "<Boolean/>"),
            *_reals(_INPUT, 0, T=20.0),
            *_reals(_PARAMETER, 1, low=19.0, high=21.0),
        ],
        "ROOM": [
            ("T", 0, _OUTPUT, "<Real/>"),
            ("heat", 0, _INPUT + _DISCRETE, '<Boolean start="false"/>'),
            *_reals(_PARAMETER, 1, power=30.0, outside=5.0, tau=100.0),
        ],
        "NOT": [
            ("y", 0, _OUTPUT + _DISCRETE, "<Boolean/>"),
            ("level", 0, _OUTPUT, "<Real/>"),
            ("u", 1, _INPUT + _DISCRETE, '<Boolean start="false"/>'),
        ],
        "TEXTS": [
            ("length", 0, _OUTPUT, "<Real/>"),
            ("mode", 0, 'causality="parameter" variability="fixed"', '<String start="none"/>'),
            ("note", 1, _INPUT + _DISCRETE, '<String start=""/>'),
        ],
    }
)


def description(kind: str, guid: str) -> str:
    """The modelDescription.xml; no tool that writes it knows of dependencies."""
    variables = VARIABLES[kind]
    rows = "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" {attributes}>{typed}</ScalarVariable>'
        for name, reference, attributes, typed in variables
    )
    outputs = "".join(
        f'<Unknown index="{i}"/>' for i, (_, _, attributes, _) in enumerate(variables, 1) if _OUTPUT in attributes
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>'
        f'<fmiModelDescription fmiVersion="2.0" modelName="{kind}" guid="{guid}" generationTool="by hand">'
        f'<CoSimulation modelIdentifier="foreign" canGetAndSetFMUstate="{str("states" in guid).lower()}"/>'
        f"<ModelVariables>{rows}</ModelVariables>"
        f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
    )


def in_c(folder: Path, compiler: Sequence[str]) -> Callable[..., Path]:
    """``make(kind, states=False, stale=False)`` -> FMU made of foreign.c, see there."""
    library = folder / f"foreign{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-std=gnu99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", f"-I{headers}", "-o", str(library)]
    subprocess.run([*compiler, *flags, str(SOURCES / "foreign.c"), "-lm"], check=True, timeout=300)
    binary = library.read_bytes()

    def make(kind: str, *, states: bool = False, stale: bool = False, ends: bool = False) -> Path:
        guid = kind + " states" * states + " stale" * stale + " ends" * ends
        path = folder / f"{guid.replace(' ', '_')}.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", description(kind, guid))
            archive.writestr(f"binaries/{fmpy.platform}/{library.name}", binary)
        return path

    return make


def in_python(folder: Path) -> Callable[[str], Path]:
    """``make("prey")`` -> FMU that pythonfmu makes of prey.py, each once; it has binaries for Linux and Windows."""
    pytest.importorskip("pythonfmu")

    @cache
    def make(name: str) -> Path:
        run = [sys.executable, "-m", "pythonfmu", "build", "-f", str(SOURCES / f"{name}.py"), "-d", str(folder)]
        subprocess.run(run, check=True, timeout=100, capture_output=True)
        return folder / f"{name.capitalize()}.fmu"

    return make
