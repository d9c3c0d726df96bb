"""The page of the report: its structure, its texts, its pieces, and that it is the same for the same study."""

from __future__ import annotations

import base64
import gzip
import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import html5lib
import numpy as np
import pytest
from lxml import etree
from made_up_study import made_up_study
from plotly.offline import get_plotlyjs
from thorough import landing, nightly, some

from friction_fmus.identification import ROTARY
from friction_fmus.report import report_html, write_report
from friction_fmus.report.figures import thinned, ticks
from friction_fmus.report.formatting import brief, multiple, number, quantity, unit, with_error
from friction_fmus.report.sections import SECTIONS, families, verdict
from friction_fmus.study.study_result import Recommendation, StudyCurve, StudyFinding, StudyResult
from harness.errors import OutputError

HOSTILE = '<script>alert("x")</script><b>&amp;'


@pytest.fixture(scope="module")
def text() -> str:
    return report_html(made_up_study())


def parsed(text: str) -> etree._ElementTree:
    """The page as a strict HTML 5 parser reads it."""
    parser = html5lib.HTMLParser(html5lib.getTreeBuilder("lxml"), strict=True, namespaceHTMLElements=False)
    return parser.parse(text)


def words(page: etree._ElementTree) -> str:
    """What a reader sees."""
    for element in page.xpath("//script|//style"):
        element.text = ""
    return " ".join("".join(page.getroot().itertext()).split())


def without_pieces() -> dict[str, StudyResult]:
    whole = made_up_study()
    none = Recommendation("none", "No compensator reduces the error.")
    return {
        "no compensators": replace(
            whole, compensators=(), ladder=(), limits=None, conditions=(), plant="",
            no_compensation="The record has no servo.", recommendation=Recommendation("", "The record has no servo."),
        ),
        "nothing improves": replace(whole, recommendation=none),
        "only the servo alone": replace(whole, compensators=whole.compensators[:1], recommendation=none),
        "all models failed": replace(whole, models=whole.models[-1:], friction=None, hysteresis=None, plant=""),
        "no hysteresis": replace(whole, hysteresis=None),
        "no series, files, citation": replace(whole, record=(), files=(), citation="", overview={}, versions={}),
        "compensators without runs": replace(
            whole,
            compensators=tuple(
                replace(row, trials=(), corners=(), error=None, cycles=None, margins=None, worst=None, best=None)
                for row in whole.compensators
            ),
        ),
        "a compensator that failed": replace(
            whole,
            compensators=(
                *whole.compensators[:2],
                replace(whole.compensators[2], metrics=None, rank=None, reason="It diverged."),
            ),
        ),
    }  # fmt: skip


def test_the_page_is_valid_and_in_order(text: str) -> None:
    page = parsed(text)
    assert page.getroot().get("lang") == "en"
    assert page.xpath("//meta[@name='viewport']")
    levels = [int(element.tag[1]) for element in page.xpath("//h1|//h2|//h3|//h4")]
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    ids = page.xpath("//@id")
    assert len(ids) == len(set(ids))
    assert {anchor.removeprefix("#") for anchor in page.xpath("//nav//a/@href")} <= set(ids)


def test_every_section_has_its_content(text: str) -> None:
    page = parsed(text)
    plots = page.xpath("//div[@class='plot']/@id")
    assert plots == [
        "turn-plot", "ladder-plot", "record-plot-1", "record-plot-2", "tradeoffs-plot", "errors-plot",
        "gains-plot", "bandwidths-plot",
        "servo-plot", "residual-velocity", "friction-plot", "hysteresis-plot",
    ]  # fmt: skip
    assert all(page.xpath("//div[@class='plot']/@aria-label"))
    shown = words(page)
    for phrase in (
        "LuGreFeedforward makes the tracking error 2.9 times smaller",
        "LuGreFeedforward reduces the tracking error from 340 µm to 4.20 µm rms, at most 5.46 µm in the worst case.",
        "the force residual on validation data is 3.40 %",
        "Switch on the feedforward of velocity.",
        "compare the record with this report: friction-fmus study bench.toml --verify after.csv -o out",
        "The log supports a rigid mass up to 24.0 Hz",
        "tolerates a lightly damped resonance of the axis from 31.0 Hz on",
        "(2 more samples)",
        "95.11 ± 0.10",
        "% allowed): they do not match.",
        "The log also shows: wrong-gains",
        "wrong-gainsit fits kp = 40 instead of kp = 30. Set kp = 40 in [servo].",
        "40.00 ± 0.20",
        "(1.234 ± 0.045)·10⁶",
        "poorly identifiable Few samples move slowly",
        "Leuven: The record has no reversal in presliding.",
        "1.40 µm (12.0 %)",
        "IterativeLearning: The reference does not repeat.",
        "friction x 0.9, mass x 1.1",
        "The loop hunts.",
        "fmus/bench_LuGre.fmu",
        "friction-fmus study bench.toml -o out",
        "A. Author, B. Author: Data of a bench, 2020",
        "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995",
    ):
        assert phrase in shown, phrase


def test_the_page_refers_to_no_other_file(text: str) -> None:
    page = parsed(text)
    assert not page.xpath("//link|//img|//iframe|//*[@src]")
    assert all(target.startswith("#") for target in page.xpath("//@href"))
    (policy,) = page.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")
    assert policy.startswith("default-src 'none';")
    (script,) = re.search(r"script-src ([^;]*)", policy).groups()  # type: ignore[union-attr]
    assert re.fullmatch(r"('sha256-[A-Za-z0-9+/=]{44}' ?){2}", script)


def test_the_library_comes_along_compressed(text: str) -> None:
    (packed,) = parsed(text).xpath("//script[@id='library']/text()")
    assert gzip.decompress(base64.b64decode(packed)).decode() == get_plotlyjs()
    assert len(text.encode()) < 6e6


@landing
def test_texts_of_the_user_are_text() -> None:
    study = made_up_study()
    best = study.models[0]
    hostile = replace(
        study,
        name=HOSTILE,
        citation=HOSTILE,
        overview={HOSTILE: HOSTILE},
        command=HOSTILE,
        models=(replace(best, name=HOSTILE, warnings=(HOSTILE,)), *study.models[1:]),
        compensators=tuple(
            replace(row, name=HOSTILE) if row.name == "StaticFeedforward" else row for row in study.compensators
        ),
        record=tuple(
            replace(picture, y_label=HOSTILE, models={HOSTILE: picture.models["LuGre"]}) for picture in study.record
        ),
    )  # fmt: skip
    text = report_html(hostile)
    page = parsed(text)
    assert len(page.xpath("//script")) == len(parsed(report_html(study)).xpath("//script"))
    assert not page.xpath("//td//b|//dd//b|//h1//b|//li//b")
    assert HOSTILE in page.xpath("string(//h1)")
    (data,) = page.xpath("//script[@id='record-plot-1-data']/text()")
    assert "<" not in data
    names = [trace["name"] for trace in json.loads(data)["data"]]
    assert '&lt;script&gt;alert("x")&lt;/script&gt;&lt;b&gt;&amp;amp;' in names  # plotly takes tags for its own
    assert HOSTILE in [trace["meta"] for trace in json.loads(data)["data"]]
    assert "&lt;script" in json.loads(data)["layout"]["yaxis"]["title"]["text"]


@pytest.mark.parametrize("name", some([*without_pieces()], ["compensators without runs", *[*without_pieces()][::5]]))
def test_what_is_missing_is_said_and_nothing_breaks(name: str) -> None:
    shown = words(parsed(report_html(without_pieces()[name])))
    said = {
        "no compensators": "The record has no servo.",
        "nothing improves": "No compensator reduces the error.",
        "only the servo alone": "No compensator reduces",
        "all models failed": "No model could be identified.",
        "no hysteresis": "No hysteresis is shown",
        "no series, files, citation": "No other files were written.",
        "compensators without runs": "reduces the tracking error from 340 µm to 4.20 µm rms.",
        "a compensator that failed": "StaticFeedforward: It diverged.",
    }
    assert said[name] in shown
    assert not re.search(r"\b(nan|None:|inf)\b", shown)


@nightly
def test_a_curve_that_leaves_the_record_does_not_flatten_it() -> None:
    study = made_up_study()
    assert study.hysteresis is not None
    loop = study.hysteresis.models["LuGre"]
    jump = StudyCurve(loop.x, (-3000.0, *loop.y[1:]))
    page = parsed(report_html(replace(study, hysteresis=replace(study.hysteresis, models={"LuGre": jump}))))
    (data,) = page.xpath("//script[@id='hysteresis-plot-data']/text()")
    low, high = json.loads(data)["layout"]["yaxis"]["range"]
    assert -40.0 < low < -20.0
    assert 20.0 < high < 40.0
    assert "the button “full range” shows all curves" in words(page)
    (data,) = parsed(report_html(study)).xpath("//script[@id='hysteresis-plot-data']/text()")
    assert "range" not in json.loads(data)["layout"]["yaxis"]


def test_the_same_study_gives_the_same_bytes(tmp_path: Path, text: str) -> None:
    file = tmp_path / "report.html"
    write_report(made_up_study(), file)
    assert file.read_bytes() == text.encode()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="nowhere"):
        write_report(made_up_study(), tmp_path / "nowhere" / "report.html")


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (0.0, 3, "0"), (-3.14159, 3, "−3.14"), (1234.5, 3, "1230"), (99.96, 3, "100"), (1.5e5, 2, "1.5·10⁵"),
        (2.5e-4, 2, "2.5·10⁻⁴"), (None, 3, "–"), (math.nan, 3, "–"), (math.inf, 3, "∞"), (0.0123, 3, "0.0123"),
    ],
)  # fmt: skip
def test_numbers_have_significant_digits(value: float | None, digits: int, shown: str) -> None:
    assert number(value, digits) == shown


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (20.3935, 0.21, "20.39 ± 0.21"), (-3.1648, 0.044, "−3.165 ± 0.044"), (203.5, 11.0, "204 ± 11"),
        (1.234e6, 4.5e4, "(1.234 ± 0.045)·10⁶"), (23800.0, 7100.0, "23800 ± 7100"), (2.0, None, "2.000"),
        (5.2e-4, 1.1e-5, "(5.20 ± 0.11)·10⁻⁴"), (0.01, 40.0, "0 ± 40"), (2.0, math.nan, "2.000"),
    ],
)  # fmt: skip
def test_the_error_says_how_many_digits_a_value_has(value: float, error: float | None, shown: str) -> None:
    assert with_error(value, error) == shown


def test_units_are_printed_and_scaled() -> None:
    assert [unit(name) for name in ("N.s/m", "kg.m2", "1", "um")] == ["N·s/m", "kg·m²", "", "µm"]
    assert quantity(1.2e-5, "m") == "12.0\u00a0µm"
    assert quantity(0.25, "N") == "0.250\u00a0N"
    assert quantity(None, "m") == "–"
    assert multiple("m", np.array([1e-6, math.nan, 2e-3])) == ("mm", 1e3)
    assert brief(0.75) == "0.75"


@pytest.mark.parametrize("count", [10, 999, 20_001])
def test_thinning_keeps_the_extremes_where_they_are(count: int) -> None:
    x = np.linspace(0.0, 1.0, count)
    y = np.random.default_rng(1).standard_normal(count)
    y[count // 3] = 50.0
    kept_x, kept_y = thinned(StudyCurve(tuple(x), tuple(y)), points=200)
    assert len(kept_x) <= max(200, min(count, 200))
    assert np.all(np.diff(kept_x) > 0)
    assert kept_x[np.argmax(kept_y)] == x[count // 3]
    assert np.min(kept_y) == np.min(y)


def test_a_report_of_a_rotary_axis_names_torques_in_their_units() -> None:
    study = made_up_study()
    linear, rotary = (
        re.sub(r"<script.*?</script>", "", report_html(each), flags=re.DOTALL)
        for each in (study, replace(study, units=ROTARY))
    )
    for before, after in (
        ("drive force above the loop bandwidth", "drive torque above the loop bandwidth"),
        ("total variation [N/s]", "total variation [N·m/s]"),
        ("force above bandwidth [N]", "torque above bandwidth [N·m]"),
    ):
        assert (before in linear, after in linear, before in rotary, after in rotary) == (True, False, False, True)


def test_the_verdict_says_first_that_errors_are_not_claimed() -> None:
    study = made_up_study()
    finding = StudyFinding("errors-not-claimed", "The errors cannot be claimed.", "Record the motion.")
    unclaimed = replace(study, findings=(*study.findings, finding))
    assert verdict(unclaimed).startswith("On the identified axis, but not necessarily on the machine, LuGreFeedforward")
    stopped = replace(unclaimed, findings=(replace(finding, stops=True),))  # of a study with --force
    assert verdict(stopped).startswith("The result cannot be trusted: on the identified axis, LuGreFeedforward")
    first = report_html(unclaimed).partition('id="turn-plot"')[0]
    assert "</strong>: The errors cannot be claimed. Record the motion." in first


def test_a_step_that_gains_less_than_5_percent_is_not_drawn() -> None:
    study = made_up_study()
    small = replace(study.ladder[1], title="with little", metrics=replace(study.ladder[0].metrics, rms=0.96 * 340e-6))
    few = SECTIONS["families"].values(replace(study, ladder=(study.ladder[0], small, *study.ladder[1:])))
    (dots,) = few["plot"].figure.data
    assert list(dots.x) == [340e-6, 12e-6, 4.2e-6]
    assert [each.text for each in few["plot"].figure.layout.annotations][1] == study.ladder[1].title


def test_of_each_family_there_is_the_best() -> None:
    study = made_up_study()
    kinds = [*"abcdefgh"]
    rows = [
        replace(study.compensators[1], name=f"{kind}{place}", kind=kind, rank=1 + place * len(kinds) + i)
        for place in range(2)
        for i, kind in enumerate(kinds)
    ]
    assert [row.name for row in families(replace(study, compensators=(study.compensators[0], *rows)))] == [
        f"{kind}0" for kind in "abcdef"
    ]


def test_logarithmic_axes_have_ticks_at_1_2_and_5() -> None:
    few = ticks(math.log10(8e-7), math.log10(1.2e-5), "m")
    numbers = dict(zip(few["tickvals"], few["ticktext"], strict=True))
    assert [numbers[value] for value in (1e-6, 2e-6, 5e-6, 1e-5)] == ["1 µm", "2 µm", "5 µm", "10 µm"]
    many = ticks(-1.0, 3.0)
    assert [text for text in many["ticktext"] if text] == ["0.1", "1", "10", "100", "1000"]
    assert len(many["tickvals"]) == 15


def test_a_study_without_a_comparison_says_why_once() -> None:
    page = report_html(without_pieces()["no compensators"])
    assert words(parsed(page)).count("The record has no servo.") == 1
    assert "What if the axis changes" not in page
