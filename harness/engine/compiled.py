"""The loop over communication steps, compiled for one system, with the code of its blocks and its layout in it."""

import ctypes
import hashlib
import logging
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

from harness.compiling.engine_library import library, mirror, sources
from harness.compiling.platforms import inlined
from harness.compiling.toolchain import STRICT, lacking, object_flags
from harness.engine import ENGINES
from harness.engine.defect import Defect, Pair
from harness.engine.native import Engine
from harness.errors import BuildError, ExperimentError, HarnessError, nearest
from harness.parts.fmu import FmuPart
from harness.storage.zip_file import ZipError
from harness.system.plan import GET, SET, STEP

_LOG = logging.getLogger("harness")

WORTH: Final = 1_000_000_000
"""Steps of parts that are worth a compilation of 2 to 4 s: each is some 9 ns shorter."""


def check_engine(engine: str) -> None:
    """Raise an ExperimentError if there is no such engine."""
    if engine not in ENGINES:
        raise ExperimentError(f"there is no engine {engine!r}; {nearest(engine, ENGINES)}")


def pays(engine: str, steps: int) -> bool:
    """Return whether the loop is compiled for this number of steps of parts."""
    return engine == "compiled" or (engine == "auto" and steps >= WORTH)


_PLACE = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
Direct = mirror("Direct")


def place_of(part: ctypes.Structure) -> tuple[int, int, int]:
    """Return address and size of what steps may change in a block, which begins with its parameters, and their size."""
    calls, size, fixed = Direct.from_address(part.direct), ctypes.c_int64(), ctypes.c_int64()
    address = _PLACE(calls.place)(part.component, ctypes.byref(size), ctypes.byref(fixed))
    return address, size.value, fixed.value


def compiled_loop(engine: Engine, *, required: bool) -> int:
    """Return the address of the loop of a system whose run has begun.

    If there can be none, return 0, or raise a HarnessError if it is required.
    """
    try:
        if not library().engine_takes_turns(ctypes.byref(engine.data)):
            raise HarnessError(_refusal(engine))
        if missing := lacking():
            raise missing
        loop = _loop(engine)
    except (HarnessError, OSError, ZipError) as error:
        if required:
            raise HarnessError(f"the engine cannot be compiled for this system: {error}") from error
        _LOG.debug("the engine is not compiled for this system: %s", error)
        return 0
    _LOG.info("the engine is compiled for this system")
    return loop


def _refusal(engine: Engine) -> str:
    plan = engine.plan
    if [operation for operation, _ in engine.program] != [SET, STEP, GET] * len(plan.parts):
        return "its master does not step one part after the other, as gauss-seidel does"
    other = next((part.name for part, data in zip(plan.parts, engine.parts, strict=True) if not data.direct), None)
    if other is not None:
        return f"'{other}' is not a block or a law of this project as an FMI 2.0 FMU"
    return (
        "it has manipulators, connections with a factor, an offset or a delay, or parts with a sample time of their own"
    )


_LOADED: Final[dict[tuple[str, ...], ctypes.CDLL]] = {}


def _loop(engine: Engine) -> int:
    order = dict.fromkeys(part for _, part in engine.program)
    blocks = {part: block for part in order if isinstance(block := engine.plan.parts[part], FmuPart)}
    places = {part: place for place, part in enumerate(order) if part in blocks}
    files = {f"part_{number}.c": _part(number, block, engine.parts[number]) for number, block in blocks.items()}
    files["system.c"] = _system(engine, places)
    key = (*files.values(), *(block.identity for block in blocks.values()))
    loaded = _LOADED.get(key) or _compiled(files, blocks)
    for number, block in blocks.items():
        fixed, guid = ctypes.c_int64(), ctypes.create_string_buffer(64)
        size = loaded.compiled_size(number, ctypes.byref(fixed), guid)
        if (size, fixed.value) != place_of(engine.parts[number])[1:] or guid.value.decode() != block.identity:
            raise BuildError(_FOREIGN % block.name)
    _LOADED[key] = loaded
    return ctypes.cast(loaded.run_compiled, ctypes.c_void_p).value or 0


_FOREIGN: Final = "the library of '%s' was not made from the sources in its FMU; build it again"
_IDENTITY: Final = re.compile(r'^#define IDENTITY "(\w+)"\n', re.M)  # a hash of the other lines, and part of the GUID


def _identified(sources: Mapping[str, str]) -> bool:
    """Return whether the sources in a folder have the hash that they state."""
    stated = [digits for text in sources.values() for digits in _IDENTITY.findall(text)]
    lines = {name.partition("/")[2]: _IDENTITY.sub("", sources[name]) for name in sorted(sources)}
    text = "\0".join(part for item in lines.items() for part in item)
    return stated == [hashlib.sha256(text.encode()).hexdigest()[:32]]


def _compiled(files: Mapping[str, str], blocks: Mapping[int, FmuPart]) -> ctypes.CDLL:
    headers = {name: text for name, text in sources().items() if name.endswith(".h")}
    units = {"system.c": {**headers, "system.c": files["system.c"]}}
    for number, block in blocks.items():
        unit = f"part_{number}.c"
        read = block.archive.read(*(name for name in block.archive.names if name.startswith("sources/")))
        own = {
            name.replace("sources", f"part_{number}", 1): text.decode(errors="replace") for name, text in read.items()
        }
        if not _identified(own):
            raise BuildError(_FOREIGN % block.name)
        units[unit] = {**own, unit: files[unit], **{name: headers[name] for name in ("compiled_part.h", "direct.h")}}
    path = inlined(units, "system")
    sections = re.findall(rb"\0(\.data|\.bss)\0", path.read_bytes())  # a sanitizer has some of its own
    if sections and STRICT in object_flags(None):
        raise HarnessError("a part has static variables, which its library and the loop would not share")
    loaded = ctypes.CDLL(str(path))
    size = loaded.compiled_size
    size.restype, size.argtypes = ctypes.c_int64, (ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)
    return loaded


def _system(engine: Engine, places: Mapping[int, int]) -> str:
    """Return the C file of the loop."""
    data = engine.data
    defects = _structs(Defect, data.defects, data.defect_count)
    pairs = _structs(Pair, data.pairs, data.pair_count)
    tables: dict[str, list[tuple[int, ...]]] = {
        "TURNS": [*places.items()],
        "DEFECTS": [(k, d.input, engine.plan.sources[d.input]) for k, d in enumerate(defects)],
        "PAIRS": [(k, p.force, p.velocity, int(p.position >= 0), int(p.late > 0)) for k, p in enumerate(pairs)],
    }
    lines = [
        f"#define {name}(X) " + " ".join(f"X({', '.join(map(str, row))})" for row in rows)
        for name, rows in tables.items()
    ]
    return "\n".join(["/* Generated: the layout of a system. */", *lines, '#include "compiled_system.h"']) + "\n"


def _structs(kind: Any, address: int | None, count: int) -> Iterable[Any]:
    found: Iterable[Any] = (kind * count).from_address(address) if count else ()
    return found


def _part(number: int, block: FmuPart, data: Any) -> str:
    """Return the C file of a part."""
    listed = [str(file.get("name")) for file in block.archive.root.iterfind("CoSimulation/SourceFiles/File")]
    if block.archive.flat is not None or len(listed) != 1:
        raise HarnessError(f"'{block.name}' is an FMU without its sources")
    ports = data.ports
    counts = [int(n) for n in (ports.reals, ports.flags, ports.out_reals, ports.out_counts, ports.out_flags)]
    inputs, outputs = counts[0] + counts[1], sum(counts[2:])
    tables = {
        "uint32_t input_references": _numbers(ports.input_references, inputs, ctypes.c_uint32),
        "uint32_t output_references": _numbers(ports.output_references, outputs, ctypes.c_uint32),
        "int64_t sources": _numbers(ports.sources, inputs, ctypes.c_int64),
    }
    rest = ", ".join(str(int(n)) for n in (ports.inputs, ports.outputs, *counts))
    return "\n".join(
        [
            "/* Generated: a part and its place in a system. */",
            "#include <stdint.h>",
            f"#define PART_NUMBER {number}",
            f'#define PART_SOURCE "part_{number}/{listed[0]}"',
            *(f"static const {name}_of_part[] = {{{', '.join(values)}}};" for name, values in tables.items()),
            f"#define PART_PORTS {{input_references_of_part, output_references_of_part, sources_of_part, {rest}}}",
            '#include "compiled_part.h"',
            "",
        ]
    )


def _numbers(address: int, count: int, kind: Any) -> list[str]:
    """Return integers at an address; 0 for none, as C has no empty arrays."""
    return [str(number) for number in (kind * count).from_address(address)] if count else ["0"]
