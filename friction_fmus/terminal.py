"""What the commands share: text on stdout, a progress bar on stderr, options of the form NAME=VALUE."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from friction_fmus.errors import FrictionError


def literal_console(**options: Any) -> Console:
    """Return a console that prints text as it is: a path such as ``o[/b].csv`` is no markup, and ``:x:`` no emoji.

    Styled text is made with `styled` or as `rich.text.Text`.

    Parameters
    ----------
    **options
        Of `rich.console.Console`.
    """
    return Console(markup=False, emoji=False, highlight=False, **options)


def styled(*pieces: str | tuple[str, str]) -> Text:
    """Return text of which some pieces have a style: ``styled(("weak", "yellow"), " Fs")``."""
    return Text.assemble(*pieces)


console = literal_console()


def progress_bar() -> Progress:
    """A bar on stderr that disappears when done; nothing where the output is not a terminal."""
    screen = literal_console(stderr=True)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal)


class RunBar:
    """A run's progress on such a bar."""

    def __init__(self, bar: Progress, description: str) -> None:
        """Add it to the bar."""
        self._bar = bar
        self._task = bar.add_task(description, total=None)

    def update(self, done: int, total: int) -> None:
        """Called by the harness."""
        self._bar.update(self._task, completed=done, total=total)


def parse_assignment(text: str) -> tuple[str, float | bool]:
    """``NAME=VALUE`` -> name and number or truth value.

    Raises
    ------
    FrictionError
        If it is neither.
    """
    name, equals, value = text.partition("=")
    if equals and value.strip().lower() in ("true", "false"):
        return name.strip(), value.strip().lower() == "true"
    try:
        number = float(value)
    except ValueError:
        equals = ""
    if not equals:
        raise FrictionError(f"--set {text!r} is not NAME=VALUE with a number, true or false as VALUE")
    return name.strip(), number
