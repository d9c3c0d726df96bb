"""What is kept between commands: damaged in any way it is made again, and nobody notices."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import lief
import pytest
from thorough import landing, nightly, some

from friction_fmus import build, fmu
from friction_fmus.study.steps import CACHE, StepCache
from harness import FmuError, FmuPart, System
from harness.compiling import engine_library
from harness.compiling.platforms import NATIVE, Platform, compiled

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "study"))
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "half": lambda content: content[: len(content) // 2],
    "one byte short": lambda content: content[:-1],
    "zeros": lambda content: bytes(len(content)),
    "one bit": lambda content: (
        content[: len(content) // 2] + bytes([content[len(content) // 2] ^ 1]) + content[len(content) // 2 + 1 :]
    ),
    "too long": lambda content: content + b"\0",
}


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache with one FMU, its library and the engine."""
    folder = tmp_path_factory.mktemp("cache")
    before = os.environ.get("FRICTION_FMUS_CACHE")
    os.environ["FRICTION_FMUS_CACHE"] = str(folder)
    try:
        build("Coulomb", folder / "out")
        engine_library.library.__wrapped__()
    finally:
        os.environ.pop("FRICTION_FMUS_CACHE") if before is None else os.environ.update(FRICTION_FMUS_CACHE=before)
    return folder


@pytest.fixture
def used(cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FRICTION_FMUS_CACHE", str(cache))
    return cache


def only(folder: Path, pattern: str) -> Path:
    (path,) = folder.glob(pattern)
    return path


@nightly
@pytest.mark.parametrize("damage", some([*DAMAGES], ["one bit"]))
def test_a_damaged_fmu_is_built_again(used: Path, tmp_path: Path, damage: str) -> None:
    good = (used / "out" / "Coulomb.fmu").read_bytes()
    kept = only(used, "Coulomb-*.fmu")
    kept.write_bytes(DAMAGES[damage](good))
    assert build("Coulomb", tmp_path).read_bytes() == good
    assert kept.read_bytes() == good


@landing
@pytest.mark.parametrize("damage", some([*DAMAGES], ["one bit"]))
def test_a_damaged_library_is_compiled_again(used: Path, tmp_path: Path, damage: str) -> None:
    good = (used / "out" / "Coulomb.fmu").read_bytes()
    library = only(used / "libraries", "Coulomb-*.so")
    content = library.read_bytes()
    library.write_bytes(DAMAGES[damage](content))
    only(used, "Coulomb-*.fmu").unlink()
    assert build("Coulomb", tmp_path).read_bytes() == good
    assert library.read_bytes() == content


@nightly
@pytest.mark.parametrize("damage", some(["half", "one bit"], ["one bit"]))
def test_a_damaged_engine_is_compiled_again(used: Path, damage: str) -> None:
    engine = only(used / "libraries", "engine-*.so")
    content = engine.read_bytes()
    engine.unlink()  # it is loaded here: what is written into it ends this process
    engine.write_bytes(DAMAGES[damage](content))
    run = "from harness import System, CallablePart as C\n"
    run += "System([C('a', lambda t, u, x: t, outputs=['y'])]).run(stop=1.0, step=0.5)"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", run], env=environment, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert engine.read_bytes() == content


def test_a_hash_that_is_missing_or_of_another_file_is_made_again(used: Path, tmp_path: Path) -> None:
    kept = only(used, "Coulomb-*.fmu")
    good, beside = kept.read_bytes(), kept.with_name(kept.name + ".sha256")
    for text in (None, b"", b"0" * 64, b"\xff"):
        beside.unlink() if text is None else beside.write_bytes(text)
        assert build("Coulomb", tmp_path).read_bytes() == good
        assert beside.read_bytes() == hashlib.sha256(good).hexdigest().encode()


@nightly
def test_processes_that_build_at_the_same_time(used: Path, tmp_path: Path) -> None:
    good = only(used, "Coulomb-*.fmu").read_bytes()
    for path in (only(used, "Coulomb-*.fmu"), only(used / "libraries", "Coulomb-*.so")):
        path.write_bytes(path.read_bytes()[:1000])
    command = [sys.executable, "-m", "friction_fmus", "build", "Coulomb", "-o"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    builds = [subprocess.Popen([*command, str(tmp_path / str(k))], env=environment) for k in range(4)]
    assert [each.wait(300) for each in builds] == [0] * 4
    assert {(tmp_path / str(k) / "Coulomb.fmu").read_bytes() for k in range(4)} == {good}
    assert only(used, "Coulomb-*.fmu").read_bytes() == good
    assert not [path for path in used.rglob(".*")]


def test_a_damaged_piece_of_a_study_is_done_again(tmp_path: Path) -> None:
    from test_study_jobs import CALLS, run_steps, steps

    CALLS.clear()
    store = StepCache(tmp_path / CACHE)
    first = run_steps(steps(1.0), store, None)
    (piece,) = store.folder.glob("*.json")
    text = piece.read_text(encoding="utf-8")
    assert "2.0" in text
    for other in (text.replace("2.0", "3.0"), "[" * 100_000, "null", ""):
        piece.write_text(other, encoding="utf-8")
        assert run_steps(steps(1.0), StepCache(store.folder), None) == first


def segment_ends(path: Path) -> list[int]:
    """Where what a loader maps ends in the file, by lief."""
    if lief.is_macho(str(path)):
        binaries = lief.MachO.parse(str(path))  # to be kept: its segments are views of it
        return [each.fat_offset + s.file_offset + s.file_size for each in binaries for s in each.segments]
    if lief.is_pe(str(path)):
        binary = lief.PE.parse(str(path))
        return [s.offset + s.size for s in binary.sections]
    library = lief.ELF.parse(str(path))
    return [s.file_offset + s.physical_size for s in library.segments if s.type == lief.ELF.Segment.TYPE.LOAD]


LOAD = """
import sys
from pathlib import Path
from harness import FmuError, FmuPart, System
endings = []
for path in sorted(Path(sys.argv[1]).glob("*.fmu")):
    part = FmuPart("p", path)
    try:
        with System([part], start={f"p.{port.name}": 0.0 for port in part.inputs}) as system:
            system.run(stop=1e-3, step=1e-3)
        print("ran")
    except FmuError as error:
        print(error)
"""


def truncated(fmu: Path, target: Path, length: int) -> Path:
    """The FMU with a library of which the end is missing; the archive itself is in order."""
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(target, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            other.writestr(name, content[:length] if name.startswith("binaries/") else content)
    return target


@nightly
def test_a_truncated_library_in_an_fmu_is_refused(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    fmu = build_fmu("Coulomb")
    with zipfile.ZipFile(fmu) as archive:
        name = f"binaries/{fmpy.platform}/Coulomb{fmpy.sharedLibraryExtension}"
        content = archive.read(name)
    (tmp_path / "library").write_bytes(content)
    needed = max(segment_ends(tmp_path / "library"))
    lengths = [0, 10, 63, 64, 500, *range(1000, needed, 3000), needed - 1, needed]
    for index, length in enumerate(lengths):
        truncated(fmu, tmp_path / f"{index:03}.fmu", length)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", LOAD, str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert len(said) == len(lengths)
    assert all(s.startswith("cannot load ") and s.endswith("export it again for this platform") for s in said[:-1])
    assert f"its library Coulomb.so is truncated: {needed - 1000} bytes are missing at the end" in said[5]
    assert "is truncated: 1 bytes are missing" in said[-2]
    assert said[-1] == "ran"


def test_a_truncated_library_of_a_part(build_fmu: Callable[..., Path], tmp_path: Path) -> None:
    part = FmuPart("p", truncated(build_fmu("Coulomb"), tmp_path / "short.fmu", 5000))
    with (
        System([part], start={f"p.{port.name}": 0.0 for port in part.inputs}) as system,
        pytest.raises(FmuError, match=r"short.fmu: its library Coulomb.so is truncated"),
    ):
        system.run(stop=1e-3, step=1e-3)


def check_end_of_library(platform: Platform, folder: Path) -> None:
    from harness.compiling.platforms import missing_bytes

    content = compiled(platform, engine_library.sources(), "engine", headers=False)
    path = folder / f"engine{platform.suffix}"
    path.write_bytes(content)
    ends = segment_ends(path)
    assert missing_bytes(path) == 0
    for lost in (1, 77, 5000):
        path.write_bytes(content[: max(ends) - lost])
        assert missing_bytes(path) == lost
    for length in range(0, 600, 7):
        path.write_bytes(content[:length])
        assert missing_bytes(path) != 0


def test_the_end_of_a_library_is_where_lief_sees_it(tmp_path: Path) -> None:
    check_end_of_library(NATIVE, tmp_path)


@nightly
def test_versions_that_share_a_cache_keep_their_fmus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The path that an earlier version was given still holds what that version built."""
    monkeypatch.setenv("FRICTION_FMUS_CACHE", str(tmp_path / "cache"))
    source = tmp_path / "Coulomb.c"
    code = (ROOT / "fmu_src" / "friction" / "Coulomb.c").read_text(encoding="utf-8")
    source.write_text(code, encoding="utf-8")
    before = fmu(source)
    content = before.read_bytes()
    other = code.replace(", opposes v", ", against v")
    assert other != code
    source.write_text(other, encoding="utf-8")
    after = fmu(source)
    assert after.read_bytes() != content
    assert before.read_bytes() == content
