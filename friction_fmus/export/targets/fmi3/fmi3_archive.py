"""The archive of an FMU in FMI 3.0."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

from lxml import etree

from friction_fmus.export.targets import SourceFmu
from friction_fmus.export.targets.fmi3.fmi3_description import Traits, Variable, description_3, grouped
from harness.compiling import toolchain
from harness.compiling.platforms import Platform, linked
from harness.compiling.toolchain import guid_of, included, source_folder
from harness.storage.files import cached
from harness.storage.zip_file import zipped

PAGE: Final = "documentation/index.html"

_MEANINGS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "canHandleVariableCommunicationStepSize": "Communication steps may have any length and may vary.",
        "maxOutputDerivativeOrder": "First time derivatives of the outputs are available at the end of a step.",
        "canGetAndSetFMUState": "The state can be saved and restored, so that steps can be repeated.",
        "canSerializeFMUState": "The saved state can be written to a file.",
        "providesDirectionalDerivatives": "Directional derivatives are available, for implicit masters.",
        "providesAdjointDerivatives": "Adjoint derivatives are available.",
        "providesIntermediateUpdate": "The importer can be called at the end of each internal step.",
        "canReturnEarlyAfterIntermediateUpdate": "The importer can end the communication step there.",
        "hasEventMode": "The importer can activate the clock of the samples in event mode.",
        "mightReturnEarlyFromDoStep": "In event mode, a communication step ends at the next sample.",
        "needsCompletedIntegratorStep": "The importer has to call fmi3CompletedIntegratorStep.",
    }
)

_SECTION: Final = re.compile(
    r"(<h2>FMI features</h2>\n<p>)FMI 2\.0 (.*?<caption>Capability flags</caption>.*?</thead>\n).*?(</table>)", re.S
)


def page_3(page: str, description: bytes) -> str:
    """Return the page with the capability flags of FMI 3.0; a page without the section is unchanged."""
    root = etree.fromstring(description)
    flags = {
        str(k): str(v)
        for kind in ("CoSimulation", "ModelExchange")
        for k, v in getattr(root.find(kind), "attrib", {}).items()
    }
    rows = "".join(
        f'<tr><th scope="row">{name}</th><td>{value}</td><td>{_MEANINGS[name]}</td></tr>\n'
        for name, value in flags.items()
        if name in _MEANINGS
    )
    return _SECTION.sub(lambda found: f"{found[1]}FMI 3.0 {found[2]}{rows}{found[3]}", page)


_FMI_2_HEADERS: Final = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")

_TUPLES: Final[Mapping[str, tuple[str, tuple[str | None, ...] | None]]] = {
    "linux64": ("x86_64-linux", None),
    "win64": ("x86_64-windows", None),
    "darwin64": ("x86_64-darwin", ("x86_64-macos",)),
}
"""Folder in FMI 3.0 of each platform that is named otherwise in FMI 2.0, and the targets if they differ."""

_SOURCE: Final = """\
/* {identifier} in FMI 3.0: the FMI 2.0 functions, the tables of variables, and the shell around them. */

#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "{identifier}.c"

#include "fmi3_variable.h"

#define TOKEN       "{token}"
#define GUID_INSIDE "{guid}"

enum {{
    REFERENCES = {references},
    INDICATOR_COUNT = {indicators},
    INDICATORS_REFERENCE = {variable_count} + 1,
    CLOCK_REFERENCE = INDICATORS_REFERENCE + INDICATOR_COUNT,
    ALL_REFERENCES,
    STATE_VARIABLES = {state_count}
}};

static const Variable3 variables_3[ALL_REFERENCES] = {{
{variables}
}};

#define HAS_MODEL_EXCHANGE {exchange}
#define HAS_EVENT_MODE     {events}
{structural}
#if HAS_MODEL_EXCHANGE
static const uint32_t state_variables[STATE_VARIABLES + 1] = {{{states}}};
#endif

#include "fmi3.h"
"""


def fmi_3(source: SourceFmu, *, clocks: bool = False, arrays: bool = False) -> bytes:
    """Return the FMU of FMI 3.0, from the cache or compiled."""
    shell = _shell()
    digest = hashlib.sha256(source.content)
    modules = (path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parent.glob("*.py")))
    identities = (text for each in source.platforms for text in (each.folder, *map(toolchain.identity, each.targets)))
    for text in (
        f"{clocks} {arrays}",
        *modules,
        *(part for item in sorted(shell.items()) for part in item),
        *identities,
    ):
        digest.update(text.encode() + b"\0")
    path = toolchain.cache_folder() / "fmi3" / f"{digest.hexdigest()[:24]}.fmu"
    return cached(path, lambda: _assemble(source, shell, clocks, arrays))


def _assemble(fmu: SourceFmu, shell: Mapping[str, str], clocks: bool, arrays: bool) -> bytes:
    old, identifier, units = fmu.description, fmu.identifier, fmu.units
    files = {**fmu.files, **shell, **{name: _fmi_header(name) for name in _FMI_2_HEADERS}}
    main = f"fmi3_{identifier}.c"

    scalars = old.findall("ModelVariables/ScalarVariable")
    variables = grouped(scalars, arrays=arrays, resizable="block.h" in files)
    references = 1 + max(int(str(each.get("valueReference"))) for each in scalars)
    indicators = int(old.get("numberOfEventIndicators") or 0)
    sampled = clocks and re.search(r"^#define SAMPLED\b", files[f"{identifier}.c"], re.M) is not None

    def source(token: str) -> str:
        return _source(old, identifier, token, variables, references, indicators, sampled)

    traits = Traits("", sampled, len(variables), indicators)
    token = guid_of(files, source(""), description_3(old, variables, traits).decode())
    files[main] = source(token)
    traits = Traits(token, sampled, len(variables), indicators)
    made = {
        name: data
        for name, data in fmu.members.items()
        if name.startswith(("documentation/", "terminalsAndIcons/", "resources/"))
    }
    made["modelDescription.xml"] = description_3(old, variables, traits)
    if PAGE in made:
        made[PAGE] = page_3(made[PAGE].decode(), made["modelDescription.xml"]).encode()
    compiled = (main, *(unit for unit in units if unit != f"{identifier}.c"))
    made |= {f"sources/{name}": text.encode() for name, text in files.items()}
    made["sources/buildDescription.xml"] = _build_description(identifier, compiled)
    sources = {
        unit: included(unit, files) | ({f"{identifier}.c": files[f"{identifier}.c"]} if unit == main else {})
        for unit in compiled
    }
    platforms = [_named(platform) for platform in fmu.platforms]
    made |= fmu.libraries(lambda platform: linked(platform, sources, identifier, fmu.quiet), platforms)
    return zipped(made, fmu.made)


def _named(platform: Platform) -> Platform:
    """Return a platform as FMI 3.0 names it."""
    folder, targets = _TUPLES.get(platform.folder, (platform.folder, None))
    return platform._replace(folder=folder, targets=targets or platform.targets)


def _source(
    old: etree._Element,
    identifier: str,
    token: str,
    variables: Sequence[Variable],
    references: int,
    indicators: int,
    sampled: bool,
) -> str:
    """Return the C file with the tables."""
    rows = [
        f"    [{v.reference}] = "
        + _row(
            v.type,
            v.type == "Float64" and len(v.elements) == 1,
            v.is_sized,
            v.is_intermediate,
            len(v.elements),
            v.inner,
        )
        for v in variables
    ]
    rows += [f"    [INDICATORS_REFERENCE + {k}] = {_row('Float64')}" for k in range(indicators)]
    rows += [f"    [CLOCK_REFERENCE] = {_row('Clock')}"] if sampled else []
    of_scalar = {int(str(each.get("valueReference"))): v for v in variables for each in v.elements}
    scalars = old.findall("ModelVariables/ScalarVariable")
    states: list[int] = []
    for unknown in old.iterfind("ModelStructure/Derivatives/Unknown"):
        derivative = scalars[int(str(unknown.get("index"))) - 1]
        state = scalars[int(str(derivative[0].get("derivative"))) - 1]
        states.append(of_scalar[int(str(state.get("valueReference")))].reference)
    distinct = list(dict.fromkeys(states))
    structural = next((f"#define STRUCTURAL         {v.inner}\n" for v in variables if v.type == "UInt64"), "")
    return _SOURCE.format(
        identifier=identifier,
        token=token,
        guid=old.get("guid"),
        references=references,
        indicators=indicators,
        variable_count=len(variables),
        state_count=len(distinct),
        variables="\n".join(rows),
        states=", ".join(map(str, distinct)) or "0",
        structural=structural,
        exchange=int(old.find("ModelExchange") is not None),
        events=int(sampled),
    )


def _row(
    kind: str, plain: bool = False, resized: bool = False, intermediate: bool = False, length: int = 1, inner: int = 0
) -> str:
    """Return a `Variable3` in C."""
    flags = ", ".join(str(flag).lower() for flag in (plain, resized, intermediate))
    return f"{{IS_{kind.upper()}, {flags}, {length}, {inner}}},"


def _build_description(identifier: str, compiled: Sequence[str]) -> bytes:
    root = etree.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = etree.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = etree.SubElement(configuration, "SourceFileSet", language="C99")
    for name in compiled:
        etree.SubElement(files, "SourceFile", name=name)
    etree.SubElement(
        files,
        "PreprocessorDefinition",
        name="FMI3_OVERRIDE_FUNCTION_PREFIX",
        value="",
        optional="true",
        description=f"for a shared library; in a static one, the functions have the prefix {identifier}_",
    )
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _fmi_header(name: str) -> str:
    """Return a header of FMI 2.0, which importers of FMI 3.0 need not have.

    As in the standard, and unlike in fmpy's copy, functions with a prefix are not exported.
    """
    text = (toolchain.header_folder() / name).read_text(encoding="utf-8").replace("\r\n", "\n")
    return re.sub(r"#if defined _WIN32.*?#endif\n(?=\n)|#define fmi2FullName.*?\n", _prefixed, text, flags=re.S)


def _prefixed(found: re.Match[str]) -> str:
    hidden = "fmi2FullName(name) PASTE(FMI2_FUNCTION_PREFIX, name)" if "fmi2FullName" in found[0] else "FMI2_Export"
    return f"#ifdef FMI2_FUNCTION_PREFIX\n#define {hidden}\n#else\n{found[0]}#endif\n"


def _shell() -> dict[str, str]:
    return {path.name: path.read_text(encoding="utf-8") for path in sorted((source_folder() / "fmi3").glob("*.h"))}
