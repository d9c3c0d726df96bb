"""The FMU of foreign/types3.c, whose description a test may change."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import fmpy

from harness.compiling.toolchain import compiler

SOURCES = [Path(__file__).parent / "foreign" / name for name in ("types3.c", "rest3.c")]

_WIDTHS = (
    *(("single", "Float32", 10), ("i8", "Int8", 12), ("u8", "UInt8", 14), ("i16", "Int16", 16), ("u16", "UInt16", 18)),
    *(("i32", "Int32", 20), ("u32", "UInt32", 22), ("i64", "Int64", 24), ("u64", "UInt64", 26)),
)

_OUTPUT = 'causality="output"'
_DISCRETE = 'variability="discrete"'

VARIABLES = {
    "time": '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>',
    "u": '<Float64 name="u" valueReference="1" causality="input" start="0"/>',
    "y": f'<Float64 name="y" valueReference="2" {_OUTPUT}/>',
    "matrix": '<Float64 name="matrix" valueReference="3" causality="input" start="0 0 0 0 0 0">'
    '<Dimension start="2"/><Dimension start="3"/></Float64>',
    "sum": f'<Float64 name="sum" valueReference="4" {_OUTPUT}/>',
    "vector": '<Float64 name="vector" valueReference="5" causality="parameter" variability="tunable" start="1 2 3">'
    '<Dimension valueReference="7"/></Float64>',
    "weighted": f'<Float64 name="weighted" valueReference="6" {_OUTPUT}/>',
    "n": '<UInt64 name="n" valueReference="7" causality="structuralParameter" variability="fixed" start="3"/>',
    **{
        name: f'<{kind} name="{name}" valueReference="{reference}" causality="input" start="0"/>'
        for name, kind, reference in _WIDTHS
    },
    **{
        f"{name}_y": f'<{kind} name="{name}_y" valueReference="{reference + 1}" {_OUTPUT}/>'
        for name, kind, reference in _WIDTHS
    },
    "gear": '<Enumeration name="gear" declaredType="Gear" valueReference="28" causality="input" start="1"/>',
    "gear_y": f'<Enumeration name="gear_y" declaredType="Gear" valueReference="29" {_OUTPUT}/>',
    "flags": '<Boolean name="flags" valueReference="30" causality="input" start="false false">'
    '<Dimension start="2"/></Boolean>',
    "any": f'<Boolean name="any" valueReference="31" {_OUTPUT}/>',
    "ticks": f'<Int32 name="ticks" valueReference="32" {_OUTPUT}/>',
    "events": f'<Int32 name="events" valueReference="33" {_OUTPUT}/>',
    "fault": '<Int32 name="fault" valueReference="34" causality="parameter" variability="tunable" start="0"/>',
    "text": '<String name="text" valueReference="35" causality="parameter" variability="fixed"><Start value="a"/>'
    "</String>",
    "blob": '<Binary name="blob" valueReference="36" causality="input"><Start value="00"/></Binary>',
    "clock": '<Clock name="clock" valueReference="40" causality="input" intervalVariability="fixed"/>',
}


@cache
def _library() -> bytes:
    import tempfile

    headers = Path(fmpy.__file__).parent / "c-code"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "types.so"
        flags = ["-std=gnu99", "-O1", "-shared", "-fPIC", f"-I{headers}", "-o", str(path)]
        subprocess.run([*compiler(), *flags, *map(str, SOURCES)], check=True, timeout=300)
        return path.read_bytes()


def types3(path: Path, *changes: tuple[str, str], without: Iterable[str] = ()) -> Path:
    """Write the FMU, with changes to its description (old, new) and without some variables."""
    listed = "".join(text for name, text in VARIABLES.items() if name not in set(without))
    outputs = "".join(
        f'<Output valueReference="{text.split("valueReference=")[1].split(chr(34))[1]}"/>'
        for name, text in VARIABLES.items()
        if _OUTPUT in text and name not in set(without)
    )
    xml = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" modelName="types" '
        'instantiationToken="types"><CoSimulation modelIdentifier="types" canGetAndSetFMUState="true" '
        'canSerializeFMUState="true" canHandleVariableCommunicationStepSize="true" hasEventMode="true"/>'
        '<TypeDefinitions><EnumerationType name="Gear"><Item name="first" value="1"/><Item name="second" value="2"/>'
        f"</EnumerationType></TypeDefinitions><ModelVariables>{listed}</ModelVariables>"
        f"<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )
    for old, new in changes:
        assert old in xml
        xml = xml.replace(old, new)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.writestr(f"binaries/{fmpy.platform_tuple}/types{fmpy.sharedLibraryExtension}", _library())
    return path
