"""JavaScript for tests: in Node, and in a page of Chromium that was opened as a file under a strict policy."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from browser import chromium, needs_chromium

CASES = Path(__file__).with_name("cases.js")
NODE = shutil.which("node")
ENGINES = (
    pytest.param("node", marks=pytest.mark.skipif(NODE is None, reason="node is not installed")),
    pytest.param("chromium", marks=needs_chromium),
)
POLICY = "default-src 'none'; script-src 'self' file: 'wasm-unsafe-eval'"


def node(program: str, *arguments: object) -> str:
    """Run a module with Node, and return what it prints."""
    command = [str(NODE), "--input-type=module", "--eval", program, *map(str, arguments)]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 0, run.stderr
    return run.stdout


def in_node(scripts: Sequence[Path], cases: object, folder: Path) -> Any:
    """The results of `cases.js` in Node."""
    given, found = folder / "cases.json", folder / "found.json"
    given.write_text(json.dumps(cases))
    node(
        """
        import { readFileSync, writeFileSync } from "node:fs";
        import { runInThisContext } from "node:vm";
        const [given, found, ...scripts] = process.argv.slice(1);
        for (const script of scripts) runInThisContext(readFileSync(script, "utf8"));
        writeFileSync(found, JSON.stringify(await runCases(JSON.parse(readFileSync(given, "utf8")))));
        """,
        *(given, found, *scripts, CASES),
    )
    return json.loads(found.read_text())


def in_chromium(scripts: Sequence[Path], cases: object, folder: Path) -> Any:
    """The results of `cases.js` in Chromium; the page loads nothing but its scripts and writes no message."""
    page_file, said = folder / "page.html", []
    tags = "".join(f'<script src="{script.as_uri()}"></script>' for script in (*scripts, CASES))
    page_file.write_text(f'<!doctype html><meta http-equiv="Content-Security-Policy" content="{POLICY}">{tags}')
    with chromium() as browser:
        page = browser.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(page_file.as_uri())
        found = json.loads(page.evaluate("async (cases) => JSON.stringify(await runCases(cases))", cases))
    assert said == []
    return found


def run_in(engine: str, scripts: Sequence[Path], cases: object, folder: Path) -> Any:
    """The results of `cases.js` in one of `ENGINES`."""
    return (in_node if engine == "node" else in_chromium)(scripts, cases, folder)
