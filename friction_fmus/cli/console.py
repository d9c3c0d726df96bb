"""Output of the commands: text on stdout, progress bars on stderr."""

from __future__ import annotations

from typing import Any

from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from friction_fmus.fmi.rotary import in_rotary_words

LITERAL: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False}
"""Options of a console that prints strings as they are."""


def literal_console(**options: Any) -> Console:
    """Return a console that prints strings literally: ``o[/b].csv`` is not markup, and ``:x:`` is not an emoji.

    Use `styled` or `rich.text.Text` for styled text.
    """
    return Console(**LITERAL, **options)


def styled(*parts: str | tuple[str, str]) -> Text:
    """Return text with a style for some parts, such as ``styled(("hunting", "red"), " (servo)")``."""
    return Text.assemble(*parts)


console = literal_console()


class RotaryConsole(Console):
    """Console that prints texts and headings about a linear axis with the words and units of a rotary one."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print strings, styled texts and tables."""
        super().print(*map(_in_rotary_words, objects), **options)


def console_for(rotary: bool) -> Console:
    """Return the console for texts about an axis."""
    return RotaryConsole(**LITERAL) if rotary else console


def _in_rotary_words(shown: RenderableType) -> RenderableType:
    if isinstance(shown, str):
        return in_rotary_words(shown)
    if isinstance(shown, Text):
        return Text.assemble(*((in_rotary_words(part.plain), part.style) for part in _runs(shown)))
    if isinstance(shown, Table):
        shown.title = None if shown.title is None else _in_rotary_words(shown.title)  # type: ignore[assignment]
        for column in shown.columns:
            column.header = _in_rotary_words(column.header)
    return shown


def _runs(text: Text) -> list[Text]:
    """Return the parts of a text with one style each."""
    ends = sorted({0, len(text), *(end for span in text.spans for end in (span.start, span.end))})
    parts = text.divide(ends[1:-1])
    for part in parts:
        part.style = next((span.style for span in part.spans), "")
    return list(parts)


def progress_bar(*columns: ProgressColumn, **options: Any) -> Progress:
    """Return a progress bar on stderr that disappears at the end; it is not shown if stderr is not a terminal."""
    screen = literal_console(stderr=True)
    first = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    shown = (*first, *columns, TimeRemainingColumn())
    return Progress(*shown, console=screen, transient=True, disable=not screen.is_terminal, **options)


class RunBar:
    """Progress of a run on a progress bar."""

    def __init__(self, bar: Progress, description: str) -> None:
        """Add a task to the bar."""
        self._bar = bar
        self._task = bar.add_task(description, total=None)

    def update(self, done: int, total: int) -> None:
        """Show the progress; called by the harness."""
        self._bar.update(self._task, completed=done, total=total)
