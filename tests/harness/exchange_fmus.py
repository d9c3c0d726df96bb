"""FMUs for model exchange as other tools export them, compiled from exchange.c."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import MappingProxyType

import fmpy

SOURCES = Path(__file__).parent / "exchange"

_LOCAL = 'causality="local"'
_OUTPUT = 'causality="output"'
_INPUT = 'causality="input"'
_PARAMETER = 'causality="parameter" variability="tunable"'
_COUNT = (*(_OUTPUT + ' variability="discrete"',), "<Integer/>")


def _states(*names: str) -> list[tuple[str, int, str, str]]:
    """The states, which are outputs, and their derivatives."""
    outputs = [(name, k, _OUTPUT + ' initial="exact"', "<Real{0}/>") for k, name in enumerate(names)]
    first = len(names)
    return outputs + [
        (f"der({name})", first + k, _LOCAL, f'<Real derivative="{k + 1}"/>') for k, name in enumerate(names)
    ]


def _parameters(first: int, **starts: float) -> list[tuple[str, int, str, str]]:
    return [(name, first + k, _PARAMETER, f'<Real start="{v}"/>') for k, (name, v) in enumerate(starts.items())]


_CLOCK = _states("x")
_STARTS = MappingProxyType({"OSCILLATOR": (1, 0), "BALL": (1, 0), "VANDERPOL": (2, 0), "BELT": (0, 0.1), "ROOM": (20,)})

# name, value reference, attributes, type: as in exchange.c
VARIABLES = MappingProxyType(
    {
        "OSCILLATOR": [
            *_states("x", "v"),
            ("F", 4, _INPUT, '<Real start="0" unit="N"/>'),
            *_parameters(5, omega=3.0, mass=1.0),
        ],
        "BALL": [*_states("h", "v"), *_parameters(4, g=9.81, e=0.7), ("bounces", 0, *_COUNT)],
        "STAIR": [("level", 0, *_COUNT), *_parameters(0, period=0.3)],
        "SAMPLER": [
            ("u", 0, _INPUT, '<Real start="0"/>'),
            ("y", 1, _OUTPUT + ' variability="discrete"', "<Real/>"),
            *_parameters(2, period=0.2),
        ],
        "VANDERPOL": [*_states("x", "v"), *_parameters(4, mu=5.0)],
        "BELT": [
            *_states("x", "v"),
            *_parameters(4, mass=1.0, k=100.0, V=0.1, Fs=5.0, Fc=3.0),
            ("slips", 0, _OUTPUT + ' variability="discrete"', "<Boolean/>"),
        ],
        "GAIN": [
            ("u", 0, _INPUT, '<Real start="0"/>'),
            ("y", 1, _OUTPUT, "<Real/>"),
            *_parameters(2, k=2.0),
            ("last", 3, _OUTPUT + ' variability="discrete"', "<Real/>"),
            ("above", 0, _OUTPUT + ' variability="discrete"', "<Boolean/>"),
        ],
        **{kind: [*_CLOCK, ("events", 0, *_COUNT)] for kind in ("ASKS", "ENDS", "STOPS", "UNSETTLED", "CHATTERS")},
        **{kind: [*_CLOCK] for kind in ("TWOFACED", "DUE", "NEARS")},
        "ROOM": [
            *_states("T"),
            ("heat", 0, _INPUT + ' variability="discrete"', '<Boolean start="false"/>'),
            *_parameters(2, power=10.0, outside=15.0),
        ],
        "FAILS": [*_CLOCK, *_parameters(2, status=2.0, at=0.5, nan=0.0)],
        "INTEGRATOR": [*_CLOCK, ("u", 2, _INPUT, '<Real start="0"/>'), ("y", 3, _OUTPUT, "<Real/>")],
    }
)

INDICATORS = MappingProxyType({"BALL": 1, "BELT": 1, "GAIN": 1, "CHATTERS": 1, "TWOFACED": 1})


def description(kind: str, guid: str, *, derivatives: int | None = None, needed: bool = True) -> str:
    """The modelDescription.xml; ``derivatives`` states another number of states than the FMU has."""
    variables = VARIABLES[kind]
    starts = iter(_STARTS.get(kind, (0, 0)))
    rows = "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" {attributes}>'
        + (typed.format(f' start="{next(starts)}"') if "{0}" in typed else typed)
        + "</ScalarVariable>"
        for name, reference, attributes, typed in variables
    )
    outputs = [i for i, (_, _, attributes, _) in enumerate(variables, 1) if _OUTPUT in attributes]
    rates = [i for i, (name, *_) in enumerate(variables, 1) if name.startswith("der(")][:derivatives]
    feedthrough = kind in ("GAIN", "INTEGRATOR")
    depends = {i: "" if feedthrough and variables[i - 1][0] == "y" else ' dependencies=""' for i in outputs}
    unknowns = "".join(f'<Unknown index="{i}"{depends[i]}/>' for i in outputs)
    changes = "".join(f'<Unknown index="{i}"/>' for i in rates)
    flags = f'canGetAndSetFMUstate="{str("states" in guid).lower()}"'
    flags += f' canSerializeFMUstate="{str("states" in guid).lower()}"'
    flags += "" if needed else ' completedIntegratorStepNotNeeded="true"'
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>'
        f'<fmiModelDescription fmiVersion="2.0" modelName="{kind}" guid="{guid}" generationTool="by hand" '
        f'numberOfEventIndicators="{INDICATORS.get(kind, 0)}">'
        f'<ModelExchange modelIdentifier="exchange" {flags}/>'
        '<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit></UnitDefinitions>'
        '<LogCategories><Category name="logStatusError"/></LogCategories>'
        f"<ModelVariables>{rows}</ModelVariables>"
        f"<ModelStructure><Outputs>{unknowns}</Outputs>"
        + (f"<Derivatives>{changes}</Derivatives>" if changes else "")
        + "</ModelStructure></fmiModelDescription>"
    )


def in_c(folder: Path, compiler: Sequence[str]) -> Callable[..., Path]:
    """``make(kind, states=True, ...)`` -> FMU made of exchange.c, see `description`."""
    library = folder / f"exchange{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-std=gnu99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", f"-I{headers}", "-o", str(library)]
    subprocess.run([*compiler, *flags, str(SOURCES / "exchange.c"), "-lm"], check=True, timeout=300)
    binary = library.read_bytes()

    def make(kind: str, *, states: bool = True, derivatives: int | None = None, needed: bool = True) -> Path:
        guid = kind + " states" * states
        path = folder / f"{kind}{states}{derivatives}{needed}.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", description(kind, guid, derivatives=derivatives, needed=needed))
            archive.writestr(f"binaries/{fmpy.platform}/{library.name}", binary)
        return path

    return make
