"""Verdicts of a tool as JUnit, and a page with all tools that were run on a set."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from lxml import etree

from friction_fmus.export.targets import write_file
from friction_fmus.fmi.html_page import STYLE, row, table
from friction_fmus.reference.case import ReferenceCase
from friction_fmus.reference.tool_runs import FAILED, INACCURATE, PASSED, UNSUPPORTED, Verdict

COLOURS: Final = """
.passed { background: #00c80026; }
.inaccurate { background: #e6c80040; }
.failed { background: #ff000026; }
@media (prefers-color-scheme: dark) {
  :root { color-scheme: dark; }
  body { color: #e6e6e6; }
  caption { color: #b0b0b0; }
}
"""


def write_junit(verdicts: Sequence[Verdict], tool: str, folder: Path) -> None:
    """Write the verdicts of a tool to the folder of its results."""
    suite = etree.Element("testsuite", name=f"reference set in {tool}", tests=str(len(verdicts)))
    suite.set("failures", str(sum(verdict.state in (FAILED, INACCURATE) for verdict in verdicts)))
    suite.set("skipped", str(sum(verdict.state == UNSUPPORTED for verdict in verdicts)))
    for verdict in verdicts:
        test = etree.SubElement(suite, "testcase", classname=tool, name=verdict.case, time=f"{verdict.seconds:.3f}")
        detail = "".join(letter if letter.isprintable() else " " for letter in f"{verdict.state}: {verdict.detail}")
        kind = {PASSED: "system-out", UNSUPPORTED: "skipped"}.get(verdict.state, "failure")
        etree.SubElement(test, kind, {} if kind == "system-out" else {"message": detail}).text = detail
    write_file(etree.tostring(suite, xml_declaration=True, encoding="UTF-8", pretty_print=True), folder / "junit.xml")


def read_junit(folder: Path) -> dict[str, dict[str, str]]:
    """Return the verdicts of each tool in a set, by case, each as one text that begins with the state."""
    files = sorted((folder / "results").glob("*/junit.xml"))
    return {
        file.parent.name: {str(test.get("name")): str(test[0].text) for test in etree.parse(file).iter("testcase")}
        for file in files
    }


def write_page(cases: Sequence[ReferenceCase], folder: Path) -> Path:
    """Write the table of all cases and all tools that were run on a set."""
    tools = read_junit(folder)
    rows = [row(case.name, case.title, *(found.get(case.name, "") for found in tools.values())) for case in cases]
    body = table("Cases and tools", ("case", "title", *tools), "".join(rows))
    body = re.sub(f"<td>({PASSED}|{INACCURATE}|{FAILED}|{UNSUPPORTED}): ", r'<td class="\1"><b>\1</b><br>', body)
    body = re.sub(r'<th scope="row">(\w+)', r'<th scope="row"><a href="../\1/README.md">\1</a>', body)
    title, path = "Reference set for tools that import FMUs", folder / "results" / "index.html"
    head = f'<head>\n<meta charset="utf-8">\n<title>{title}</title>\n<style>{STYLE}{COLOURS}</style>\n</head>'
    page = f'<!DOCTYPE html>\n<html lang="en">\n{head}\n<body>\n<h1>{title}</h1>\n{body}</body>\n</html>\n'
    write_file(page, path)
    return path
