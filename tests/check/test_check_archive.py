"""Each rule of the archive, and of the other XML files in it, finds its fault and nothing else does."""

from __future__ import annotations

import os
import re
import stat
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from check.broken import XML, contents, zipped
from check.hostile_zips import REFUSED, Spoil, packed
from thorough import nightly, some

from friction_fmus import fmu
from friction_fmus.check import RULES, Finding, check
from friction_fmus.errors import FrictionError, UnknownNameError
from harness import FmuError, FmuPart, System, open_archive

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
BUILD = "sources/buildDescription.xml"
FLANGE = (
    '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals><Terminal name="flange" matchingRule="plug">'
    '<TerminalMemberVariable variableName="v" memberName="v" variableKind="signal"/>'
    '<TerminalMemberVariable variableName="F" memberName="F" variableKind="signal"/>'
    '<TerminalGraphicalRepresentation x1="-10" y1="-10" x2="10" y2="10" iconBaseName="flange"/>'
    "</Terminal></Terminals></fmiTerminalsAndIcons>"
)
UPSIDE_DOWN = (
    '<GraphicalRepresentation><CoordinateSystem x1="1" y1="1" x2="-1" y2="-1" suggestedScalingFactorTo_mm="1"/>'
    "</GraphicalRepresentation>"
)
ELF = (b"\x7fELF\x02\x01\x01".ljust(18, b"\0") + b"\x3e\0").ljust(200, b"\0")  # of x86_64
PE64 = (b"MZ".ljust(60, b"\0") + b"\x40\0\0\0PE\0\0\x64\x86").ljust(200, b"\0")
BUILDING = (
    '<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="LuGre">'
    '<SourceFileSet language="C99"><SourceFile name="LuGre.c"/></SourceFileSet>'
    "</BuildConfiguration></fmiBuildDescription>"
)

Members = dict[str, bytes | None]

# rule -> other members, and what the message must name
FAULTS: dict[str, list[tuple[Callable[[dict[str, bytes]], Members], str]]] = {
    "path-outside": [
        (lambda _: {"../evil.txt": b"x"}, "../evil.txt"),
        (lambda _: {"resources/../../evil.txt": b"x"}, "evil.txt"),
        (lambda _: {"/evil.txt": b"x"}, "/evil.txt"),
        (lambda _: {"C:/evil.txt": b"x"}, "C:/evil.txt"),
    ],
    "path-backslash": [(lambda _: {"resources\\table.csv": b"x"}, "resources\\\\table.csv")],
    "path-dot": [
        (lambda _: {"./resources/a.csv": b"x"}, "./resources/a.csv"),
        (lambda _: {"resources//a": b"x"}, "//"),
    ],
    "path-duplicate": [(lambda _: {"resources/a": b"x", "resources/A": b"x"}, "resources/a")],
    "no-model-description": [
        (lambda m: {XML: None}, "export it again"),
        (lambda m: {XML: None, f"LuGre/{XML}": m[XML]}, "LuGre/modelDescription.xml"),
    ],
    "no-code": [(lambda m: {n: None for n in m if n.startswith(("binaries/", "sources/"))}, "neither")],
    "platform-unknown": [
        (lambda _: {"binaries/amiga/LuGre.so": b"x"}, "amiga"),
        (lambda _: {"binaries/x86_64-windows/LuGre.dll": b"x"}, "rename it to win64"),
    ],
    "binary-misnamed": [
        (lambda _: {"binaries/win32/lugre.dll": b"x"}, "binaries/win32/LuGre.dll"),
        (lambda _: {"binaries/x86_64-windows/LuGre.so": b"x"}, "binaries/x86_64-windows/LuGre.dll"),
    ],
    "binary-format": [
        (lambda _: {"binaries/win64/LuGre.dll": ELF}, "no library for win64"),
        (lambda _: {"binaries/linux32/LuGre.so": ELF}, "no library for linux32"),
        (lambda _: {"binaries/win32/LuGre.dll": PE64}, "no library for win32"),
    ],
    "source-missing": [(lambda _: {"sources/LuGre.c": None}, "LuGre.c")],
    "source-undeclared": [(lambda m: {XML: _without_source_files(m[XML])}, "sources/LuGre.c")],
    "source-headers": [(lambda _: {"sources/fmi2Functions.h": b"x"}, "fmi2Functions.h")],
    "file-unknown": [(lambda _: {"readme.txt": b"x"}, "readme.txt"), (lambda _: {"data/a": b"x"}, "'data'")],
    "documentation-entry": [(lambda _: {"documentation/index.html": None}, "index.html")],
    "licence-misplaced": [(lambda _: {"documentation/license.txt": b"x"}, "documentation/licenses/license.txt")],
    "terminals": [
        (lambda _: {TERMINALS: FLANGE.replace('matchingRule="plug"', "").encode()}, "matchingRule"),
        (lambda _: {TERMINALS: FLANGE.replace('"3.0"', '"3.1"').encode()}, "3.1"),
    ],
    "terminals-variable": [(lambda _: {TERMINALS: FLANGE.replace('"F" m', '"G" m').encode()}, "'G'")],
    "terminals-name": [
        (
            lambda _: {TERMINALS: FLANGE.replace('memberName="v"', 'memberName="F"').encode()},
            "2 members have the name 'F'",
        ),
        (
            lambda _: {TERMINALS: re.sub("(<Terminal .*?</Terminal>)", r"\1\1", FLANGE).encode()},
            "2 terminals have the name 'flange'",
        ),
    ],
    "terminals-area": [
        (lambda _: {TERMINALS: FLANGE.replace('x2="10"', 'x2="-10"').encode()}, "an area"),
        (
            lambda _: {TERMINALS: FLANGE.replace("iconBase", 'defaultConnectionStrokeSize="0" iconBase').encode()},
            "stroke",
        ),
        (lambda _: {TERMINALS: FLANGE.replace("<Terminals>", f"{UPSIDE_DOWN}<Terminals>").encode()}, "bottom left"),
    ],
    "terminals-icon": [(lambda _: {TERMINALS: FLANGE.encode(), "terminalsAndIcons/flange.png": None}, "flange.png")],
    "build-description": [
        (lambda _: {BUILD: BUILDING.replace("LuGre.c", "Other.c").encode()}, "Other.c"),
        (lambda _: {BUILD: BUILDING.replace("BuildConfiguration", "Configuration").encode()}, "Configuration"),
        (lambda _: {BUILD: BUILDING.replace('modelIdentifier="LuGre"', 'modelIdentifier="L"').encode()}, "'L'"),
        (
            lambda _: {BUILD: BUILDING.replace("<SourceFileSet", '<SourceFileSet compilerOptions="-O2"').encode()},
            "no c",
        ),
        (lambda _: {BUILD: _building('<SourceFile name="LuGre.c"/>')}, "SourceFile 'LuGre.c' is already"),
        (lambda _: {BUILD: _building(2 * '<PreprocessorDefinition name="A"/>')}, "PreprocessorDefinition 'A'"),
        (lambda _: {BUILD: _building('<IncludeDirectory name="nowhere"/>')}, "'sources/nowhere'"),
    ],
}
COMPANIONS = {
    "path-outside": {"file-unknown"},
    "path-backslash": {"file-unknown"},
    "no-model-description": {"file-unknown"},
    "no-code": {"source-missing"},
    "binary-misnamed": {"platform-unknown"},
}
BY_HAND = {
    "zip-damaged",
    "source-no-build",
    "binary-truncated",
    "path-symlink",
    "zip-version",
    *(rule for rule, _ in REFUSED.values()),
}
"""Made below, in test_check_damaged.py and in test_check_fmi3.py."""

CASES = [
    pytest.param(rule, change, words, id=f"{rule}-{k}")
    for rule, cases in FAULTS.items()
    for k, (change, words) in enumerate(cases)
]


def _building(more: str) -> bytes:
    return BUILDING.replace("</SourceFileSet>", f"{more}</SourceFileSet>").encode()


def _without_source_files(xml: bytes) -> bytes:
    return re.sub(rb"<SourceFiles>.*?</SourceFiles>", b"", xml, flags=re.S)


@pytest.fixture(scope="session")
def members(build_fmu: Callable[..., Path]) -> dict[str, bytes]:
    return contents(build_fmu("LuGre"))


@pytest.fixture
def icon() -> dict[str, bytes]:
    return {"terminalsAndIcons/flange.png": b"png", "terminalsAndIcons/icon.png": b"png"}


def one(found: list[Finding], rule: str) -> Finding:
    (finding,) = found
    assert (finding.rule, finding.severity) == (rule, RULES[rule].severity)
    return finding


def test_every_rule_has_a_fault() -> None:
    assert set(FAULTS) | BY_HAND == {rule.id for rule in RULES.values() if rule.kind == "archive"}


@pytest.mark.parametrize(("rule", "change", "words"), CASES)
def test_a_fault_is_found_by_its_rule_and_no_other(
    members: dict[str, bytes],
    icon: dict[str, bytes],
    tmp_path: Path,
    rule: str,
    change: Callable[[dict[str, bytes]], Members],
    words: str,
) -> None:
    found = check(zipped(members | icon | change(members), tmp_path / "a.fmu"), static=True)
    own = [finding for finding in found if finding.rule == rule]
    assert any(words in finding.message for finding in own), found
    assert all(finding.severity == RULES[rule].severity for finding in own)
    assert {finding.rule for finding in found} - {rule} <= COMPANIONS.get(rule, set()), found


def test_good_side_files_are_no_fault(members: dict[str, bytes], icon: dict[str, bytes], tmp_path: Path) -> None:
    good = {TERMINALS: FLANGE.encode(), BUILD: BUILDING.encode()}
    assert check(zipped(members | icon | good, tmp_path / "a.fmu"), static=True) == []


@pytest.mark.parametrize("file", [TERMINALS, BUILD])
def test_side_files_are_read_with_care(members: dict[str, bytes], tmp_path: Path, file: str) -> None:
    for data, rule in ((b"<a", "xml-malformed"), (b'<!DOCTYPE a [<!ENTITY e "e">]><a>&e;</a>', "xml-entities")):
        assert one(check(zipped(members | {file: data}, tmp_path / "a.fmu"), static=True), rule).file == file


# ---- archives that the zip module does not write by itself


def test_what_is_no_zip(tmp_path: Path) -> None:
    path = tmp_path / "text.fmu"
    for data in (b"", b"this is no archive", b"PK\x03\x04" + bytes(100)):
        path.write_bytes(data)
        assert "text.fmu" in one(check(path), "not-a-zip").message


def test_what_cannot_be_opened_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FrictionError, match="No such file"):
        check(tmp_path / "none.fmu")
    with pytest.raises(FrictionError, match="directory"):
        check(tmp_path)
    (tmp_path / "a.fmu").write_bytes(b"x")
    with pytest.raises(UnknownNameError, match="did you mean not-a-zip"):
        check(tmp_path / "a.fmu", ignore=["not-zip"])
    with pytest.raises(FrictionError, match="positive"):
        check(tmp_path / "a.fmu", time_limit=0.0)


def test_a_damaged_member(members: dict[str, bytes], tmp_path: Path) -> None:
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w") as archive:  # stored, so that the bytes can be found
        for name, data in (members | {"resources/table.csv": b"0123456789"}).items():
            archive.writestr(name, data)
    path.write_bytes(path.read_bytes().replace(b"0123456789", b"0123456780"))
    assert "resources/table.csv" in one(check(path, static=True), "zip-damaged").message


def test_a_damaged_model_description(members: dict[str, bytes], tmp_path: Path) -> None:
    path = tmp_path / "a.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    path.write_bytes(path.read_bytes().replace(b'fmiVersion="2.0"', b'fmiVersion="2.1"'))
    assert {finding.rule for finding in check(path)} == {"zip-damaged"}
    with pytest.raises(FmuError, match=r"cannot read modelDescription\.xml"):
        open_archive(path)


def test_a_symbolic_link(members: dict[str, bytes], tmp_path: Path) -> None:
    path = zipped(members, tmp_path / "a.fmu")
    link = zipfile.ZipInfo("resources/passwd")
    link.create_system, link.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(link, "/etc/passwd")
    assert "resources/passwd" in one(check(path), "path-symlink").message
    with pytest.raises(FmuError, match="symbolic link"):
        open_archive(path)


def test_two_members_of_one_name(members: dict[str, bytes], tmp_path: Path) -> None:
    path = zipped(members, tmp_path / "a.fmu")
    with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as archive:
        warnings.simplefilter("ignore")  # zipfile warns of what is done here
        archive.writestr("model.png", b"another")
    assert "model.png" in one(check(path), "path-duplicate").message
    with pytest.raises(FmuError, match=r"two members 'model\.png'"):
        open_archive(path)


def test_an_encrypted_member(members: dict[str, bytes], tmp_path: Path) -> None:
    """The flag of the directory says so; nothing needs to be encrypted for that."""
    path = zipped(members, tmp_path / "a.fmu")
    data = bytearray(path.read_bytes())
    entry = data.index(b"PK\x01\x02", data.index(b"PK\x01\x02") + 4)
    data[entry + 8] |= 1
    path.write_bytes(data)
    assert "password" in one(check(path, static=True), "zip-encrypted").message


def test_another_method_of_compression(members: dict[str, bytes], tmp_path: Path) -> None:
    path = zipped(members, tmp_path / "a.fmu")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("resources/a", b"a" * 1000)
    assert "bzip2" in one(check(path, static=True), "zip-method").message


@pytest.mark.parametrize("spoil", some([*REFUSED], [*REFUSED][::3]), ids=lambda spoil: spoil.__name__)
def test_what_the_harness_refuses_is_a_finding(members: dict[str, bytes], tmp_path: Path, spoil: Spoil) -> None:
    path = packed(tmp_path / "a.fmu", members)
    spoil(path)
    finding = one(check(path), REFUSED[spoil][0])
    assert REFUSED[spoil][1] in finding.message
    assert len(finding.message) < 300


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.fmu")
    with pytest.raises(FrictionError, match="not a regular file"):
        check(tmp_path / "a.fmu")


def test_a_newer_version_of_the_format(members: dict[str, bytes], tmp_path: Path) -> None:
    """Large files are written so; here by request."""
    path = zipped(members, tmp_path / "a.fmu")
    with zipfile.ZipFile(path, "a") as archive, archive.open("resources/a", "w", force_zip64=True) as file:
        file.write(b"a")
    assert "4.5" in one(check(path, static=True), "zip-version").message


@nightly
def test_a_bomb_is_not_unpacked(members: dict[str, bytes], tmp_path: Path) -> None:
    path = zipped(members, tmp_path / "a.fmu")
    zeros = bytes(1 << 24)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("resources/zeros", "w") as file:
        for _ in range(17):
            file.write(zeros)
    assert path.stat().st_size < 2e6
    assert str(17 << 24)[:2] in one(check(path), "zip-bomb").message
    with pytest.raises(FmuError, match="unpack to"):
        open_archive(path)


def test_entities_are_refused_by_the_harness_too(members: dict[str, bytes], tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("do not tell")
    text = members[XML].decode()
    start = text.index("<fmiModelDescription")
    evil = f'{text[:start]}<!DOCTYPE x [<!ENTITY e SYSTEM "{secret.as_uri()}">]>{text[start:]}'
    with pytest.raises(FmuError, match="DOCTYPE"):
        open_archive(zipped(members | {XML: evil.encode()}, tmp_path / "a.fmu"))


def test_an_ssp_is_checked_with_its_fmus(tmp_path: Path) -> None:
    path = tmp_path / "axis.ssp"
    with System([FmuPart("friction", fmu("Coulomb"))], start={"friction.v": 0.1, "friction.F_ext": 0.0}) as system:
        system.to_ssp(path)
    assert check(path, static=True) == []
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    broken = tmp_path / "Coulomb.fmu"
    with zipfile.ZipFile(fmu("Coulomb")) as archive:
        parts = {n: archive.read(n) for n in archive.namelist() if not n.startswith(("binaries/", "sources/"))}
    zipped(parts, broken)
    ssd = members["SystemStructure.ssd"].replace(b'name="F"', b'name="no_F" bogus="1"')
    zipped({"SystemStructure.ssd": ssd, "resources/Coulomb.fmu": broken.read_bytes()}, path)
    found = {finding.rule: finding for finding in check(path, static=True)}
    assert "bogus" in found["ssp"].message and found["ssp"].source == "SSP 1.0, 5"
    assert found["no-code"].file == "resources/Coulomb.fmu/"
