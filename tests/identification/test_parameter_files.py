"""Parameter values as files: SSV and TOML."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import fmpy
import pytest
import tomli_w
from fmpy.ssp.ssd import read_ssv
from lxml import etree

from friction_fmus.identification.result_files import toml_entry
from harness import HarnessError, Parameter, ParameterSet
from harness.ssp.ssv import ssv_bytes

PARAMETERS = {
    "friction.Fc": Parameter(20.3935, "N", description="Coulomb & <friction>"),
    "friction.Fv": Parameter(203.5034, "N.s/m", description="viscous"),
    "velocity.window": Parameter(2),
    "friction.asymmetric": Parameter(False),
    "friction.delta": Parameter(2.0, "1", description='the "exponent"'),
}


def test_ssv_is_valid_and_holds_the_values() -> None:
    text = ssv_bytes(ParameterSet("set", PARAMETERS, "of A. Author & B. Author"))
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureParameterValues.xsd"
    tree = etree.fromstring(text)
    etree.XMLSchema(etree.parse(schema)).assertValid(tree)
    space = {"ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues"}
    values = {p.get("name"): p[0].get("value") for p in tree.findall(".//ssv:Parameter", space)}
    assert float(values["friction.Fc"] or "nan") == 20.3935
    assert values["velocity.window"] == "2"
    assert values["friction.asymmetric"] == "false"
    assert "B. Author" in (tree.get("description") or "")


def test_ssv_is_read_by_fmpy(tmp_path: Path) -> None:
    file = tmp_path / "set.ssv"
    file.write_bytes(ssv_bytes(ParameterSet("set", PARAMETERS, "")))
    found = {parameter.name: parameter.value for parameter in read_ssv(str(file)).parameters}
    assert float(found["friction.Fv"]) == 203.5034


@pytest.mark.parametrize(
    ("parameter", "complaint"),
    [(Parameter(math.nan, "N"), "finite"), (Parameter(1.0, "furlong"), "unit 'furlong' of the parameter 'x'")],
)
def test_ssv_refuses(parameter: Parameter, complaint: str) -> None:
    with pytest.raises(HarnessError, match=complaint):
        ssv_bytes(ParameterSet("set", {"x": parameter}, ""))


def test_toml_is_read_back() -> None:
    table = {
        "Fc": toml_entry(20.3935, "N", "Coulomb & <friction>", 0.1),
        "asymmetric": toml_entry(False, "1", ""),
        "vs": toml_entry(2.0, "m/s", '"', math.nan),
    }
    content = tomllib.loads(tomli_w.dumps(table))
    assert content["Fc"] == {
        "value": 20.3935,
        "unit": "N",
        "standard_error": 0.1,
        "description": "Coulomb & <friction>",
    }
    assert content["asymmetric"] == {"value": False, "unit": "1"}
    assert content["vs"] == {"value": 2.0, "unit": "m/s", "description": '"'}
