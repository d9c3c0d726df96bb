"""Blocks and composites compiled with sanitizers: fuzzed by libFuzzer, run in threads; and with warnings as errors.

    python native_checks.py fuzz SECONDS [BLOCK...]     each target on each block for its share of the time
    python native_checks.py threads [BLOCK...]          AddressSanitizer with UBSan, then ThreadSanitizer
    python native_checks.py warnings [BLOCK...]         compiled by gcc and clang at every level of optimisation
    python native_checks.py minimise FOLDER [BLOCK...]  what fuzzing has found and kept in FOLDER, into the corpora

Corpora are in ``corpus/TARGET/BLOCK``; an input that fails is written to the working directory as ``BLOCK-crash-...``
and is run again by the target that `fuzz` leaves behind: its command is shown. ``BLOCK:3`` is the block in FMI 3.0.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from shell.facade import FACADE, IN_3
from shell.selection import COMPOSITES, built

from friction_fmus import catalogue
from harness.compiling.toolchain import header_folder

HERE = Path(__file__).parent
TARGETS = ("calls", "state")
COMPOSITE_TARGETS = ("composite",)
STRICT = ("-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-g1", "-O1")
ADDRESS = ("-fsanitize=address,undefined", *STRICT)
THREAD = ("-fsanitize=thread", *STRICT)
# a step may not take long, also with values at which a loop converges in the shortest inner steps only
FUZZER = (
    *("-fsanitize=fuzzer,address,undefined,float-cast-overflow", *STRICT),
    *("-DMOST_TRIES=200", "-DMOST_HALVINGS=10"),
)
# forgeries are short, so there is no need to begin with shorter ones
LENGTHS = {"calls": ("-max_len=600",), "state": ("-max_len=100", "-len_control=0"), "composite": ("-max_len=400",)}
COMPILERS = ("gcc", "clang")
LEVELS = ("-O0", "-O1", "-O2", "-O3")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
WORKERS = os.cpu_count() or 1


class FoundError(AssertionError):
    """A sanitizer or a check of ours has found something."""


def targets(name: str) -> tuple[str, ...]:
    """The fuzz targets of a block or composite."""
    if name.endswith(IN_3):
        return () if name.removesuffix(IN_3) in COMPOSITES else TARGETS[:1]
    return COMPOSITE_TARGETS if name in COMPOSITES else TARGETS


def unpacked(name: str, folder: Path, into: Path) -> Path:
    """The sources of an FMU, in a folder of their own: two programs of a block may be made side by side."""
    plain = name.removesuffix(IN_3)
    fmu = built(plain, folder) if name == plain else built(plain, folder / "fmi3", fmi=3)
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(into, [entry for entry in archive.namelist() if entry.startswith("sources/")])
    return into / "sources"


def compiled(name: str, source: str, flags: Sequence[str], folder: Path, compiler: str = "clang") -> Path:
    """A program of this folder around the sources of the FMU of a block or composite.

    Parameters
    ----------
    name : str
        The block or composite.
    source : str
        C file of this folder, which includes its C file as ``BLOCK``.
    flags : sequence of str
        The sanitizers.
    folder : Path
        Where the FMU and the program go.
    compiler : str
        ``clang`` or ``gcc``.
    """
    program = folder / f"{name}_{Path(source).stem}_{flags[0].partition('=')[2].replace(',', '_')}"
    plain = name.removesuffix(IN_3)
    sources = unpacked(name, folder, program.with_suffix(".fmu"))
    block = [f'-DBLOCK="{plain}.c"'] if name == plain else [f'-DBLOCK="{FACADE}"', f'-DFMI_3="fmi3_{plain}.c"']
    command = [compiler, "-std=gnu11", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror", *flags]
    command += ["-I", str(header_folder()), "-I", str(sources), *block]
    command += [str(HERE / source), *map(str, sorted(sources.glob("part_*.c")))]
    command += ["-o", str(program), "-lm", "-pthread"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise FoundError(f"{name} does not compile with {compiler} {flags[0]}: {run.stderr[:2000]}")
    return program


def corpus(target: str, name: str) -> Path:
    """Where the kept inputs of a block are."""
    return HERE / "corpus" / target / name


def fuzz(name: str, target: str, seconds: float, folder: Path, kept: Path | None = None) -> None:
    """Runs the kept inputs of a block, then new ones for a while, the same each time.

    Parameters
    ----------
    name, target : str
        Block and ``calls`` or ``state``, or composite and ``composite``.
    seconds : float
        For new inputs; 0: only the kept ones.
    folder : Path
        For the program.
    kept : Path, optional
        Where new inputs of interest are kept.

    Raises
    ------
    FoundError
        With what was found, and the command that shows it again.
    """
    program = compiled(name, f"fuzz_{target}.c", FUZZER, folder)
    found = folder / f"found_{target}" / name if kept is None else kept / target / name
    found.mkdir(parents=True, exist_ok=True)
    command = [str(program), f"-artifact_prefix={Path.cwd() / name}-", "-timeout=60", "-rss_limit_mb=2048"]
    command += [*LENGTHS[target], "-seed=1" if kept is None else "-seed=0"]
    command += [f"-max_total_time={int(seconds)}" if seconds else "-runs=0", str(found)]
    command += [str(corpus(target, name))] if corpus(target, name).is_dir() else []
    run = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if run.returncode != 0:
        progress = ("#", "INFO", "NEW_FUNC")
        report = "\n".join(line for line in run.stderr.splitlines() if not line.lstrip().startswith(progress))
        raise FoundError(f"{name}, target {target}: {report[:3000]}\nshown again by: {' '.join(command)} FILE")


def run_threads(name: str, sanitizer: Sequence[str], folder: Path) -> None:
    """Four threads with an instance each, and each of them alone, under a sanitizer.

    Raises
    ------
    FoundError
        With the report.
    """
    program = compiled(name, "threads.c", sanitizer, folder)
    run = subprocess.run([str(program)], capture_output=True, text=True, errors="replace", check=False)
    if run.returncode != 0 or run.stderr:
        raise FoundError(f"{name}, {sanitizer[0]}: {run.stdout}{run.stderr[:3000]}")


def check_warnings(name: str, folder: Path, levels: Sequence[str] = LEVELS) -> None:
    """Compile a block by each compiler at each level: some warnings come with optimisation only.

    Parameters
    ----------
    name : str
        The block.
    folder : Path
        Where its FMU and sources go.
    levels : sequence of str
        Levels of optimisation.

    Raises
    ------
    FoundError
        With the first warning.
    """
    plain = name.removesuffix(IN_3)
    sources = unpacked(name, folder, folder / f"{name}_warnings")
    files = [
        f"{plain}.c" if name == plain else f"fmi3_{plain}.c",
        *(path.name for path in sorted(sources.glob("part_*.c"))),
    ]
    for compiler, level, file in product(COMPILERS, levels, files):
        command = [compiler, "-std=c99", level, *WARNINGS, "-I", str(header_folder()), "-c", file, "-o", os.devnull]
        run = subprocess.run(command, cwd=sources, capture_output=True, text=True, check=False)
        if run.returncode != 0 or run.stderr:
            raise FoundError(f"{name}, {compiler} {level}: {run.stderr[:2000]}")


def minimise(found: Path, names: Sequence[str], most: int = 1000) -> None:
    """Replaces the corpora by inputs that reach as much: the longest, at most so many bytes for each block."""
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            for target in targets(name):
                program = compiled(name, f"fuzz_{target}.c", FUZZER, Path(folder))
                merged = Path(folder) / target / name
                merged.mkdir(parents=True)
                sources = [str(each) for each in (corpus(target, name), found / target / name) if each.is_dir()]
                command = [str(program), "-merge=1", "-timeout=60", str(merged), *sources]
                subprocess.run(command, check=True, capture_output=True)
                corpus(target, name).mkdir(parents=True, exist_ok=True)
                for old in corpus(target, name).iterdir():
                    old.unlink()
                left = most
                for path in sorted(merged.iterdir(), key=lambda path: (-path.stat().st_size, path.name)):
                    if (left := left - path.stat().st_size) >= 0:
                        (corpus(target, name) / path.name).write_bytes(path.read_bytes())


def _all(jobs: Sequence[tuple[object, ...]]) -> int:
    """Runs all jobs, shows what fails; the number that did."""
    failures = 0

    def tried(job: tuple[object, ...]) -> str:
        function, *arguments = job
        try:
            function(*arguments)  # type: ignore[operator]
        except FoundError as error:
            return str(error)
        return ""

    with ThreadPoolExecutor(WORKERS) as pool:
        for text in pool.map(tried, jobs):
            if text:
                failures += 1
                print(text, flush=True)
    print(f"{len(jobs)} runs, {failures} with a finding")
    return failures


def main(command: str, *arguments: str) -> int:
    """What the module's docstring says."""
    rest = arguments[1:] if command in ("fuzz", "minimise") else arguments
    every = (*catalogue(), *COMPOSITES)
    names = list(rest or (*every, *(name + IN_3 for name in every)))
    folder = Path(tempfile.mkdtemp(prefix="native-checks-"))
    if command == "fuzz":
        pairs = [(name, target) for name in names for target in targets(name)]
        share = max(float(arguments[0]) * WORKERS / len(pairs), 1.0)
        return _all([(fuzz, name, target, share, folder, folder / "found") for name, target in pairs])
    if command == "threads":
        return _all([(run_threads, name, flags, folder) for flags in (ADDRESS, THREAD) for name in names])
    if command == "warnings":
        return _all([(check_warnings, name, folder) for name in names])
    if command == "minimise":
        minimise(Path(arguments[0]), names)
        return 0
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
