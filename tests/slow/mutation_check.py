"""Whether README's test command finds mistakes in C: mutants of ``fmu_src`` and ``harness/engine``, each run in a copy.

    python tests/slow/mutation_check.py [COUNT] [--first N] [--seed SEED]

A mutant has one sign, comparison or constant changed, or one statement dropped. Those that do not compile are replaced
by others. The tests that are most likely to fail run first, and the run ends at the first failure. The survivors are
printed; the status is 1 if fewer than 95 % are found.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

ROOT = Path(__file__).parents[2]
OTHERS = {
    **{" + ": " - ", " - ": " + ", " * ": " / ", " / ": " * ", "-= ": "+= ", "+= ": "-= "},
    **{" < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > ", " == ": " != ", " != ": " == "},
    **{" && ": " || ", " || ": " && "},
}
RELEVANT = {  # folders of tests, by the longest prefix
    "fmu_src/": ("shell", "every_block", "exchange"),
    "fmu_src/composite/": ("composite", "exchange"),
    "fmu_src/controllers/": ("models", "laws", "every_block"),
    "fmu_src/fmi3/": ("fmi3", "shell"),
    "fmu_src/friction/": ("models", "every_block", "exchange"),
    "fmu_src/numerics/": ("models", "shell", "exchange"),
    "fmu_src/plants/": ("models", "every_block"),
    "fmu_src/signals/": ("models", "every_block"),
    "fmu_src/wasm/": ("wasm",),
    "harness/": ("harness", "accuracy", "composite"),
}
COMPILE = """
import sys
from pathlib import Path
from friction_fmus import catalogue, fmu
from friction_fmus.export.block_fmu import _sources
from harness import CallablePart, System
file = Path(sys.argv[1]).name
for block in catalogue().values():
    if file in (*_sources(block, {}), block.path.name):
        fmu(block.name)
        break
System([CallablePart("a", lambda t, u, x: t, outputs=["y"])]).run(stop=1.0, step=0.5)
"""


@dataclass(frozen=True)
class Mutant:
    file: str
    line: int
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.old.strip()}  ->  {self.new.strip() or 'dropped'}"


def changes(line: str) -> Iterator[str]:
    """The line with one thing wrong."""
    for old, new in OTHERS.items():
        for match in re.finditer(re.escape(old), line):
            yield line[: match.start()] + new + line[match.end() :]
    for match in re.finditer(r"(?<![\w.])\d+\.\d+(?:e[-+]?\d+)?(?!\w)", line):
        yield (
            line[: match.start()] + ("1.0" if float(match[0]) == 0.0 else f"(1.05 * {match[0]})") + line[match.end() :]
        )
    if re.match(r"\s+(\w[\w.>\[\]-]* [-+*/]?= .*|\w+\(.*\));$", line) and "static" not in line:
        yield ""


def mutants() -> list[Mutant]:
    """All of them; comments and directives are left alone."""
    listed = subprocess.run(["git", "ls-files", "fmu_src", "harness/engine"], cwd=ROOT, capture_output=True, text=True)
    found = []
    for file in listed.stdout.split():
        if Path(file).suffix in (".c", ".h"):
            text = (ROOT / file).read_text(encoding="utf-8")
            code = re.sub(r"/\*.*?\*/", lambda comment: "\n" * comment[0].count("\n"), text, flags=re.S)
            for number, (line, bare) in enumerate(zip(text.split("\n"), code.split("\n"), strict=True), start=1):
                if not bare.lstrip().startswith(("#", '"')) and not line.endswith("\\"):
                    found += [Mutant(file, number, line, new) for new in changes(bare.rstrip())]
    return found


def killed(mutant: Mutant, folder: Path, environment: dict[str, str]) -> bool | None:
    """Whether a test fails; None if the mutant does not compile."""
    path = folder / mutant.file
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    lines[mutant.line - 1] = mutant.new
    path.write_text("\n".join(lines), encoding="utf-8")

    def fails(*arguments: str) -> bool:
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False).returncode != 0

    try:
        if fails("-c", COMPILE, mutant.file):
            return None
        relevant = RELEVANT[max((prefix for prefix in RELEVANT if mutant.file.startswith(prefix)), key=len)]
        pytest = ("-m", "pytest", "-q", "-x", "-p", "no:cacheprovider")
        if any(fails(*pytest, f"tests/{name}") for name in relevant):
            return True
        return fails(*pytest, "-n", "2", *(f"--ignore=tests/{name}" for name in relevant))
    finally:
        path.write_text(text, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    drawn = mutants()
    Random(options.seed).shuffle(drawn)
    counted, survivors = 0, []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "copy"
        subprocess.run(["git", "clone", "--quiet", "--shared", str(ROOT), str(folder)], check=True)
        for changed in subprocess.run(
            ["git", "ls-files", "-m"], cwd=ROOT, capture_output=True, text=True
        ).stdout.split():
            shutil.copy(ROOT / changed, folder / changed)
        environment = os.environ | {"PYTHONPATH": str(folder), "FRICTION_FMUS_CACHE": f"{scratch}/cache"}
        for mutant in drawn[options.first :]:
            if counted == options.count:
                break
            found = killed(mutant, folder, environment)
            counted += found is not None
            print({True: "found", False: "SURVIVES", None: "does not compile"}[found], mutant, flush=True)
            survivors += [mutant] if found is False else []
    print(f"{counted - len(survivors)} of {counted} mutants are found", *survivors, sep="\n")
    return int(len(survivors) > 0.05 * counted)


if __name__ == "__main__":
    sys.exit(main())
