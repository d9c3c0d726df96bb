"""The table of cases and tools: `tool_results.json`, and its block in docs/reference-set.md.

``python tests/reference_set/tool_table.py SET [TOOL ...]`` runs the tools that are installed on a built set, and writes
both; without arguments it writes the block only. CoFMPy and PathSim have environments of their own, which
`--install` makes. OMSimulator is found if Python finds its package.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from friction_fmus.reference.case import CASES, read_cases
from friction_fmus.reference.tool_runs import FAILED, INACCURATE, PASSED, UNSUPPORTED, run_case
from friction_fmus.version import VERSION
from harness.compiling.toolchain import cache_folder

HERE = Path(__file__).parent
ADAPTERS, RESULTS, PAGE = HERE / "adapters", HERE / "tool_results.json", HERE.parents[1] / "docs" / "reference-set.md"
BEGIN, END = "<!-- table of tools -->\n", "<!-- end of the table -->\n"
SIGNS = {PASSED: "✓", INACCURATE: "≈", FAILED: "✗", UNSUPPORTED: ""}
OWN = {"CoFMPy": "cofmupy==1.0.0", "PathSim": "pathsim-fmi==0.1.1"}
"""Tools that need an environment of their own, and what is installed there."""

TOOLS = {
    "harness": "",
    "FMPy": "",
    "OMSimulator": "in_omsimulator",
    "libcosim": "in_libcosim",
    "ecos": "in_ecos",
    "CoFMPy": "in_cofmupy",
    "FMU Toolbox": "in_toolbox",
    "casadi": "in_casadi",
    "SciPy": "in_scipy",
    "PathSim": "in_pathsim",
}
"""Adapter of each tool; the first two are programs of the package."""


def environment(requirement: str) -> Path:
    """Folder of an environment in the cache, named as `tests/slow/importers/install_cofmupy.py` names its own."""
    name, _, version = requirement.partition("==")
    return cache_folder() / f"{name}-{version}-python{sys.version_info.major}.{sys.version_info.minor}"


def install() -> None:
    """Make the environments, complete or not at all."""
    for requirement in OWN.values():
        if not environment(requirement).exists():
            made = Path(tempfile.mkdtemp(dir=cache_folder()))
            subprocess.run([sys.executable, "-m", "venv", str(made)], check=True)
            subprocess.run([str(made / "bin/python"), "-m", "pip", "install", "-q", requirement], check=True)
            made.rename(environment(requirement))


def command(tool: str) -> str:
    """The command line of a tool, without its arguments."""
    python = environment(OWN[tool]) / "bin/python" if tool in OWN else Path(sys.executable)
    return shlex.join([str(python), str(ADAPTERS / f"{TOOLS[tool]}.py")])


def version(tool: str) -> str:
    """The version of a tool; empty if it is not installed."""
    if tool == "harness":
        return VERSION
    if tool == "FMPy":
        import fmpy

        return str(fmpy.__version__)
    try:
        run = subprocess.run([*shlex.split(command(tool)), "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return run.stdout.strip().splitlines()[-1] if run.returncode == 0 else ""


def run(tool: str, folder: Path) -> dict[str, tuple[str, str]]:
    """The verdicts on a tool."""
    line = f"{command(tool)} {{case}} {{output}}" if TOOLS[tool] else tool.lower()
    with tempfile.TemporaryDirectory() as results, ThreadPoolExecutor(os.cpu_count()) as pool:
        verdicts = pool.map(lambda case: run_case(case, line, Path(results), time_limit=120.0), read_cases(folder))
        return {each.case: (each.state, clean(each.detail)) for each in verdicts}


def clean(detail: str) -> str:
    """A reason without paths and numbers of this run."""
    return re.sub(r"/\S+/", "", detail)[:160]


def read() -> dict[str, Any]:
    """The committed results: tool -> version and verdicts."""
    found: dict[str, Any] = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    return found


def write(results: Mapping[str, Any]) -> None:
    """Write the results, one line for each case."""
    blocks = []
    for tool, found in results.items():
        rows = [f"   {json.dumps(case)}: {json.dumps(verdict)}" for case, verdict in found["cases"].items()]
        lines = ",\n".join(rows)
        blocks.append(
            f'  {json.dumps(tool)}: {{"version": {json.dumps(found["version"])}, "cases": {{\n{lines}\n  }}}}'
        )
    RESULTS.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


def table() -> str:
    """The block of the page."""
    results = read()
    names = [each.name for each in read_cases(CASES)]
    heads = [f"{tool} {results[tool]['version']}" for tool in results]
    lines = [f"| case | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for name in names:
        signs = (SIGNS[results[tool]["cases"].get(name, (UNSUPPORTED,))[0]] for tool in results)
        lines.append(f"| `{name}` | {' | '.join(signs)} |")
    counts = [sum(state == PASSED for state, _ in results[tool]["cases"].values()) for tool in results]
    supported = [sum(state != UNSUPPORTED for state, _ in results[tool]["cases"].values()) for tool in results]
    of = (f"{count} of {whole}" for count, whole in zip(counts, supported, strict=True))
    lines.append(f"| passed of those supported | {' | '.join(of)} |")
    return "\n".join(lines) + "\n"


def write_page() -> None:
    """Write the block into the page."""
    text = PAGE.read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    PAGE.write_text(f"{head}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


def main(arguments: list[str]) -> None:
    """Run the tools and write the table."""
    if "--install" in arguments:
        install()
        return
    results = read()
    for tool in TOOLS if arguments else ():
        chosen = not arguments[1:] or tool in arguments[1:]
        if chosen and (installed := version(tool)):
            results[tool] = {"version": installed, "cases": run(tool, Path(arguments[0]))}
            print(tool, installed, flush=True)
    write({tool: results[tool] for tool in TOOLS if tool in results})
    write_page()


if __name__ == "__main__":
    main(sys.argv[1:])
