"""Messages: whole, in the right category, and only when asked for."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import c_char_p, create_string_buffer

import pytest
from lxml import etree
from shell.instance import DISCARD, ERROR, OK, Instance, Library


def debug(run: Instance, on: bool, *categories: bytes) -> int:
    return run.call("SetDebugLogging", on, len(categories), (c_char_p * len(categories))(*categories))


def provoke(run: Instance) -> list[str]:
    """Categories of the messages of one error and one discard."""
    run.messages.clear()
    assert run.call("ExitInitializationMode") == ERROR
    assert run.try_set({"v": float("nan")}) == [DISCARD]
    return [category for _, _, category, _ in run.messages]


@pytest.mark.parametrize("name", [b"100% sure", b"%s%n%d %5.3f", b"%", b"%%", b"\xc3\xa4 / path / with spaces"])
def test_a_percent_sign_survives_a_logger_in_the_style_of_printf(lugre: Library, name: bytes) -> None:
    """The message is a format without arguments; expanding it gives the text."""
    with Instance(lugre, name) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"v": 1e308, "sigma2": 1e10})
        assert run.call("ExitInitializationMode") == ERROR
        logged_name, _, _, message = run.messages[-1]
        assert logged_name == name.decode()
        expanded = create_string_buffer(2000)
        ctypes.CDLL(None).snprintf(expanded, ctypes.c_size_t(2000), message)
        assert b'"' + name + b'"' in expanded.value
        assert expanded.value.replace(b"%", b"%%") == message


def test_an_unknown_category_with_percent_signs_is_quoted_whole(lugre: Library) -> None:
    with Instance(lugre) as run:
        assert debug(run, True, b"50%") == ERROR
        assert b'"50%%"' in run.messages[-1][3]


def test_a_message_longer_than_any_buffer_is_cut_and_not_spilt(lugre: Library) -> None:
    name = b"%" * 5000
    with Instance(lugre, name) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"v": 1e308, "sigma2": 1e10})
        assert run.call("ExitInitializationMode") == ERROR
        message = run.messages[-1][3]
        assert 400 < len(message) < 2000 and message.count(b"%") % 2 == 0
        assert run.messages[-1][0] == name.decode()


def test_the_instance_name_and_the_callbacks_are_copied(lugre: Library) -> None:
    name = create_string_buffer(b"original")
    run = Instance(lugre, name.value)
    run._callbacks.logger = None
    name.value = b"lost"
    with run:
        assert run.call("DoStep", 0.0, 0.1, 1) == ERROR
        assert run.messages[-1][0] == "original"


def test_without_logging_nothing_is_said(lugre: Library) -> None:
    with Instance(lugre, logging=False) as run:
        assert provoke(run) == []


def test_the_categories_of_the_xml_are_those_of_the_library(library: Library) -> None:
    root = etree.parse(library.folder / "modelDescription.xml").getroot()
    names = [category.get("name") for category in root.iter("Category")]
    assert {"logStatusWarning", "logStatusDiscard", "logStatusError", "logEvents", "logAll"} <= set(names)
    with Instance(library) as run:
        for name in names:
            assert debug(run, True, name.encode()) == OK
        assert debug(run, True, *(name.encode() for name in names)) == OK


CASES: list[tuple[bool, Sequence[tuple[bool, tuple[bytes, ...]]], list[str]]] = [
    (False, [(True, ())], ["logStatusError", "logStatusDiscard"]),
    (False, [(True, (b"logAll",))], ["logStatusError", "logStatusDiscard"]),
    (False, [(True, (b"logStatusError",))], ["logStatusError"]),
    (False, [(True, (b"logStatusDiscard",))], ["logStatusDiscard"]),
    (False, [(True, (b"logEvents", b"logStatusWarning"))], []),
    (False, [(True, (b"logStatusError", b"logStatusDiscard"))], ["logStatusError", "logStatusDiscard"]),
    (True, [], ["logStatusError", "logStatusDiscard"]),
    (True, [(False, ())], []),
    (True, [(True, (b"logStatusError",))], ["logStatusError"]),
    (True, [(False, (b"logStatusDiscard",))], ["logStatusError"]),
]


@pytest.mark.parametrize(("at_first", "calls", "heard"), CASES)
def test_only_the_chosen_categories_are_heard(
    lugre: Library, at_first: bool, calls: Sequence[tuple[bool, tuple[bytes, ...]]], heard: list[str]
) -> None:
    """Section 2.1.5: with loggingOn = true and categories, "only debug messages according to the categories"."""
    with Instance(lugre, logging=at_first) as run:
        for on, categories in calls:
            assert debug(run, on, *categories) == OK
        assert provoke(run) == heard


def test_an_unknown_category_is_an_error_and_changes_nothing(lugre: Library) -> None:
    with Instance(lugre) as run:
        assert debug(run, False, b"logStatusError", b"logEverything") == ERROR
        assert b"logEverything" in run.messages[-1][3]
        assert provoke(run) == ["logStatusError", "logStatusDiscard"]
