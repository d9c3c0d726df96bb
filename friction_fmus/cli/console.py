"""Output of the commands: text on stdout, progress bars on stderr."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from friction_fmus.errors import visible
from harness.notebook import Listing

LITERAL: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False}
"""Options of a console that prints strings as they are."""


class VisibleConsole(Console):
    """A console on which no text commands the terminal."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the pieces of what is printed."""
        for piece in super().render(renderable, options):
            yield piece if piece.control else piece._replace(text=visible(piece.text))


def literal_console(**options: Any) -> Console:
    """Return a console that prints strings literally: ``o[/b].csv`` is not markup, and ``:x:`` is not an emoji.

    Use `styled` or `rich.text.Text` for styled text.
    """
    return VisibleConsole(**LITERAL, **options)


def styled(*parts: str | tuple[str, str]) -> Text:
    """Return text with a style for some parts, such as ``styled(("hunting", "red"), " (servo)")``."""
    return Text.assemble(*parts)


console = literal_console()


def drawn(listing: Listing, *, title: bool = True, padding: tuple[int, ...] = (0, 1)) -> Table:
    """Return a table for the terminal, in which numbers do not wrap."""
    caption = listing.caption if title else None
    table = Table(title=caption, title_justify="left", box=None, pad_edge=False, padding=padding)  # type: ignore[arg-type]
    for place, heading in enumerate(listing.headings):
        number = heading.startswith(" ")
        kept = number or place == 0  # names are copied, and grep finds them
        table.add_column(heading.strip(), justify="right" if number else "left", no_wrap=kept, overflow="fold")
    for cells in listing.cells:
        table.add_row(*cells)
    return table


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
        """Show the progress; what an earlier call has done does not count for the speed."""
        if self._bar.tasks[0].total is None:
            self._bar.reset(self._task, completed=done, total=total)
        self._bar.update(self._task, completed=done, total=total)
