"""SSP archives as other tools write them."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

NAMESPACES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for prefix, name in {
        "ssd": "Description",
        "ssc": "Common",
        "ssv": "ParameterValues",
        "ssm": "ParameterMapping",
    }.items()
)
UNITS = """<ssd:Units>
  <ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
  <ssc:Unit name="kN"><ssc:BaseUnit kg="1" m="1" s="-2" factor="1000"/></ssc:Unit>
  <ssc:Unit name="inch"><ssc:BaseUnit m="1" factor="0.0254"/></ssc:Unit>
</ssd:Units>"""

POND = """<ssd:Units>
  <ssc:Unit name="pond"><ssc:BaseUnit kg="1" m="1" s="-2" factor="0.00980665"/></ssc:Unit>
</ssd:Units>"""
"""A unit that no table knows."""


def ssd(system: str, rest: str = UNITS) -> str:
    """An SSD around the content of its outermost system."""
    return (
        f'<ssd:SystemStructureDescription {NAMESPACES} version="1.0" name="bench">'
        f'<ssd:System name="root">{system}</ssd:System>{rest}</ssd:SystemStructureDescription>'
    )


def parameter_set(parameters: str, units: str = "") -> str:
    """An SSV document around its parameters."""
    return (
        f'<ssv:ParameterSet {NAMESPACES} version="1.0" name="set">'
        f"<ssv:Parameters>{parameters}</ssv:Parameters>{units}</ssv:ParameterSet>"
    )


def real(name: str, value: float, unit: str | None = None) -> str:
    stated = "" if unit is None else f' unit="{unit}"'
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value!r}"{stated}/></ssv:Parameter>'


def inline(*parameters: str, units: str = "", **attributes: str) -> str:
    """A parameter binding with its parameters in it."""
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    values = parameter_set("".join(parameters), units)
    return f"<ssd:ParameterBinding{text}><ssd:ParameterValues>{values}</ssd:ParameterValues></ssd:ParameterBinding>"


def component(name: str, bindings: str = "", source: str = "resources/probe.fmu", connectors: str | None = None) -> str:
    """A probe FMU with connectors for all its inputs and outputs."""
    if connectors is None:
        connectors = (
            '<ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>'
            '<ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector>'
            '<ssd:Connector name="n" kind="input"/>'
            '<ssd:Connector name="twice_n" kind="output"/>'
        )
    bound = f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""
    return (
        f'<ssd:Component name="{name}" source="{source}"><ssd:Connectors>{connectors}</ssd:Connectors>'
        f"{bound}</ssd:Component>"
    )


def connection(start: str, end: str, content: str = "", **attributes: str) -> str:
    """``connection("a.y", "b.u")``; an end without a dot is a connector of the system itself."""
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    for side, name in (("start", start), ("end", end)):
        element, dot, connector = name.rpartition(".")
        text += f' {side}Element="{element}"' if dot else ""
        text += f' {side}Connector="{connector}"'
    return f"<ssd:Connection{text}>{content}</ssd:Connection>"


def system(elements: str, connections: str = "", before: str = "") -> str:
    """The content of a system: what stands before its elements, the elements, the connections."""
    joined = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return f"{before}<ssd:Elements>{elements}</ssd:Elements>{joined}"


def pack(path: Path, members: Mapping[str, str | bytes | Path]) -> Path:
    """Write an archive; the FMU of a member may be given by its path."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content.read_bytes() if isinstance(content, Path) else content)
    return path
