"""The WebAssembly module of an FMU, and the npm package with it."""

import base64
import gzip
import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from lxml import etree

from friction_fmus.export.targets import SourceFmu
from friction_fmus.export.targets.fmi3.fmi3_archive import grouped
from harness.compiling.platforms import WASM, linked
from harness.compiling.toolchain import included, source_folder
from harness.errors import BuildError, OutputError

_NUMBERS: Final[Mapping[str, type]] = {"Real": float, "Integer": int, "Enumeration": int}


def described(root: etree._Element) -> dict[str, Any]:
    """Return the content of ``NAME.json`` for the root of a modelDescription.xml of FMI 2.0."""
    simulation, experiment = root.find("CoSimulation"), root.find("DefaultExperiment")
    assert simulation is not None
    types = {str(each.get("name")): each for each in root.iterfind("TypeDefinitions/SimpleType")}
    scalars = root.findall("ModelVariables/ScalarVariable")
    stated = {} if experiment is None else {key: float(str(value)) for key, value in experiment.items()}
    return {
        "name": str(simulation.get("modelIdentifier")),
        **{key: str(root.get(key)) for key in ("description", "license", "generationTool") if root.get(key)},
        "guid": str(root.get("guid")),
        "experiment": {"startTime": 0.0, "stopTime": 1.0, "stepSize": 1e-3} | stated,
        "variables": [_variable(each, types) for each in scalars],
        "arrays": {
            array.name: [str(each.get("name")) for each in array.elements]
            for array in grouped(scalars, arrays=True, resizable=False)
            if array.is_array
        },
    }


def _variable(scalar: etree._Element, types: Mapping[str, etree._Element]) -> dict[str, Any]:
    typed = scalar[0]
    kind = str(typed.tag)
    declared = types.get(str(typed.get("declaredType")))
    inherited = {} if declared is None else dict(declared[0].items())
    attributes = {str(key): str(value) for key, value in {**inherited, **typed.attrib}.items()}
    found: dict[str, Any] = {"name": str(scalar.get("name")), "type": kind}
    found["reference"] = int(str(scalar.get("valueReference")))
    found |= {key: str(scalar.get(key)) for key in ("causality", "variability") if scalar.get(key)}
    found |= {key: attributes[key] for key in ("unit", "quantity") if attributes.get(key)}
    for key in ("start", "min", "max", "nominal"):
        if key in attributes:
            text = attributes[key]
            found[key] = text in ("true", "1") if kind == "Boolean" else _NUMBERS[kind](text)
    if declared is not None and kind == "Enumeration":
        found["items"] = {str(item.get("name")): int(str(item.get("value"))) for item in declared[0]}
    if scalar.get("description"):
        found["description"] = str(scalar.get("description"))
    return found


_IMPORTS = 2


def first_import(module: bytes) -> str | None:
    """Return a function or memory that a module needs, as "module.name"; None if it needs nothing."""
    for section, data in _sections(module):
        if section == _IMPORTS:
            names, place = [], _number(data, 0)[1]
            for _ in range(2):
                length, place = _number(data, place)
                names.append(data[place : place + length].decode())
                place += length
            return ".".join(names)
    return None


def _sections(module: bytes) -> Iterator[tuple[int, bytes]]:
    place = 8
    while place < len(module):
        size, start = _number(module, place + 1)
        yield module[place], module[start : start + size]
        place = start + size


def _number(data: bytes, place: int) -> tuple[int, int]:
    """Return an unsigned number in LEB128, and the place after it."""
    value = shift = 0
    while True:
        byte = data[place]
        place += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, place
        shift += 7


_INDEX: Final = """\
// {name} as a WebAssembly module; README.md shows how to use it.
import {{ Model }} from "./model.js";

export {{ Block, FmuError, Model }} from "./model.js";

export const description = {description};

/** Load the module, by default from the file beside this one. */
export function load(source = new URL("./{name}.wasm", import.meta.url)) {{
  return Model.load(source, description);
}}
"""

_TYPES: Final = """\
// Types of {name}.
import {{ Block as AnyBlock, Description, Model as AnyModel, Source }} from "./model.js";

export {{ FmuError }} from "./model.js";

/** The variables by name; arrays also as a whole. */
export interface Values {{
{values}
}}
export type Input = {inputs};
export type Output = {outputs};
/** What can be set, inputs and parameters and start values of states. */
export type Settable = {settable};

export type Model = AnyModel<Values, Input, Output, Settable>;
export type Block = AnyBlock<Values, Input, Output, Settable>;

export declare const description: Description;
/** Load the module, by default from the file beside index.js. */
export declare function load(source?: Source): Promise<Model>;
"""

_READ_ME: Final = """\
# {name}

{text}, as a WebAssembly module without imports (`{name}.wasm`), with a JavaScript class and TypeScript types.

```js
import {{ load }} from "{package}";

const model = await load();
const block = model.instantiate({{{start}}});
const {{ {shown} }} = block.run({{ step: {step}, {driven} }});
```

`block.set(name, value)`, `block.get(name)`, `block.step(dt)`, `block.reset(start)`, `block.save()`,
`block.restore(state)` and `block.dispose()` work on one instance. A call that the model rejects throws an error with
its message and changes nothing. `{name}.json` lists the variables with units, start values and limits.

A page without modules, such as one opened as a file, uses `<script src="{name}.script.js"></script>` and
`await frictionFmus.load("{name}")`; a content-security policy needs `script-src 'self' 'wasm-unsafe-eval'`.
"""


def types_of(description: Mapping[str, Any]) -> str:
    """Return index.d.ts."""
    variables = description["variables"]
    lines = [f"  /** {_comment(v)} */\n  {json.dumps(v['name'])}: {_type(v)};" for v in variables]
    by_name = {v["name"]: v for v in variables}
    for array, elements in description["arrays"].items():
        first = by_name[elements[0]]
        lines.append(f"  /** {_comment(first)}, {len(elements)} elements */\n  {json.dumps(array)}: {_type(first)}[];")

    def union(names: list[str]) -> str:
        return " | ".join(map(json.dumps, names)) or "never"

    settable = [v["name"] for v in variables if "start" in v]
    settable += [array for array, elements in description["arrays"].items() if "start" in by_name[elements[0]]]
    return _TYPES.format(
        name=description["name"],
        values="\n".join(lines),
        inputs=union(names_of(description, "input")),
        outputs=union(names_of(description, "output")),
        settable=union(settable),
    )


def names_of(description: Mapping[str, Any], causality: str) -> list[str]:
    """Return the names of the variables with a causality."""
    return [v["name"] for v in description["variables"] if v["causality"] == causality]


def _type(variable: Mapping[str, Any]) -> str:
    return "boolean" if variable["type"] == "Boolean" else "number"


def _comment(variable: Mapping[str, Any]) -> str:
    """Return description, unit and limits for an editor to show."""
    unit = f" [{variable['unit']}]" if "unit" in variable else ""
    limits = [f"{word} {variable[key]:g}" for key, word in (("min", "at least"), ("max", "at most")) if key in variable]
    text = variable.get("description", variable["causality"])
    return f"{text}{unit}{', ' if limits else ''}{' and '.join(limits)}".replace("*/", "* /")


def read_me(description: Mapping[str, Any]) -> str:
    """Return README.md."""
    variables = description["variables"]
    parameter = next((v for v in variables if v["causality"] == "parameter" and v["type"] == "Real"), None)
    driven = names_of(description, "input")[:1]
    shown = names_of(description, "output")[:1]
    step = description["experiment"]["stepSize"]
    return _READ_ME.format(
        name=description["name"],
        package=f"{description['name'].lower().replace('_', '-')}-wasm",
        text=description.get("description", description["name"]),
        start="" if parameter is None else f" {_key(parameter['name'])}: {parameter['start']!r} ",
        shown=f"time, {_key(shown[0])}: {'output' if not shown[0].isidentifier() else shown[0]}" if shown else "time",
        step=f"{step:g}",
        driven=f"steps: 1000, inputs: {{ {_key(driven[0])}: (t) => Math.sin(t) }}" if driven else "steps: 1000",
    )


def _key(name: str) -> str:
    """Return a name as the key of a JavaScript object."""
    return name if name.isidentifier() else json.dumps(name)


_FOLDER: Final = Path(__file__).parent
CLASS: Final = "model.js"  # the JavaScript class that all packages contain


@dataclass(frozen=True)
class WasmModel:
    """A module with the description of its variables."""

    module: bytes  # the WebAssembly module, which has no imports
    description: Mapping[str, Any]  # what JavaScript knows about it, see `described`

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
        from importlib.metadata import version

        name = self.name
        package = {
            "name": f"{name.lower().replace('_', '-')}-wasm",
            "version": version("friction-fmus"),
            **{key: self.description[key] for key in ("description", "license") if key in self.description},
            "type": "module",
            "exports": {".": {"types": "./index.d.ts", "default": "./index.js"}, "./*": "./*"},
            "types": "./index.d.ts",
            "sideEffects": [f"./{name}.script.js"],
        }
        texts = {
            "package.json": json.dumps(package, indent=2, ensure_ascii=False) + "\n",
            f"{name}.json": json.dumps(self.description, indent=1, ensure_ascii=False) + "\n",
            f"{name}.script.js": class_script() + self.script(),
            "index.js": _INDEX.format(name=name, description=_json(self.description)),
            "index.d.ts": types_of(self.description),
            CLASS: (_FOLDER / CLASS).read_text(encoding="utf-8"),
            "model.d.ts": (_FOLDER / "model.d.ts").read_text(encoding="utf-8"),
            "README.md": read_me(self.description),
        }
        return {f"{name}.wasm": self.module} | {key: text.encode() for key, text in texts.items()}


def class_script() -> str:
    """Return a classic script that defines ``frictionFmus`` with the JavaScript class."""
    # Pages opened as files can load it, as modules cannot; it works without network under the content-security policy
    # ``script-src 'self' 'wasm-unsafe-eval'``.
    text = (_FOLDER / CLASS).read_text(encoding="utf-8")
    return (
        (_FOLDER / "classic.js")
        .read_text(encoding="utf-8")
        .replace("/* model.js */", re.sub(r"^export ", "", text, flags=re.M).strip())
    )


def wasm_model(source: SourceFmu) -> WasmModel:
    """Return an FMU as a WebAssembly module, compiled from its sources or from the cache."""
    name, files = source.identifier, source.files
    units = {unit: included(unit, files) for unit in source.units}
    for path in sorted((source_folder() / "wasm").glob("*.c")):
        units[path.name] = {path.name: path.read_text(encoding="utf-8")}
    module = linked(WASM, units, name, source.quiet)
    needed = first_import(module)
    if needed:
        raise BuildError(
            f"{name} needs {needed} of an operating system, which a WebAssembly module does not have: change its "
            "sources"
        )
    return WasmModel(module, described(source.description))


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
