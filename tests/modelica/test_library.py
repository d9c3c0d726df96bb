"""The library as a whole: its models, their parameters and ranges, and the command that writes it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
import rumoca
from modelica.library import Library
from thorough import landing, nightly

from friction_fmus.blocks.catalogue import catalogue, source_folder
from friction_fmus.blocks.macros import table
from friction_fmus.cli.main import main

PAGE = Path(__file__).parents[2] / "docs" / "modelica.md"
FRICTION = [name for name, block in catalogue().items() if block.kind == "friction"]
LAWS = sorted(file.stem for file in (source_folder() / "friction").glob("*.mo"))
ROWS = ("INPUT", "OPTIONAL", "OUTPUT", "LOCAL", "STATE", "STATES", "FLAG", "FLAGS", "TALLY", "STATE_OUTPUT", "FIXED")
PARAMETERS = {"PARAMETER": 2, "COUNT": 1, "SWITCH": 1, "PARAMETERS": 3}  # where the start value is
MORE = {"ModifiedLeuven": ", N = 2, k = {6e4, 4e4}, W = {0.8, 0.8}"}  # rumoca reads n as N
NOT_THERE = {"PrandtlTomlinson": {"kT", "dt", "seed"}}  # it has no temperature
TYPES = {"LENGTH": "Length", "VELOCITY": "Velocity", "FORCE": "Force", "MASS": "Mass", "STIFFNESS": "Stiffness"}
TYPES |= {"DAMPING": "Damping", 'FORCE "/s': "ForceRate"}


def test_every_model_is_in_the_library_or_has_a_reason() -> None:
    reasons = re.findall(r"^\| (\w+) \| .+ \|$", PAGE.read_text().split("<!-- not there -->")[1], re.M)
    names = {name for name in reasons if name in FRICTION}
    assert set(FRICTION) == names | set(LAWS)
    assert not names & set(LAWS)


def parameters_of(law: str) -> dict[str, tuple[str, list[float], float, float, str]]:
    """Return type, start values, range and description of the parameters in the C file of a model."""
    found = {}
    for kind, row in table(catalogue()[law].code, "VARIABLES", (*ROWS, *PARAMETERS)):
        if kind not in PARAMETERS:
            continue
        place = PARAMETERS[kind]
        if kind == "COUNT":
            unit, (low, high) = "Integer", (row[2], row[3])
        elif kind == "SWITCH":
            unit, (low, high) = "Boolean", ("-INF", "INF")
        else:
            unit, (low, high) = row[place - 1], (row[place + 1], row[place + 2])
            unit = f"Units.{TYPES[unit]}" if unit in TYPES else "Real"
        start = [float(text) for text in row[place].strip("()").split(",")]
        text = re.sub(r'"?\s*FORCE_NOUN\s*"?', " force ", row[-1].replace("MASS_NOUN", "mass")).replace('"', "").strip()
        found[row[0]] = unit, start, float(low.lower()), float(high.lower()), re.sub(" +", " ", text)
    return {name: row for name, row in found.items() if name not in NOT_THERE.get(law, ())}


@pytest.mark.parametrize("law", LAWS)
def test_parameters_are_those_of_the_fmu(law: str, library: Library) -> None:
    model = library.model(f"model Test extends FrictionFMUs.Laws.{law}(v = sin(time){MORE.get(law, '')}); end Test;")
    own = {"useFn", "useF_t"}
    mine = {parameter.name: parameter for parameter in model.parameters if parameter.name not in own}
    code = (source_folder() / "friction" / f"{law}.mo").read_text()
    stated = parameters_of(law)
    assert set(mine) == set(stated)
    for name, (unit, start, low, high, description) in stated.items():
        parameter = mine[name]
        if name == "Fn0":
            continue
        assert f"parameter {unit} {name}" in code
        assert parameter.description == description.replace(" ,", ",")
        if len(start) == 1 and not parameter.dims and name not in MORE.get(law, ""):
            assert parameter.value == start[0]
        if unit != "Boolean" and name != "N":
            assert (-math.inf if parameter.min is None else parameter.min) == low
            assert (math.inf if parameter.max is None else parameter.max) == high


def test_units_are_those_of_the_fmus() -> None:
    """Compared as texts: rumoca does not report units of types that are redeclared."""
    header = (source_folder() / "block.h").read_text()
    code = (source_folder() / "modelica" / "AxisUnits.mo").read_text()
    rotational, translational = header.split("#ifdef ROTATIONAL")[1].split("#endif")[0].split("#else")
    for domain, macros in (("Translational", translational), ("Rotational", rotational)):
        units = dict(re.findall(r"#define (\w+) +\"([^\"]+)\"", macros))
        package = code.split(f"package {domain} ")[1].split(f"end {domain};")[0]
        types = dict(re.findall(r'redeclare type (\w+) = Real\(unit = "([^"]+)"\)', package))
        assert types.pop("ForceRate") == units["FORCE"] + "/s"
        assert types == {name.capitalize(): units[name.upper()] for name in types}
        assert len(types) == 7


@pytest.mark.parametrize(
    ("law", "value", "sentence"),
    [
        ("LuGre", "Fc = -1", "Fc = -1 is outside [1e-09, inf]"),
        ("Dahl", "Fn0 = -1", "Fn0 = -1 is outside [1e-12, inf]"),
        ("GMS", "k = {1, -2, 1, 1, 1, 1, 1, 1, 1, 1}", "k[2] = -2 is outside [0, inf]"),
        ("LoadDependentDahl", "mu_avg = 0.01", "|mu_dif| <= mu_avg"),
        ("BlimanSorine", "f2 = 5", "f2 <= f1"),
    ],
)
def test_a_parameter_out_of_range_is_refused_as_by_the_fmu(
    law: str, value: str, sentence: str, library: Library
) -> None:
    with pytest.raises(rumoca.SimulationError, match=re.escape(sentence)):
        library.run(f"model Test extends FrictionFMUs.Laws.{law}(v = sin(time), {value}); end Test;", 1.0, 0.1)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("domain", ["Translational", pytest.param("Rotational", marks=nightly)])
def test_components_compile(domain: str, law: str, library: Library) -> None:
    mass = "Mass mass(m = 1)" if domain == "Translational" else "Inertia mass(J = 1)"
    library.model(f"""model Test
  Modelica.Mechanics.{domain}.Components.Fixed ground;
  FrictionFMUs.{domain}.{law} friction(stateSelect = StateSelect.prefer{MORE.get(law, "")});
  Modelica.Mechanics.{domain}.Components.{mass};
equation
  connect(ground.flange, friction.flange_a);
  connect(friction.flange_b, mass.flange_a);
end Test;""")


@landing
def test_the_command_writes_the_library(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "--to", "modelica", "-o", str(tmp_path / "new")]) == 0
    folder = tmp_path / "new" / "FrictionFMUs"
    assert capsys.readouterr().out == f"{folder}\n"
    for package in (folder, folder / "Laws", folder / "Compensators"):
        files = {file.stem for file in package.iterdir() if file.stem not in ("package", "Resources")}
        assert set((package / "package.order").read_text().split()) == files
        for file in package.glob("*.mo"):
            text = file.read_text()
            within = "" if file == folder / "package.mo" else "FrictionFMUs"
            within += f".{package.name}" if package != folder and file.stem != "package" else ""
            assert text.startswith(f"within {within};" if within else "package FrictionFMUs")
    Library(folder).model("model Test extends FrictionFMUs.Examples.StickSlip; end Test;")
