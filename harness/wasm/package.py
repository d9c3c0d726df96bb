"""The WebAssembly module of an FMU, and the npm package with it."""

from __future__ import annotations

import base64
import gzip
import json
import re
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any, Final
from zipfile import ZipFile

from lxml import etree

from harness.compiling.platforms import WASM, linked
from harness.compiling.sources import included, source_folder
from harness.errors import BuildError, OutputError
from harness.wasm.description import described
from harness.wasm.module import imports
from harness.wasm.texts import index_script, read_me, types_of

_FOLDER: Final = Path(__file__).parent
CLASS: Final = "model.js"
"""The JavaScript class that all packages contain."""


@dataclass(frozen=True)
class WasmModel:
    """A module with the description of its variables."""

    module: bytes
    """The WebAssembly module, which has no imports."""
    description: Mapping[str, Any]
    """What JavaScript knows about it, see `described`."""

    @property
    def name(self) -> str:
        """Model identifier."""
        return str(self.description["name"])

    def script(self) -> str:
        """Return a classic script that registers the model for ``frictionFmus.load(NAME)``; see `class_script`."""
        data = base64.b64encode(gzip.compress(self.module, 9, mtime=0)).decode()
        return f'frictionFmus.register({_json(self.description)}, "{data}");\n'

    def files(self) -> dict[str, bytes]:
        """Return the files of the npm package."""
        name = self.name
        package = {
            "name": f"{name.lower().replace('_', '-')}-wasm",
            "version": version("friction-fmus"),
            **{key: self.description[key] for key in ("description", "license") if key in self.description},
            "type": "module",
            "exports": {
                ".": {"types": "./index.d.ts", "default": "./index.js"},
                "./*": "./*",
            },
            "types": "./index.d.ts",
            "sideEffects": [f"./{name}.script.js"],
        }
        texts = {
            "package.json": json.dumps(package, indent=2, ensure_ascii=False) + "\n",
            f"{name}.json": json.dumps(self.description, indent=1, ensure_ascii=False) + "\n",
            f"{name}.script.js": class_script() + self.script(),
            "index.js": index_script(name, _json(self.description)),
            "index.d.ts": types_of(self.description),
            CLASS: (_FOLDER / CLASS).read_text(encoding="utf-8"),
            "model.d.ts": (_FOLDER / "model.d.ts").read_text(encoding="utf-8"),
            "README.md": read_me(self.description),
        }
        return {f"{name}.wasm": self.module} | {key: text.encode() for key, text in texts.items()}


def class_script() -> str:
    """Return a classic script that defines ``frictionFmus`` with the JavaScript class.

    Pages opened as files can load it, as modules cannot; it works without network under the content-security policy
    ``script-src 'self' 'wasm-unsafe-eval'``.
    """
    text = (_FOLDER / CLASS).read_text(encoding="utf-8")
    return (
        (_FOLDER / "classic.js")
        .read_text(encoding="utf-8")
        .replace("/* model.js */", re.sub(r"^export ", "", text, flags=re.M).strip())
    )


def is_wasm(platforms: Sequence[str], fmi: int) -> bool:
    """Return whether the platform is ``wasm32``, which makes an npm package in place of an FMU."""
    if WASM.folder not in platforms:
        return False
    if len(set(platforms)) > 1:
        raise BuildError("the platform wasm32 makes an npm package, not an FMU: build it without other platforms")
    if fmi != 2:
        raise BuildError(f"the platform wasm32 uses FMI 2.0: build it without FMI {fmi}")
    return True


def wasm_model(content: bytes, quiet: Collection[str] = ()) -> WasmModel:
    """Return an FMU as a WebAssembly module, compiled from its sources or from the cache."""
    with ZipFile(BytesIO(content)) as archive:
        root = etree.fromstring(archive.read("modelDescription.xml"))
        names = [name for name in archive.namelist() if name.startswith("sources/") and not name.endswith("/")]
        files = {name.removeprefix("sources/"): archive.read(name).decode() for name in names}
    description = described(root)
    name = description["name"]
    units = {
        str(file.get("name")): included(str(file.get("name")), files)
        for file in root.iterfind("CoSimulation/SourceFiles/File")
    }
    for path in sorted((source_folder() / "wasm").glob("*.c")):
        units[path.name] = {path.name: path.read_text(encoding="utf-8")}
    module = linked(WASM, units, name, quiet)
    needed = imports(module)
    if needed:
        raise BuildError(
            f"{name} needs {needed[0]} of an operating system, which a WebAssembly module does not have: change its "
            "sources"
        )
    return WasmModel(module, description)


def write_package(model: WasmModel, folder: Path) -> Path:
    """Write the npm package completely or not at all; replace an earlier one."""
    if folder.exists() and not (folder.is_dir() and (not any(folder.iterdir()) or (folder / CLASS).is_file())):
        raise OutputError(f"{folder} exists and is not a package of this command: give another folder")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as scratch:
            made, old = Path(scratch) / "new", Path(scratch) / "old"
            made.mkdir()
            for name, data in model.files().items():
                (made / name).write_bytes(data)
            if folder.exists():
                folder.rename(old)
            made.rename(folder)
    except OSError as error:
        raise OutputError(
            f"cannot write {folder}: {error.strerror}; give a path in an existing writable folder"
        ) from error
    return folder


def _json(value: object) -> str:
    """Return JSON on one line that may stand in JavaScript and in HTML."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
