"""Files of the harness with damage of any kind: an error of the harness, or a file that is still right."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robustness.mutate import SCRAPS
from thorough import few

from friction_fmus import FrictionError, fmu
from harness import HarnessError, System, load_result, read_samples, read_ssv, save_result

ROOT = Path(__file__).parents[2]
TOML = (ROOT / "examples" / "stick_slip.toml").read_bytes()

few = settings(
    max_examples=few(120), deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@st.composite
def damage(draw: st.DrawFn) -> Callable[[bytes], bytes]:
    """Some bytes are cut out and scraps put in their place, up to three times."""
    spots = draw(
        st.lists(
            st.tuples(st.floats(0.0, 1.0), st.integers(0, 40), st.sampled_from(SCRAPS) | st.binary(max_size=4)),
            min_size=1,
            max_size=3,
        )
    )

    def apply(content: bytes) -> bytes:
        for place, length, scrap in spots:
            begin = int(place * len(content))
            content = content[:begin] + scrap + content[begin + length :]
        return content

    return apply


def read(action: Callable[[], object]) -> None:
    """Typed errors with a message only; what can be read can be closed."""
    try:
        found = action()
    except (HarnessError, FrictionError) as error:
        assert str(error)
    else:
        if isinstance(found, System):
            found.close()


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The members of an SSP file."""
    path = tmp_path_factory.mktemp("ssp") / "system.ssp"
    with System.from_toml(ROOT / "examples" / "stick_slip.toml", fmu) as system:
        system.to_ssp(path)
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A result in every format, by suffix."""
    folder = tmp_path_factory.mktemp("results")
    with System.from_toml(ROOT / "examples" / "stick_slip.toml", fmu) as system:
        result = system.run(stop=0.05, step=1e-3)
    found = {}
    for suffix in (".csv", ".parquet", ".nc", ".mat"):
        path = folder / f"result{suffix}"
        save_result(result, path)
        found[suffix] = path.read_bytes()
    return found


@few
@given(damage())
def test_system_files(tmp_path: Path, harm: Callable[[bytes], bytes]) -> None:
    path = tmp_path / "system.toml"
    path.write_bytes(harm(TOML))
    read(lambda: System.from_toml(path, fmu))
    assert [each.name for each in tmp_path.iterdir()] == ["system.toml"]


@few
@given(damage())
def test_structure_of_an_ssp_file(tmp_path: Path, archive: dict[str, bytes], harm: Callable[[bytes], bytes]) -> None:
    path = tmp_path / "system.ssp"
    with zipfile.ZipFile(path, "w") as file:
        for name, content in archive.items():
            file.writestr(name, harm(content) if name.endswith(".ssd") else content)
    read(lambda: System.from_ssp(path))
    assert [each.name for each in tmp_path.iterdir()] == ["system.ssp"]


@few
@given(damage())
def test_bytes_of_an_ssp_file(tmp_path: Path, archive: dict[str, bytes], harm: Callable[[bytes], bytes]) -> None:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in archive.items():
            file.writestr(name, content)
    path = tmp_path / "system.ssp"
    path.write_bytes(harm(whole.getvalue()))
    read(lambda: System.from_ssp(path))


@few
@given(st.sampled_from((".csv", ".parquet", ".nc", ".mat")), damage())
def test_results(tmp_path: Path, results: dict[str, bytes], suffix: str, harm: Callable[[bytes], bytes]) -> None:
    path = tmp_path / f"result{suffix}"
    path.write_bytes(harm(results[suffix]))
    read(lambda: load_result(path))


@few
@given(damage())
def test_samples_of_a_sweep(tmp_path: Path, harm: Callable[[bytes], bytes]) -> None:
    path = tmp_path / "samples.csv"
    path.write_bytes(harm(b"friction.Fc,mass.m\n1.0,2.0\n1.5,2.5\n"))
    read(lambda: read_samples([path]))


@few
@given(damage())
def test_parameter_sets(tmp_path: Path, harm: Callable[[bytes], bytes]) -> None:
    text = (
        b'<?xml version="1.0"?><ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
        b' version="1.0" name="p"><ssv:Parameters><ssv:Parameter name="friction.Fc"><ssv:Real value="1.5" unit="N"/>'
        b"</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"
    )
    path = tmp_path / "parameters.ssv"
    path.write_bytes(harm(text))
    read(lambda: read_ssv(path))
