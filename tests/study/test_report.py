"""Metrics, summary, parameter files and report, on made-up numbers."""

from __future__ import annotations

import io
import json
import math
import re
import tomllib
from html.parser import HTMLParser
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv
from lxml import etree
from rich.console import Console

from friction_fmus.identification import FitError, Record
from friction_fmus.study import Compensation, Identified, Summary, Tracking, agreement, rms, summary_table
from friction_fmus.study.figures import (
    FrictionCurve,
    Trace,
    compensation_figure,
    data_uri,
    force_figure,
    friction_figure,
    png_bytes,
    position_figure,
)
from friction_fmus.study.metrics import Agreement, tracking_rms_um
from friction_fmus.study.parameters import Parameter, ParameterFileError, ssv_bytes, toml_text
from friction_fmus.study.report import Illustration, report_html
from friction_fmus.study.summary import AS_MEASURED, WITH_MOTION, number


def axis() -> Record:
    t = np.arange(0.0, 2.0, 1e-3)
    return Record("bench", t, 0.1 * np.sin(3.0 * t), 0.1 * np.sin(3.0 * t) + 1e-4, np.cos(3.0 * t))


def summary() -> Summary:
    rows = [
        Tracking(servo, feedforward, value, 2.0 * value)
        for servo, values in ((AS_MEASURED, (9.0, 8.0, 7.0)), (WITH_MOTION, (6.0, 5.0, 4.0)))
        for feedforward, value in zip(("none", "coulomb", "stribeck"), values, strict=True)
    ]
    return Summary(
        record="<bench> & co",
        citation="A. Author: <i>Data</i> & more",
        identified={
            "M": Identified(95.0, 0.1, "kg", 95.1089, "mass"),
            "OF": Identified(-3.0, 0.1, "N", -3.2, "offset"),
        },
        stribeck={"delta": Identified(2.0, math.nan, "1", None, "exponent")},
        closed_loop={"coulomb": Agreement(1.6, 4.5), "stribeck": Agreement(1.4, 3.9)},
        compensation=Compensation(tuple(rows)),
        notes={"step": "<100 us>"},
        files=("report.html", "a<b>.fmu"),
    )


def pictures() -> list[Illustration]:
    record = axis()
    traces = {name: Trace(record.q + 1e-6, record.force + 0.1) for name in ("coulomb", "stribeck")}
    at = np.linspace(-0.3, 0.3, 100)
    curve = FrictionCurve(record.q, record.force, at, {"coulomb": np.sign(at), "stribeck": 2.0 * np.sign(at)})
    errors = {"as measured": {"none": record.q, "stribeck": 0.5 * record.q}}
    return [
        Illustration("closed loop", position_figure(record, traces), 'Position "error" <now>'),
        Illustration("closed loop", force_figure(record, traces), "Force"),
        Illustration("friction", friction_figure(curve), "Friction"),
        Illustration("compensation", compensation_figure(record, errors), "Compensation"),
    ]


class Page(HTMLParser):
    """Counts what is on a page and checks that every tag is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_metrics_are_root_mean_squares() -> None:
    record = axis()
    found = agreement(record, record.q + 2e-6, 1.1 * record.force)
    assert found.position_rms_um == pytest.approx(2.0)
    assert found.force_percent == pytest.approx(10.0)
    assert rms(np.array([3.0, -3.0])) == 3.0
    assert tracking_rms_um(record.reference, record.q) == pytest.approx(100.0)


def test_tracking_does_not_count_the_start_up() -> None:
    record = axis()
    q = record.reference.copy()
    q[:100] += 1.0
    assert tracking_rms_um(record.reference, q) == 0.0


def test_a_simulation_of_another_length_is_refused() -> None:
    with pytest.raises(FitError, match="1999 positions"):
        agreement(axis(), np.zeros(1999), np.zeros(2000))


def test_the_summary_has_the_agreed_keys() -> None:
    content = json.loads(summary().to_json())
    assert set(content["identified"]["M"]) >= {"value", "standard_error", "unit", "published"}
    assert content["closed_loop"]["stribeck"] == {"position_rms_um": 1.4, "force_percent": 3.9}
    assert content["compensation"]["tracking_rms_um"] == {"without": 9.0, "with": 7.0}
    assert content["compensation"]["tracking_rms_um_with_motion_feedforward"] == {"without": 6.0, "with": 4.0}
    assert content["stribeck"]["delta"]["standard_error"] is None


def test_a_row_that_is_not_there_is_named() -> None:
    with pytest.raises(KeyError, match="'dahl'"):
        summary().compensation.rms_um(AS_MEASURED, "dahl")


def test_the_table_shows_every_figure() -> None:
    console = Console(width=140, file=io.StringIO())
    console.print(summary_table(summary()))
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    for shown in ("95.0000", "95.1089", "kg", "1.600", "4.50", "9.00", "4.00", AS_MEASURED, WITH_MOTION):
        assert shown in text


@pytest.mark.parametrize(
    ("value", "shown"),
    [(95.1089, "95.1089"), (0.01234, "0.0123"), (None, "–"), (math.nan, "–"), (0.0, "0.0000"), (-3.1648, "-3.1648")],
)
def test_numbers_are_readable(value: float | None, shown: str) -> None:
    assert number(value) == shown


def test_the_report_needs_nothing_else() -> None:
    text = report_html(summary(), pictures(), "friction-fmus study <x>")
    page = Page(text)
    assert not page.open
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert len(images) == 4
    assert all((image["src"] or "").startswith("data:image/png;base64,") and image["alt"] for image in images)
    assert not [tag for tag, _ in page.tags if tag in ("script", "link", "iframe")]
    assert not re.search(r"(src|href)=\"(?!data:)", text)
    assert any(tag == "meta" and attrs.get("name") == "viewport" for tag, attrs in page.tags)


def test_the_report_escapes_what_it_is_given() -> None:
    page = Page(report_html(summary(), pictures(), "friction-fmus study <x>"))
    for shown in ("<bench> & co", "<i>Data</i>", "<100 us>", "a<b>.fmu", "study <x>", 'Position "error" <now>'):
        assert shown in page.text
    assert "+0.000 %" not in page.text
    assert "-0.115 %" in page.text  # (95 - 95.1089) / 95.1089
    assert "+6.250 %" in page.text  # (-3 + 3.2) / 3.2: less negative is more


def test_figures_are_png_and_repeat_byte_for_byte() -> None:
    first, second = (png_bytes(pictures()[0].figure, 50) for _ in range(2))
    assert first.startswith(b"\x89PNG")
    assert first == second
    assert data_uri(pictures()[0].figure, 50).startswith("data:image/png;base64,iVBOR")


def test_figures_are_labelled() -> None:
    for shown in pictures():
        for axes in shown.figure.axes:
            assert "[" in axes.get_ylabel()
        assert "[" in shown.figure.axes[-1].get_xlabel()
        assert shown.figure.legends


PARAMETERS = {
    "friction.Fc": Parameter(20.3935, "N", "Coulomb & <friction>", 0.1),
    "friction.Fv": Parameter(203.5034, "N.s/m", "viscous"),
    "velocity.window": Parameter(2),
    "friction.asymmetric": Parameter(False),
    "friction.delta": Parameter(2.0, "1", 'the "exponent"', math.nan),
}


def test_ssv_is_valid_and_holds_the_values() -> None:
    text = ssv_bytes("set", PARAMETERS, "A. Author & B. Author")
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
    file.write_bytes(ssv_bytes("set", PARAMETERS))
    found = {parameter.name: parameter.value for parameter in read_ssv(str(file)).parameters}
    assert float(found["friction.Fv"]) == 203.5034


@pytest.mark.parametrize(
    ("parameter", "complaint"),
    [(Parameter(math.nan, "N"), "finite"), (Parameter(1.0, "furlong"), "unit 'furlong' of the parameter 'x'")],
)
def test_ssv_refuses(parameter: Parameter, complaint: str) -> None:
    with pytest.raises(ParameterFileError, match=complaint):
        ssv_bytes("set", {"x": parameter})


def test_toml_is_read_back() -> None:
    content = tomllib.loads(toml_text('A "title"', {"set": PARAMETERS}, "A. Author"))
    assert content["title"] == 'A "title"'
    assert content["citation"] == "A. Author"
    assert content["set"]["friction.Fc"] == {
        "value": 20.3935,
        "unit": "N",
        "standard_error": 0.1,
        "description": "Coulomb & <friction>",
    }
    assert content["set"]["friction.asymmetric"]["value"] is False
    assert "standard_error" not in content["set"]["friction.delta"]
