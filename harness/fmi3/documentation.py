"""The section on FMI of an FMU's documentation, for FMI 3.0."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from lxml import etree

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
