"""`check` of FMI 3.0: nothing in our FMUs, and each fault that is put into one."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import pytest
from fmi3.slaves import three
from lxml import etree
from shell.selection import SHELL_BLOCKS
from thorough import landing, some

from friction_fmus.check import RULES, check
from harness.compiling.toolchain import FLAGS, compiler, header_folder

XML = "modelDescription.xml"


def rules(path: Path, *, static: bool = False) -> set[str]:
    return {finding.rule for finding in check(path, static=static)}


@landing
@pytest.mark.parametrize(
    ("name", "full"),
    some(
        [(name, full) for name in (*SHELL_BLOCKS, "compensated_axis") for full in (True, False)],
        [("PID", True)],
    ),
)
def test_nothing_is_found_in_our_fmus(name: str, full: bool) -> None:
    assert [str(finding) for finding in check(three(name, full))] == []


def changed(name: str, folder: Path, old: str, new: str, member: str = XML) -> Path:
    """The FMU with another text in one of its files."""
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(three(name)) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for item in source.infolist():
            data = source.read(item)
            if item.filename == member:
                text = re.sub(old, new, data.decode(), count=1)
                assert text != data.decode(), "nothing is changed"
                data = text.encode()
            target.writestr(item.filename, data)
    return path


DESCRIPTIONS = {
    "schema": ("PID", 'causality="input"', 'causality="inward"', "fmi3-schema"),
    "name twice": ("PID", 'name="Kd"', 'name="Kp"', "fmi3-duplicate"),
    "reference twice": ("LuGre", '(name="sigma1" valueReference=)"\\d+"', r'\1"1"', "fmi3-duplicate"),
    "variability": ("LuGre", '(name="v" .*?)"continuous"', r'\1"fixed"', "fmi3-variability"),
    "continuous Boolean": (
        "LuGre",
        '(name="asymmetric" .*?)"parameter" variability="tunable"',
        r'\1"local" variability="continuous"',
        "fmi3-variability",
    ),
    "no start": ("LuGre", '(name="sigma1" .*?) start="[^"]*"', r"\1", "fmi3-start"),
    "start of a result": ("LuGre", '(name="F" .*?)/>', r'\1 start="1"/>', "fmi3-start"),
    "too few starts": ("GMS", '(name="k" .*?start=)"(\\S+) (\\S+) [^"]*"', r'\1"\2 \3"', "fmi3-start"),
    "outside limits": ("LuGre", '(name="sigma1" .*?start=)"[^"]*"', r'\1"-1"', "fmi3-limits"),
    "dimension": ("GMS", 'Dimension valueReference="\\d+"', 'Dimension valueReference="999"', "fmi3-dimension"),
    "type": ("LuGre", 'declaredType="Force"', 'declaredType="Farce"', "fmi3-type"),
    "unit": ("LuGre", '(name="sigma0" .*?unit=)"N/m"', r'\1"lbf"', "unit-undefined"),
    "unit of a type": ("LuGre", '(name="Force" quantity="Force" unit=)"N"', r'\1"lbf"', "unit-undefined"),
    "display unit": ("LuGre", '(name="v" )', r'\1displayUnit="km/h" ', "display-unit-undefined"),
    "display unit of an alias": (
        "LuGre",
        '(<Float64 name="F" [^>]*?)/>',
        r'\1><Alias name="F2" displayUnit="kN"/></Float64>',
        "display-unit-undefined",
    ),
    "unit twice": ("LuGre", "</UnitDefinitions>", '<Unit name="N"/></UnitDefinitions>', "duplicate-unit"),
    "inverse unit": ("LuGre", '(name="mm/s" factor="1000")', r'\1 offset="1" inverse="true"', "unit-inverse"),
    "exponents": ("LuGre", r'(<Unit name="N">\s*<BaseUnit) kg="1"', r'\1 kg="2"', "unit-exponents"),
    "type twice": ("LuGre", "</TypeDefinitions>", '<Float64Type name="Force"/></TypeDefinitions>', "duplicate-type"),
    "type and variable": (
        "LuGre",
        "</TypeDefinitions>",
        '<Float64Type name="Fc"/></TypeDefinitions>',
        "type-and-variable",
    ),
    "items": (
        "LuGre",
        "</TypeDefinitions>",
        '<EnumerationType name="E"><Item name="a" value="1"/><Item name="b" value="1"/></EnumerationType>'
        "</TypeDefinitions>",
        "enumeration-items",
    ),
    "limits of a type": (
        "LuGre",
        '<Float64Type name="Force" ',
        '<Float64Type name="Force" min="2" max="1" ',
        "limits-reversed",
    ),
    "category twice": ("LuGre", "</LogCategories>", '<Category name="logAll"/></LogCategories>', "duplicate-category"),
    "name": ("LuGre", 'name="Fs"', 'name="a..b"', "variable-name"),
    "derivative of a Boolean": ("LuGre", 'name="asymmetric"', 'name="der(asymmetric)"', "variable-name"),
    "date": ("LuGre", '(generationDateAndTime="[^"]*?)Z"', r'\1+01:00"', "generation-date"),
    "identifier": (
        "LuGre",
        '<CoSimulation modelIdentifier="LuGre"',
        '<CoSimulation modelIdentifier="3 bad"',
        "model-identifier",
    ),
    "token": ("LuGre", 'instantiationToken="[^"]*"', 'instantiationToken=""', "guid-empty"),
    "experiment": ("LuGre", 'stepSize="0.001"', 'stepSize="10"', "experiment"),
    "not finite": ("LuGre", '(name="Fc" .*?start=)"1"', r'\1"NaN"', "number-not-finite"),
    "nominal": ("LuGre", 'nominal="1e-05"', 'nominal="0"', "nominal"),
    "multiple set": ("LuGre", '(name="Fc" )', r'\1canHandleMultipleSetPerTimeInstant="false" ', "multiple-set"),
    "no interface": ("LuGre", "<ModelExchange .*?/>(?s:.*?)<CoSimulation .*?/>", "", "fmi3-flags"),
    "internal step": ("LuGre", "<CoSimulation ", '<CoSimulation fixedInternalStepSize="0" ', "fmi3-flags"),
    "dimension of a size": (
        "GMS",
        '(<UInt64 name="N" [^>]*?)/>',
        r'\1><Dimension start="2"/></UInt64>',
        "fmi3-dimension",
    ),
    "discrete derivative": ("LuGre", r'(name="der\(z\)".*?)"continuous"', r'\1"discrete"', "fmi3-derivative"),
    "priority": ("PID", '(intervalVariability="fixed")', r'\1 priority="1"', "fmi3-clock"),
    "dependency on a result": (
        "LuGre",
        '(<InitialUnknown valueReference="4" dependencies=)"2 ',
        r'\1"2 6 ',
        "fmi3-initial-unknowns",
    ),
    "no time": ("LuGre", '(name="time" .*?causality=)"independent"', r'\1"local"', "fmi3-independent"),
    "derivative": ("LuGre", 'derivative="5"', 'derivative="8"', "fmi3-derivative"),
    "interval": ("PID", 'intervalVariability="fixed"', 'intervalVariability="constant"', "fmi3-clock"),
    "triggered with interval": (
        "PID",
        'intervalVariability="fixed"',
        'intervalVariability="triggered" intervalDecimal="0.1"',
        "fmi3-clock",
    ),
    "negative interval": ("PID", '(intervalVariability="fixed")', r'\1 intervalDecimal="-1"', "fmi3-clock"),
    "clock of another type": ("PID", '(name="u" )', r'\1clocks="18" ', "fmi3-clocked"),
    "previous without clock": ("PID", '(name="u" )', r'\1previous="13" ', "fmi3-clocked"),
    "previous of another type": ("PID", '(name="u" )', r'\1clocks="30" previous="14" ', "fmi3-clocked"),
    "clocked state not listed": ("PID", '(name="u" )', r'\1clocks="30" previous="13" ', "fmi3-states"),
    "intermediate parameter": ("LuGre", '(name="sigma1" )', r'\1intermediateUpdate="true" ', "fmi3-intermediate"),
    "reinit of an output": ("LuGre", '(name="F" )', r'\1reinit="true" ', "fmi3-reinit"),
    "no event mode": ("PID", ' hasEventMode="true" mightReturnEarlyFromDoStep="true"', "", "fmi3-no-event-mode"),
    "early return": ("LuGre", ' providesIntermediateUpdate="true"', "", "fmi3-flags"),
    "unknown output": ("LuGre", '<Output valueReference="4"', '<Output valueReference="999"', "fmi3-structure"),
    "output missing": ("LuGre", '<Output valueReference="4".*?/>', "", "fmi3-outputs"),
    "state missing": ("LuGre", "<ContinuousStateDerivative .*?/>", "", "fmi3-states"),
    "initial unknown missing": ("LuGre", '<InitialUnknown valueReference="4".*?/>', "", "fmi3-initial-unknowns"),
}


@pytest.mark.parametrize("fault", some([*DESCRIPTIONS], [*DESCRIPTIONS][::2]))
def test_faults_of_the_description_are_found(fault: str, tmp_path: Path) -> None:
    name, old, new, rule = DESCRIPTIONS[fault]
    assert rule in rules(changed(name, tmp_path, old, new), static=True)


def test_places_of_fmi_2_are_found(tmp_path: Path) -> None:
    """Sources without a build description, and a folder of binaries that importers of FMI 3.0 do not know."""
    path = tmp_path / "LuGre.fmu"
    with zipfile.ZipFile(three("LuGre")) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for item in source.infolist():
            if item.filename != "sources/buildDescription.xml":
                target.writestr(item.filename, source.read(item))
        target.writestr("binaries/linux64/LuGre.so", b"x")
    assert rules(path, static=True) == {"source-no-build", "platform-unknown"}


ALLOWED = {
    "early return without events": ("LuGre", "<CoSimulation", '<CoSimulation mightReturnEarlyFromDoStep="true"'),
    "interval by a parameter": ("PID", 'intervalVariability="fixed"', 'intervalVariability="tunable"'),
    "tunable and clocked": ("PID", '(name="Kd" )', r'\1clocks="30" '),
}


@pytest.mark.parametrize("case", ALLOWED)
def test_what_the_standard_allows_is_no_fault(case: str, tmp_path: Path) -> None:
    assert rules(changed(ALLOWED[case][0], tmp_path, *ALLOWED[case][1:]), static=True) == set()


def test_every_rule_of_fmi_3_has_a_fault() -> None:
    faults = {rule for *_, rule in (*DESCRIPTIONS.values(), *BINARIES.values())}
    assert faults >= {rule.id for rule in RULES.values() if rule.kind == "fmi3"}


BINARIES = {
    "adjoint": ("LuGre", "fmi3.h", r"sum \+= seed", "sum -= seed", "fmi3-adjoint"),
    "endless events": ("PID", "fmi3.h", r"\*again = info[^;]*", "*again = true", "event-iteration"),
    "no interval": (
        "PID",
        "fmi3.h",
        r"intervals\[i\] = c->inside->model.Ts",
        "intervals[i] = 0.0",
        "fmi3-event-mode",
    ),
    "late update": (
        "PID",
        "fmi3.h",
        r"c->update\(c->environment, now",
        "c->update(c->environment, now + 1.0",
        "fmi3-intermediate-update",
    ),
    "size at any time": (
        "GMS",
        "fmi3.h",
        "= CONFIGURATION_3,\n    MAY3_GetS",
        "= CONFIGURATION_3 | INITIALIZATION_3,\n    MAY3_GetS",
        "fmi3-configuration",
    ),
    "wrong elements": (
        "GMS",
        "fmi3_values.h",
        r"        values \+= size;",
        "        values[size - 1] += 1.0, values += size;",
        "start-differs",
    ),
    "any token": (
        "LuGre",
        "fmi3.h",
        r"strcmp\(token, TOKEN\) != 0",
        "strcmp(token, TOKEN) == 77",
        "guid-not-checked",
    ),
    "state": (
        "LuGre",
        "fmi3.h",
        r"= fmi2SetFMUstate\(c->inside, saved->inside\)",
        "= fmi2OK",
        "state-not-restored",
    ),
    "crash": (
        "LuGre",
        "fmi3.h",
        r"    const double whole_end = t \+ h;",
        "    const double whole_end = t + h; *(volatile int *)0 = 1;",
        "binary-crashes",
    ),
    "missing": (
        "LuGre",
        "fmi3.h",
        r"fmi3Status fmi3GetShiftFraction\(",
        "fmi3Status unnamed(",
        "function-missing",
    ),
    "other version": ("LuGre", "fmi3.h", "return fmi3Version", 'return "2.0"', "version-answer"),
    "refused start": (
        "PID",
        "fmi3_values.h",
        r'ENTER_3\("SetFloat64", MAY3_Set\)',
        r'ENTER_3("SetFloat64", STEPS_3)',
        "variable-not-settable",
    ),
}


@landing
@pytest.mark.parametrize("fault", some([*BINARIES], [*BINARIES][::12]))
def test_faults_of_the_binary_are_found(fault: str, tmp_path: Path) -> None:
    name, file, old, new, rule = BINARIES[fault]
    path = changed(name, tmp_path, old, new, f"sources/{file}")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    build = etree.parse(tmp_path / "sources" / "buildDescription.xml")
    files = [str(each.get("name")) for each in build.iter("SourceFile")]
    (library,) = (tmp_path / "binaries").glob("*/*")
    plain = [flag for flag in FLAGS if flag not in ("-Werror", "-Wall", "-Wextra", "-Wpedantic", "-O2")]
    command = [*compiler(), *plain, "-O0", "-fno-sanitize=undefined", "-w", "-isystem", str(header_folder())]
    subprocess.run([*command, *files, "-shared", "-lm", "-o", str(library)], cwd=tmp_path / "sources", check=True)
    with zipfile.ZipFile(tmp_path / "made.fmu", "w") as made:
        for entry in sorted(tmp_path.rglob("*")):
            top = entry.relative_to(tmp_path).parts[0]
            if entry.is_file() and not top.endswith(".fmu"):
                made.write(entry, entry.relative_to(tmp_path))
    found = check(tmp_path / "made.fmu")
    assert rule in {finding.rule for finding in found}, [str(finding) for finding in found]
    assert all("fmi2" not in finding.message for finding in found)
