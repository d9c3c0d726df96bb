"""Terminals and icons of every FMU of the catalogue: valid, drawn, and with the right signs."""

from __future__ import annotations

import re
import struct
import zipfile
from pathlib import Path

import fmpy
from lxml import etree
from shell.instance import Instance, Library

from friction_fmus import build

SVG = "{http://www.w3.org/2000/svg}"

INPUT_V = {"flange": ("v", "F", "inflow")}
FLANGES = {
    "Mass": {"flange": ("v", "F_friction", "outflow")},
    "Belt": {"flange": ("v_rel", "F_friction", "outflow")},
    "TwoMass": {"flange_a": ("v1", "F_friction1", "outflow"), "flange_b": ("v2", "F_friction2", "outflow")},
    "KarnoppMass": {"flange": ("v", "F_ext", "inflow")},
    "SwitchMass": {"flange": ("v", "F_load", "inflow")},
    "FrenkelKontorova": {"flange": ("v", "F_drive", "inflow")},
}
ON_A_MASS = (
    *("BlimanSorine", "Bristle", "BurridgeKnopoff", "Coulomb", "Dahl", "DeadZoneTorque", "ElastoPlastic", "GMS"),
    *("FrenkelKontorovaTomlinson", "GenericAsperity", "Karnopp", "Leuven", "LuGre", "MaxwellSlip", "ModifiedLeuven"),
    *("PrandtlTomlinson", "RateAndState", "ResetIntegrator", "SevenParameter", "Stiction", "Stribeck", "Tustin"),
    *("LoadDependentDahl", "Viscous"),
)
EXPECTED = FLANGES | dict.fromkeys(ON_A_MASS, INPUT_V)
"""Flanges of the blocks by their equations; the others have none."""

REFERENCES = {"Profile", "Sine", "Multisine", "Record", "PID", "CascadePPI", "StaticFeedforward", "LuGreFeedforward"}
"""Some that give or take a reference with its derivatives."""


KIND_ICONS = {
    "Stribeck": "friction",
    "LuGre": "presliding",
    "Actuator": "plant",
    "PID": "compensator",
    "Sine": "signal",
}
"""One block of each kind of icon: friction that is elastic at rest has one of its own."""


def read(library: Library) -> etree._Element:
    return etree.parse(library.folder / "terminalsAndIcons" / "terminalsAndIcons.xml").getroot()


def members(terminal: etree._Element) -> dict[str, tuple[str, str]]:
    return {
        str(m.get("memberName")): (str(m.get("variableName")), str(m.get("variableKind")))
        for m in terminal.iter("TerminalMemberVariable")
    }


def test_meets_the_schema_of_fmi_3(library: Library) -> None:
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(read(library).getroottree())


def test_members_are_ports_of_the_block(library: Library) -> None:
    root = read(library)
    assert root.get("fmiVersion") == "3.0"
    names = [terminal.get("name") for terminal in root.iter("Terminal")]
    assert len(set(names)) == len(names)
    for terminal in root.iter("Terminal"):
        found = members(terminal)
        assert len(found) == len(terminal.findall("TerminalMemberVariable")) > 1  # unique names, needed by the rule
        assert terminal.get("matchingRule") in ("plug", "bus")
        for variable, kind in found.values():
            assert library.variables[variable].causality in ("input", "output")
            assert kind in ("signal", "inflow", "outflow")


def test_flanges_are_those_of_the_equations(library: Library) -> None:
    plugs = {
        str(terminal.get("name")): members(terminal)
        for terminal in read(library).iter("Terminal")
        if terminal.get("matchingRule") == "plug"
    }
    expected = {
        name: {"v": (v, "signal"), "F": (F, kind)}
        for name, (v, F, kind) in EXPECTED.get(library.identifier, {}).items()
    }
    assert plugs == expected


def test_references_are_those_with_derivatives(library: Library) -> None:
    buses = {t.get("name"): members(t) for t in read(library).iter("Terminal") if t.get("matchingRule") == "bus"}
    signal = {name: (name, "signal") for name in ("r", "rd", "rdd") if name in library.variables}
    if library.identifier in REFERENCES:
        assert buses == {"reference": signal}
    elif library.identifier == "Circle":
        assert buses["reference_y"] == {"r": ("y", "signal"), "rd": ("yd", "signal"), "rdd": ("ydd", "signal")}
    else:
        assert buses in ({}, {"reference": signal})


def test_flows_have_the_direction_that_they_say(library: Library) -> None:
    """Power flows into friction; a force that flows into a mass speeds it up, one that flows out slows it down."""
    for velocity, force, kind in EXPECTED.get(library.identifier, {}).values():
        sign = 1.0 if kind == "inflow" else -1.0
        if library.variables[velocity].causality == "input":
            with Instance(library) as run:
                run.initialise()
                run.set({velocity: 0.5})
                run.step(0.0, 0.02)
                assert sign * run.get1(force) > 0.0
        else:
            speeds = []
            for value in (0.0, 10.0):
                with Instance(library) as run:
                    run.initialise()
                    run.set({force: value} | ({"v_belt": 0.0} if "v_belt" in library.variables else {}))
                    run.step(0.0, 0.02)
                    speeds.append(run.get1(velocity))
            assert sign * (speeds[1] - speeds[0]) > 0.0


def test_every_image_is_there_and_where_it_says(library: Library) -> None:
    root, folder = read(library), library.folder / "terminalsAndIcons"
    system, icon = root.find("GraphicalRepresentation/CoordinateSystem"), root.find("GraphicalRepresentation/Icon")
    corners = ("x1", "y1", "x2", "y2")
    assert [system.get(corner) for corner in corners] == [icon.get(corner) for corner in corners]
    assert float(system.get("suggestedScalingFactorTo_mm")) == 0.1  # 20 mm, the default size of an icon
    places = set()
    for graphic in root.iter("TerminalGraphicalRepresentation"):
        x1, y1, x2, y2 = (float(graphic.get(corner)) for corner in corners)
        assert x2 - x1 == y2 - y1 == 20.0
        assert abs(x1 + x2) == 200.0 and abs(y1 + y2) <= 180.0  # on the left or right edge
        places.add((x1, y1))
        assert (folder / f"{graphic.get('iconBaseName')}.png").is_file()
    assert len(places) == len(root.findall("Terminals/Terminal"))
    images = {path.stem for path in folder.glob("*.png")}
    assert images == {path.stem for path in folder.glob("*.svg")}
    assert images == {"icon", *(str(g.get("iconBaseName")) for g in root.iter("TerminalGraphicalRepresentation"))}


def test_vector_images_are_small_and_refer_to_nothing_outside(library: Library) -> None:
    for path in [*library.folder.glob("terminalsAndIcons/*.svg"), *library.folder.glob("documentation/*.svg")]:
        text = path.read_text(encoding="utf-8")
        assert len(text) < 15_000, path.name
        assert "<!DOCTYPE" not in text and "<script" not in text and "<dc:date>" not in text
        root = etree.fromstring(text.encode())
        assert root.tag == f"{SVG}svg" and root.get("viewBox")
        links = [value for element in root.iter() for name, value in element.attrib.items() if name.endswith("href")]
        assert all(str(link).startswith("#") for link in links), path.name
        assert all(part.startswith("#") for part in re.findall(r"url\((.*?)\)", text))


def test_pixel_images_are_square_and_carry_no_date(library: Library) -> None:
    icon = (library.folder / "terminalsAndIcons" / "icon.png").read_bytes()
    assert (library.folder / "model.png").read_bytes() == icon
    for path in library.folder.glob("terminalsAndIcons/*.png"):
        content = path.read_bytes()
        assert content.startswith(b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">II", content[16:24])
        assert width == height
        assert b"tEXt" not in content and b"tIME" not in content
    assert struct.unpack(">I", icon[16:20]) == (200,)


def test_icons_show_a_curve_or_a_sketch(library: Library) -> None:
    """More than the frame and the lines of the axes, which have two points."""
    root = etree.parse(library.folder / "terminalsAndIcons" / "icon.svg").getroot()
    drawn = [path for path in root.iter(f"{SVG}path") if len(re.findall("[MLC]", str(path.get("d")))) > 3]
    assert len(drawn) >= 2


def test_the_icon_is_that_beside_the_block_or_that_of_its_kind(tmp_path: Path) -> None:
    """The pairs differ, so that no block shows the icon of another kind."""
    root = Path(__file__).parents[2]
    shown = {
        "Mass": root / "fmu_src" / "plants" / "Mass",
        **{name: root / "friction_fmus" / "fmi" / "icons" / icon for name, icon in KIND_ICONS.items()},
    }
    for name, drawn in shown.items():
        with zipfile.ZipFile(build(name, tmp_path)) as archive:
            assert archive.read("terminalsAndIcons/icon.png") == drawn.with_suffix(".png").read_bytes(), name
            assert archive.read("terminalsAndIcons/icon.svg") == drawn.with_suffix(".svg").read_bytes(), name
    assert len({path.with_suffix(".png").read_bytes() for path in shown.values()}) == len(shown)


def test_rotational_twins_have_flanges_of_their_own_kind(tmp_path: Path) -> None:
    kinds = {}
    for domain in ("translational", "rotational"):
        folder = Path(fmpy.extract(str(build("Stribeck", tmp_path, domain=domain))))
        root = etree.parse(folder / "terminalsAndIcons" / "terminalsAndIcons.xml").getroot()
        (terminal,) = root.iter("Terminal")
        assert members(terminal) == {"v": ("v", "signal"), "F": ("F", "inflow")}
        kinds[domain] = terminal.get("terminalKind")
        units = {v.name: v.unit for v in fmpy.read_model_description(str(folder)).modelVariables}
        assert (units["v"], units["F"]) == {"translational": ("m/s", "N"), "rotational": ("rad/s", "N.m")}[domain]
    assert kinds["translational"] != kinds["rotational"]
