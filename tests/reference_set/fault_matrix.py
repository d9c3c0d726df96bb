"""Which case finds which planted fault.

``python tests/reference_set/fault_matrix.py`` prints the table; ``--write`` enters it into each ``case.toml``.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from reference_set.built_set import built, is_long, names
from reference_set.importer import Importer, write
from reference_set.planted_faults import FAULTS

from friction_fmus.reference.case import CASES, ReferenceCase
from friction_fmus.reference.tool_runs import FAILED, PASSED, compare

FEW = ("time-accumulates-by-addition",)
"""Faults that are planted in cases with many steps."""


def verdict(case: ReferenceCase, faults: Iterable[str] = ()) -> tuple[str, str]:
    """The verdict on the importer with these faults, and its reason."""
    try:
        rows = Importer(case, tuple(faults)).run()
    except Exception as error:
        return (PASSED if case.may_refuse else FAILED), f"{type(error).__name__}: {error}"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.csv"
        write(case, rows, path)
        return compare(case, path)


def found_by(name: str) -> list[str]:
    """The faults that a case finds."""
    case = built(name)
    planted = FEW if is_long(name) else FAULTS
    return [fault for fault in planted if verdict(case, [fault])[0] != PASSED]


def enter(name: str, faults: list[str]) -> None:
    """Write the faults into the ``case.toml`` of a case."""
    path = CASES / name / "case.toml"
    text = path.read_text(encoding="utf-8")
    line = f"faults = [{', '.join(json.dumps(fault) for fault in faults)}]"
    if len(line) > 120:
        line = "faults = [\n" + "".join(f"    {json.dumps(fault)},\n" for fault in faults) + "]"
    new, count = re.subn(r"^faults = \[[^\]]*\]$", line, text, flags=re.M)
    if not count:
        new = text.replace("bound = ", f"{line}\nbound = ", 1)
    path.write_text(new, encoding="utf-8")


def main(options: list[str]) -> None:
    """Print the table, or enter it."""
    chosen = [each for each in options if not each.startswith("-")] or names()
    finders: dict[str, list[str]] = {fault: [] for fault in FAULTS}
    for name in chosen:
        right, why = verdict(built(name))
        if right != PASSED:
            print(f"{name}: the right importer is {right}: {why}")
            continue
        faults = found_by(name)
        for fault in faults:
            finders[fault].append(name)
        print(f"{name}: {', '.join(faults) or 'none'}")
        if "--write" in options:
            enter(name, faults)
    for fault, cases in finders.items():
        if len(cases) == 0:
            print(f"no case finds {fault}")
        elif len(cases) < 3:
            print(f"{fault}: {', '.join(cases)}")


if __name__ == "__main__":
    main(sys.argv[1:])
