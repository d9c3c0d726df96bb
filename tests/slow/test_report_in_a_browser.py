"""The report in a real Chromium: plots drawn, nothing fetched, readable on a phone, printable, accessible."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
from axe_playwright_python.sync_playwright import Axe
from browser import needs_chromium
from PIL import Image
from playwright.sync_api import Browser, Page
from slow.test_rotary_study import linear_words
from study.made_up_study import made_up_study
from study.small_axis import NOISE, bench_of, rotary_bench_of, runs_of
from thorough import nightly, some

from friction_fmus.identification import ROTARY
from friction_fmus.report import write_report
from friction_fmus.study.what_if import WhatIf, panel_of

SCREENS: dict[str, dict[str, Any]] = {
    "desktop": {"viewport": {"width": 1280, "height": 900}},
    "phone": {"viewport": {"width": 360, "height": 740}, "is_mobile": True, "has_touch": True},
    "dark": {"viewport": {"width": 1280, "height": 900}, "color_scheme": "dark"},
}
pytestmark = needs_chromium


@dataclass
class Watched:
    """A page that is open, and what it did: requests, messages on the console, errors."""

    page: Page
    requests: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> WhatIf:
    """The what-if panel of a simulated axis."""
    bench = bench_of(tmp_path_factory.mktemp("axis"))
    panel = panel_of(bench, runs_of(bench), NOISE)
    assert not isinstance(panel, str), panel
    return panel


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory, panel: WhatIf) -> Path:
    """A made-up study with the panel."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(made_up_study(), path, panel)
    return path


@contextmanager
def opened(browser: Browser, report: Path, screen: str, *, folded: bool = False, **more: Any) -> Iterator[Watched]:
    """A page, on which the reader has opened all sections unless they are to stay folded."""
    context = browser.new_context(**SCREENS[screen], **more)
    page = context.new_page()
    watched = Watched(page)
    page.on("request", lambda request: watched.requests.append(request.url))
    page.on("console", lambda message: watched.messages.append(message.text))
    page.on("pageerror", lambda error: watched.messages.append(str(error)))
    page.goto(report.as_uri())
    page.wait_for_selector("html[data-plots=drawn]", timeout=30_000)
    page.wait_for_selector("#what-if[data-ready]", timeout=30_000)
    if not folded:
        page.evaluate("document.querySelectorAll('details').forEach((each) => (each.open = true))")
    yield watched
    context.close()


@pytest.fixture(params=some(list(SCREENS), ["phone"]))
def watched(request: pytest.FixtureRequest, browser: Browser, report: Path) -> Iterator[Watched]:
    with opened(browser, report, request.param) as watched:
        yield watched


def inked(picture: Image.Image) -> float:
    """The part of a picture that is not of its background, the colour of its corner."""
    pixels = np.asarray(picture.convert("RGB"), dtype=int)
    return float(np.mean(np.abs(pixels - pixels[0, 0]).sum(axis=2) > 60))


def test_a_screen_shows_all_without_network_or_error(watched: Watched, report: Path) -> None:
    page = watched.page
    for plot in page.query_selector_all(".plot"):
        plot.scroll_into_view_if_needed()
        box = plot.bounding_box()
        assert box is not None
        assert plot.query_selector_all(".trace path, .point path")
        assert inked(Image.open(io.BytesIO(plot.screenshot()))) > 0.004, plot.get_attribute("id")
        assert box["x"] >= 0 and box["x"] + box["width"] <= page.viewport_size["width"]  # type: ignore[index]
    widths = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert widths[0] == widths[1], "the page scrolls sideways"
    assert watched.requests == [report.as_uri()]
    assert watched.messages == []

    found = Axe().run(page).response
    assert len(found["passes"]) > 20
    assert [rule["id"] for rule in found["violations"] if rule["impact"] in ("serious", "critical")] == []


def test_legend_and_zoom_work_by_key(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop") as watched:
        page = watched.page

        def span() -> list[float]:
            return page.eval_on_selector("#errors-plot", "box => box.layout.xaxis.range")

        whole = span()
        tools = page.locator("figure:has(#errors-plot) .tools")
        tools.get_by_role("button", name="around a reversal").press("Enter")
        begin, end = span()
        assert end - begin == pytest.approx(0.8, rel=1e-3)  # 4 % of 20 s
        assert (begin + end) / 2 == pytest.approx(7.5, abs=0.01) or (begin + end) / 2 == pytest.approx(12.5, abs=0.01)
        tools.get_by_role("button", name="zoom out").press("Enter")
        assert span()[1] - span()[0] == pytest.approx(1.6, rel=1e-3)
        tools.get_by_role("button", name="to the right").press("Enter")
        assert span()[0] == pytest.approx(begin + 0.4, abs=1e-3)
        tools.get_by_role("button", name="full range").press("Enter")
        assert span() == pytest.approx(whole)

        drawn = "box => box.querySelectorAll('.scatterlayer .trace').length"
        before = page.eval_on_selector("#gains-plot", drawn)
        name = page.locator("#gains-plot-legend").get_by_role("button", name="GMSFeedforward")
        assert name.get_attribute("aria-pressed") == "true"
        name.press("Enter")
        assert name.get_attribute("aria-pressed") == "false"
        assert page.eval_on_selector("#gains-plot", drawn) == before - 1
        assert watched.messages == []


def test_texts_of_the_user_run_no_code(browser: Browser, panel: WhatIf, tmp_path: Path) -> None:
    text = '</script><img src=x onerror="window.ran = 1"><a href="javascript:window.ran = 1">\u202e\x1b${"'
    study = made_up_study()
    record = tuple(replace(each, y_label=text, models={text: each.models["LuGre"]}) for each in study.record)
    named = replace(study, name=text, command=text, citation=text, overview={text: text}, record=record)
    write_report(named, tmp_path / "report.html", panel)
    with opened(browser, tmp_path / "report.html", "desktop") as watched:
        found = "[window.ran ?? 0, document.querySelectorAll('[onerror], a[href^=javascript]').length]"
        assert watched.page.evaluate(found) == [0, 0]
        assert "</script><img" in watched.page.locator("h1").inner_text()
        assert watched.messages == []


@nightly
def test_a_curve_in_two_panels_has_one_entry_in_the_legend(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop") as watched:
        names = watched.page.locator("#tradeoffs-plot-legend button").all_inner_texts()
        assert len(names) == len(set(names))
        assert "feedforward" in names


@nightly
def test_dark_mode_comes_and_goes_with_the_system(browser: Browser, report: Path) -> None:
    with opened(browser, report, "dark") as watched:
        background = "box => box.layout.paper_bgcolor"
        assert watched.page.eval_on_selector("#gains-plot", background) == "#15181c"
        watched.page.emulate_media(color_scheme="light")
        watched.page.wait_for_selector("#gains-plot .main-svg[style*='rgb(255, 255, 255)']")
        assert watched.page.eval_on_selector("#gains-plot", background) == "#ffffff"


def test_the_print_has_pages_and_all_plots(browser: Browser, report: Path) -> None:
    with opened(browser, report, "dark") as watched:
        printed = watched.page.pdf(prefer_css_page_size=True, print_background=True)
        assert watched.page.eval_on_selector("#errors-plot", "box => box.layout.paper_bgcolor") == "#15181c"
        watched.page.emulate_media(media="print")
        watched.page.set_viewport_size({"width": 680, "height": 900})  # 180 mm, the width of the text on A4
        cut = "[...document.querySelectorAll('.scroll')].filter((box) => box.scrollWidth > box.clientWidth + 1)"
        assert watched.page.evaluate(f"{cut}.map((box) => box.getAttribute('aria-label'))") == []
    document = pypdfium2.PdfDocument(printed)
    assert 4 <= len(document) <= 15
    titles = ("position [mm]", "force [N]", "velocity [mm/s]", "displacement [µm]", "Ms", "time [s]", "gain")
    text = "".join(page.get_textpage().get_text_bounded() for page in document)
    for title in titles:
        assert title in text, title
    for page in document:
        width, height = page.get_size()
        assert (round(width), round(height)) == (595, 842)  # A4
        picture = page.render(scale=1.0).to_pil()
        assert picture.getpixel((0, 0)) == (255, 255, 255)
        assert inked(picture) > 0.005
        right = np.asarray(picture.convert("L"))[:, round(width) - 25 :]
        assert right.min() > 200, "something is cut off at the right margin"


@pytest.mark.parametrize("screen", some(list(SCREENS), ["phone", "dark"]))
def test_the_first_screen_has_verdict_plot_and_steps(browser: Browser, report: Path, screen: str) -> None:
    with opened(browser, report, screen, folded=True) as watched:
        page = watched.page
        last = page.locator("#turn-plot") if screen == "phone" else page.locator("#result ~ ol li").last
        box = last.bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= page.viewport_size["height"]  # type: ignore[index]
        assert page.locator("#result").inner_text().startswith("LuGreFeedforward reduces the tracking error")
        assert page.locator("#result ~ ol li").count() == 3
        assert not page.locator("#errors-plot").is_visible()
        page.locator("#compensators").click()
        assert page.locator("#errors-plot").is_visible()
        widths = page.evaluate(
            "['#errors-plot', '#ladder-plot'].map((name) => document.querySelector(name + ' .main-svg').clientWidth)"
        )
        assert widths[0] == widths[1]


def test_a_print_without_the_folded_sections_is_short(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop", folded=True) as watched:
        document = pypdfium2.PdfDocument(watched.page.pdf(prefer_css_page_size=True, print_background=True))
    pages = [page.get_textpage().get_text_bounded() for page in document]
    assert len(pages) <= 5
    for text in ("LuGreFeedforward reduces", "time after the reversal [s]", "recommended/c", "--verify after.csv"):
        assert text in pages[0]
    assert "Citations" not in "".join(pages)


def errors_shown(page: Page) -> list[list[str]]:
    """The rows of the panel: rms in the report and now, largest error in the report and now."""
    return [row.locator("td").all_inner_texts() for row in page.locator("#what-if tbody tr").all()]


def settled(page: Page) -> list[list[str]]:
    page.wait_for_timeout(100)
    page.wait_for_selector("#what-if[aria-busy=false]")
    return errors_shown(page)


@pytest.mark.parametrize("screen", some(list(SCREENS), ["phone"]))
def test_the_panel_starts_with_the_numbers_of_the_report(browser: Browser, report: Path, screen: str) -> None:
    with opened(browser, report, screen) as watched:
        for rms, rms_now, largest, largest_now in errors_shown(watched.page):
            assert (rms_now, largest_now) == (rms, largest)
        widths = watched.page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        assert widths[0] == widths[1]
        assert not watched.page.locator(".what-if-picture").is_visible()
        assert watched.messages == []


def test_every_slider_moves_curves_and_numbers_and_is_reset_by_key(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop") as watched:
        page = watched.page
        first = errors_shown(page)
        figures = page.locator("#what-if-error"), page.locator("#what-if-force")
        drawn = [figure.screenshot() for figure in figures]
        assert all(inked(Image.open(io.BytesIO(picture))) > 0.005 for picture in drawn)
        for row in page.locator("#what-if .slider").all():
            slider = row.locator("input[type=range]")
            for _ in range(12):
                slider.press("PageUp")
            name = row.locator("b").inner_text()
            assert settled(page) != first, name
            assert figures[0].screenshot() != drawn[0], name
            row.get_by_role("button").press("Enter")
            assert settled(page) == first, name
        page.locator("#what-if input[type=number]").first.fill("2")
        double = settled(page)
        assert double[1] != first[1]
        page.get_by_role("button", name="Reset all").press("Enter")
        assert settled(page) == first
        page.locator("#what-if input[type=number]").first.fill("-1")
        assert page.get_by_role("alert").inner_text() == "friction must be between 0.1 and 4."
        assert errors_shown(page) == first
        page.get_by_role("button", name="around a reversal").last.press("Enter")
        assert figures[0].screenshot() != drawn[0]
        assert watched.messages == []


@nightly
def test_the_panel_follows_a_finger(browser: Browser, report: Path) -> None:
    with opened(browser, report, "phone") as watched:
        page = watched.page
        first = errors_shown(page)
        slider = page.locator("#what-if .slider input[type=range]").first
        box = slider.bounding_box()
        assert box is not None
        slider.tap(position={"x": 0.8 * box["width"], "y": 0.5 * box["height"]})
        assert settled(page) != first
        assert watched.messages == []


@nightly
def test_the_panel_redraws_within_100_ms(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop") as watched:
        page = watched.page
        slider = page.locator("#what-if .slider input[type=range]").first
        for _ in range(15):
            slider.press("ArrowRight")
            settled(page)
        taken = page.evaluate("performance.getEntriesByName('redraw').map((each) => each.duration)")
        assert len(taken) >= 15
        assert np.median(taken) <= 100.0


@nightly
def test_the_panel_of_a_rotary_axis_has_its_words_and_units(browser: Browser, tmp_path: Path) -> None:
    bench = rotary_bench_of(tmp_path)
    panel = panel_of(bench, runs_of(bench), NOISE)
    assert not isinstance(panel, str), panel
    write_report(replace(made_up_study(), units=ROTARY), tmp_path / "report.html", panel)
    with opened(browser, tmp_path / "report.html", "phone") as watched:
        page, box = watched.page, watched.page.locator("#what-if")
        names = box.locator(".slider b").all_inner_texts()
        assert names == ["friction", "inertia", "delay", "controller gains", "encoder step"]
        units = dict(zip(names, box.locator(".slider .unit").all_inner_texts(), strict=True))
        assert (units["inertia"], units["encoder step"]) == ("kg·m²", "µrad")
        assert linear_words(box.inner_text()) == []
        labels = box.locator("[aria-label]").evaluate_all("all => all.map((each) => each.getAttribute('aria-label'))")
        assert linear_words(" ".join(labels)) == []
        assert "Drive torque" in box.inner_text()
        first = errors_shown(page)
        for row in first:
            rms, rms_now, largest, largest_now = (float(value.removesuffix("\u00a0mrad")) for value in row)
            assert (rms_now, largest_now) == (pytest.approx(rms, rel=0.02), pytest.approx(largest, rel=0.02))
        for row in box.locator(".slider").all():
            row.locator("input[type=range]").fill("700")
            assert settled(page) != first
            row.get_by_role("button").press("Enter")
            assert settled(page) == first
        assert watched.messages == []


@nightly
def test_of_a_long_record_the_panel_has_the_first_part(browser: Browser, panel: WhatIf, tmp_path: Path) -> None:
    """The part is 0.6 s, the record of the made-up study 20 s, with reversals at 7.5 s and 12.5 s."""
    part = replace(panel, r=panel.r[:600], noise=panel.noise[:600], whole=False)
    write_report(made_up_study(), tmp_path / "report.html", part)
    with opened(browser, tmp_path / "report.html", "desktop") as watched:
        page, box = watched.page, watched.page.locator("#what-if")
        said = page.locator("section", has=box).inner_text().replace("\u00a0", " ")
        assert "The first 600 ms of the log are simulated" in said, said
        assert not box.get_by_role("button", name="around a reversal").is_visible()
        assert float(page.locator("#what-if-error .u-axis").count()) == 2
        time = page.locator("#what-if-error .area, #what-if-force .area")
        assert time.count() == 2
        first = errors_shown(page)
        assert all("\u2013" not in row for row in first)
        page.locator("#what-if input[type=number]").first.fill("2")
        assert settled(page) != first
        assert watched.messages == []


@nightly
def test_with_reduced_motion_nothing_moves_by_itself(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop", reduced_motion="reduce") as watched:
        page = watched.page
        slider = page.locator("#what-if .slider input[type=range]").first
        moving = """[...document.querySelectorAll("*")].filter((each) => {
            const { animationName, scrollBehavior } = getComputedStyle(each);
            return animationName !== "none" || scrollBehavior === "smooth";
        }).length + document.getAnimations().length"""
        for act in (lambda: slider.press("PageUp"), lambda: slider.press("End")):
            act()
            settled(page)
            assert page.evaluate(moving) == 0
            before = page.locator("#what-if-error").screenshot()
            page.wait_for_timeout(300)
            assert page.locator("#what-if-error").screenshot() == before
        assert watched.messages == []


@nightly
def test_an_unstable_loop_is_called_unstable(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop") as watched:
        page = watched.page
        for name, value in (("delay", "7"), ("controller gains", "3"), ("mass", "0.25")):
            page.locator("#what-if .slider", has=page.get_by_text(name, exact=True)).get_by_role("spinbutton").fill(
                value
            )
        now = settled(page)
        said = page.locator("#what-if [role=status]")
        assert re.match("Unstable with the recommended compensator: 6 more samples of delay exceed", said.inner_text())
        assert said.get_attribute("class") == "said bad"
        assert now[1][1] == "\u2013"
        page.get_by_role("button", name="Reset all").press("Enter")
        page.wait_for_selector("#what-if .said.good")
        text = said.inner_text().replace("\u00a0", " ")
        found = re.search(r"is ([\d.]+) µm rms, ([\d.]+) times less than the ([\d.]+) µm of the servo alone", text)
        assert found is not None, text
        least, ratio, most = map(float, found.groups())
        assert ratio == pytest.approx(most / least, rel=0.05)
        assert said.get_attribute("class") == "said good"
        assert watched.messages == []


def test_without_scripts_there_is_a_picture_and_a_sentence(browser: Browser, report: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(report.as_uri())
    picture = page.locator(".what-if-picture svg")
    assert picture.is_visible()
    assert inked(Image.open(io.BytesIO(picture.screenshot()))) > 0.005
    assert (
        "sliders change friction, mass, delay, controller gains and encoder step"
        in page.locator(".what-if-picture").inner_text()
    )
    assert not page.locator("#what-if").is_visible()
    context.close()


def test_the_policy_of_the_page_forbids_the_network_other_scripts_and_styles(browser: Browser, report: Path) -> None:
    with opened(browser, report, "desktop") as watched:
        page = watched.page
        refused = page.evaluate("fetch('https://example.org/').then(() => false, () => true)")
        assert refused
        page.evaluate(
            "document.body.append(Object.assign(document.createElement('script'), {text: 'window.other = 1'}))"
        )
        assert page.evaluate("window.other") is None
        page.evaluate(
            "document.body.append(Object.assign(document.createElement('style'), {textContent: 'p {color: red}'}))"
        )
        page.evaluate("document.body.setAttribute('style', 'color: red')")
        assert page.evaluate("getComputedStyle(document.querySelector('p')).color") != "rgb(255, 0, 0)"
        assert len(watched.messages) >= 4
        assert all("Content Security Policy" in message for message in watched.messages)


@nightly
def test_the_panel_adds_less_than_a_megabyte(report: Path, tmp_path: Path) -> None:
    write_report(made_up_study(), tmp_path / "report.html")
    assert report.stat().st_size - (tmp_path / "report.html").stat().st_size < 1e6
