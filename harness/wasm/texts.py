"""The generated files of an npm package: script, types and README."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

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


def index_script(name: str, description: str) -> str:
    """Return index.js; the description is JSON."""
    return _INDEX.format(name=name, description=description)


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
