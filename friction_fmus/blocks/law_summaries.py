"""Names and summaries of laws, read from the text of their files, as importing them would import casadi."""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

from friction_fmus.blocks import FAMILIES


@dataclass(frozen=True)
class Heading:
    """Texts in the decorator ``@law`` of a law."""

    name: str
    summary: str
    source: str
    """See `friction_fmus.lawkit.law.Law`."""
    path: Path  # the file that defines it
    family: str = "other"  # family of the compensator


def law_paths(folder: Path) -> list[Path]:
    """Return the law files of a folder: all Python files whose names do not begin with an underscore."""
    return sorted(file for file in folder.glob("*.py") if not file.name.startswith("_"))


def read_headings(file: Path) -> list[Heading] | None:
    """Return the headings of the laws in a file, in the order of definition."""
    try:
        code = file.read_bytes()
        head, _, body = code.partition(b"\ndef ")
        alone = b"law" not in re.sub(rb'""".*?"""', b"", body, flags=re.S)
        tree = ast.parse(head + b"\ndef _(): pass" if alone else code)  # the whole function takes ten times as long
    except (OSError, SyntaxError, ValueError):
        return None
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    calls = [node for function in functions for node in function.decorator_list if _is_law(node)]
    names = sum(isinstance(node, ast.Name) and node.id == "law" for node in ast.walk(tree))
    imported = [name for node in tree.body if isinstance(node, ast.ImportFrom) for name in node.names]
    plain = any(name.name == "law" and name.asname is None for name in imported)
    if not (calls and plain and names == len(calls)):
        return None
    headings = [_heading(call, file) for call in calls if isinstance(call, ast.Call)]
    found = [heading for heading in headings if heading is not None]
    return found if len(found) == len(calls) else None


def _is_law(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "law"


def _heading(call: ast.Call, file: Path) -> Heading | None:
    given = dict(zip(("name", "summary"), call.args, strict=False))
    given |= {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}
    nodes = [given.get(name) for name in ("name", "summary", "source")]
    texts = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    if len(texts) != len(nodes):
        return None
    name, summary, source = texts
    use = given.get("use")
    if use is None:
        return Heading(name, summary, source, file.resolve())
    kind = use.args[0] if isinstance(use, ast.Call) and use.args else None
    if not (isinstance(kind, ast.Constant) and isinstance(kind.value, str)):
        return None
    return Heading(name, summary, source, file.resolve(), FAMILIES.get(kind.value, "other"))
