"""Unconnected inputs, and strings: third-party FMUs state a start value for them, which a run keeps."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from harness import (
    CallablePart,
    Experiment,
    FmuPart,
    Parameter,
    ParameterSet,
    Port,
    StartValueError,
    System,
    SystemFileError,
    UnconnectedError,
    WireError,
    sweep,
    write_ssv,
)

MakeFmu = Callable[..., Path]


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def test_start_values_of_the_fmu_are_kept(foreign: MakeFmu, caplog: pytest.LogCaptureFixture) -> None:
    """A controller alone with m = 0 and reference = 1 gives Kp + Ki t; its inputs can be recorded."""
    parts = [FmuPart("pi", foreign("CONTROLLER")), FmuPart("gain", foreign("GAIN"))]
    with System(parts, ["pi.u -> gain.u"]) as system:
        assert said(caplog) == [
            "not connected: pi.m = 0.0, pi.reference = 1.0; these inputs keep the start values of their FMUs"
        ]
        assert system.start == {"pi.m": 0.0, "pi.reference": 1.0}
        result = system.run(stop=1.0, step=0.1, record=["gain.y", "pi.reference"])
    np.testing.assert_allclose(result["gain.y"], 2.0 + result["time"], rtol=1e-12)
    np.testing.assert_array_equal(result["pi.reference"], 1.0)
    assert len(said(caplog)) == 1


def test_a_sweep_says_it_once(foreign: MakeFmu, caplog: pytest.LogCaptureFixture) -> None:
    with System([FmuPart("gain", foreign("GAIN"))], experiment=Experiment(stop=0.1, step=0.1)) as system:
        found = sweep(system, [{"gain.c": 1.0}, {"gain.u": 2.0}], executor="threads", workers=2)
    np.testing.assert_array_equal(found["final(gain.y)"], [1.0, 2.0])
    assert not any(found["warnings"].to_numpy())
    assert len(said(caplog)) == 1


def test_strict_refuses_them(foreign: MakeFmu, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(UnconnectedError, match=r"gain\.u is not connected and has no start value: connect each input"):
        System([FmuPart("gain", foreign("GAIN"))], strict=True)
    with System([FmuPart("gain", foreign("GAIN"))], start={"gain.u": 1.0}, strict=True) as system:
        assert system.with_start({"gain.k": 2.0}).strict
    assert said(caplog) == []


def test_own_blocks_and_python_parts_stay_strict(build_fmu: MakeFmu) -> None:
    with pytest.raises(UnconnectedError, match=r"friction\.v is not connected"):
        System([FmuPart("friction", build_fmu("LuGre"))])
    with pytest.raises(UnconnectedError, match=r"twice\.u is not connected"):
        System([CallablePart("twice", lambda t, u, x: 2.0 * u, [Port("u", start=1.0)], ["y"])])


def test_an_input_without_a_start_value_is_refused(foreign: MakeFmu, tmp_path: Path) -> None:
    path = tmp_path / "bare.fmu"
    with ZipFile(foreign("GAIN")) as archive, ZipFile(path, "w") as changed:
        for name in archive.namelist():
            data = archive.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'causality="input"><Real start="0.0"/>', b'causality="input"><Real/>')
            changed.writestr(name, data)
    with pytest.raises(UnconnectedError, match=r"gain\.u is not connected"):
        System([FmuPart("gain", path)])


def test_system_files(foreign: MakeFmu, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "system.toml"
    part = f'[parts.gain]\nfmu = "{foreign("GAIN")}"\nstart = {{ k = 3.0 }}\n'
    path.write_text(part)
    with System.from_toml(path) as system:
        assert len(said(caplog)) == 1
        system.to_toml(tmp_path / "again.toml")
    with System.from_toml(tmp_path / "again.toml") as again:
        assert (again.start, again.strict) == (system.start, False)
    assert len(said(caplog)) == 1
    path.write_text(f"strict = true\n{part}")
    with pytest.raises(UnconnectedError):
        System.from_toml(path)
    path.write_text(f"strict = true\n{part.replace('k = 3.0', 'u = 3.0')}")
    with System.from_toml(path) as strict:
        strict.to_toml(tmp_path / "again.toml")
    with System.from_toml(tmp_path / "again.toml") as again:
        assert again.strict
    path.write_text(f"strict = 1\n{part}")
    with pytest.raises(SystemFileError, match=r"has strict = 1; give true or false"):
        System.from_toml(path)


def test_archives(foreign: MakeFmu, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """As SSP says; what was kept is written."""
    with System([FmuPart("gain", foreign("GAIN"))]) as system:
        system.to_ssp(tmp_path / "a.ssp")
    with System.from_ssp(tmp_path / "a.ssp") as again:
        assert again.start == {"gain.u": 0.0}
    assert len(said(caplog)) == 1


def test_an_optional_input_can_be_recorded(build_fmu: MakeFmu) -> None:
    """It has its start value."""
    with System([FmuPart("friction", build_fmu("LuGre"))], start={"friction.v": 1.0}) as system:
        (port,) = [port for port in system.parts["friction"].inputs if port.name == "Fn"]
        result = system.run(stop=0.1, step=0.1, record=["friction.Fn"])
    np.testing.assert_array_equal(result["friction.Fn"], port.start)


# ---- texts: the FMU gives 100 times the length of its parameter and the length of its input


def length(system: System) -> float:
    return float(system.run(stop=0.1, step=0.1)["part.length"][-1])


def test_texts_from_python(foreign: MakeFmu) -> None:
    part = FmuPart("part", foreign("TEXTS"))
    with System([part]) as system:
        assert system.start == {}  # a text that is not given is left to the FMU
        assert length(system) == 400.0
        assert length(system.with_start({"part.mode": "Überlast", "part.note": "ab"})) == 902.0  # Ü has two bytes
        assert length(system.with_start({"part.mode": "", "part.note": ""})) == 0.0
        assert length(system.with_parameters({"part.note": "abc"})) == 403.0


def test_texts_from_a_system_file(foreign: MakeFmu, tmp_path: Path) -> None:
    path = tmp_path / "system.toml"
    path.write_text(f'[parts.part]\nfmu = "{foreign("TEXTS")}"\nstart = {{ mode = "ab", note = "c" }}\n')
    with System.from_toml(path) as system:
        assert length(system) == 201.0
        system.to_toml(tmp_path / "again.toml")
    with System.from_toml(tmp_path / "again.toml") as system:
        assert length(system) == 201.0


def test_texts_from_an_archive(foreign: MakeFmu, tmp_path: Path) -> None:
    with System([FmuPart("part", foreign("TEXTS"))], start={"part.mode": "ab", "part.note": "c"}) as system:
        system.to_ssp(tmp_path / "a.ssp")
    write_ssv(ParameterSet("set", {"note": Parameter("four")}), tmp_path / "a.ssv")
    with System.from_ssp(tmp_path / "a.ssp") as system:
        assert length(system) == 201.0
        assert length(system.with_parameters(tmp_path / "a.ssv", prefix="part.")) == 204.0


@pytest.mark.parametrize("value", [5, True, "a\0b", "\ud800"])
def test_what_is_no_text_is_refused(foreign: MakeFmu, value: object) -> None:
    with (
        System([FmuPart("part", foreign("TEXTS"))], start={"part.mode": value}) as system,
        pytest.raises(StartValueError, match=r"of part\.mode is not of type String: give a value of this type"),
    ):
        system.run(stop=0.1, step=0.1)


def test_a_wire_carries_no_text(foreign: MakeFmu) -> None:
    parts = [FmuPart("part", foreign("TEXTS")), FmuPart("gain", foreign("GAIN"))]
    with pytest.raises(
        WireError, match=r"part\.note is a text .*, which cannot be connected: give it a start value instead"
    ):
        System(parts, ["gain.y -> part.note"])
