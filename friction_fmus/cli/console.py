"""Output of the commands: text on stdout, progress bars on stderr."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Literal

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from friction_fmus.errors import visible
from harness.compiling.platforms import NATIVE
from harness.notebook import Listing

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn, TaskID

LITERAL: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False}
"""Options of a console that prints strings as they are."""


class VisibleConsole(Console):
    """A console on which no text commands the terminal."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the pieces of what is printed."""
        for piece in super().render(renderable, options):
            yield piece if piece.control else piece._replace(text=visible(piece.text))


def literal_console(**options: Any) -> Console:
    """Return a console that prints strings literally: ``o[/b].csv`` is not markup, and ``:x:`` is not an emoji."""
    # Use `styled` or `rich.text.Text` for styled text.
    return VisibleConsole(**LITERAL, **options)


def styled(*parts: str | tuple[str, str]) -> Text:
    """Return text with a style for some parts, such as ``styled(("hunting", "red"), " (servo)")``."""
    return Text.assemble(*parts)


console = literal_console()


LONGEST_WORD: Final = 24  # characters of a word that is not divided to fit the terminal


def drawn(listing: Listing, *, title: bool = True, padding: tuple[int, ...] = (0, 1)) -> Table:
    """Return a table for the terminal, in which numbers and words do not wrap."""
    caption = listing.caption if title else None
    table = Table(title=caption, title_justify="left", box=None, pad_edge=False)
    table.padding = padding  # type: ignore[assignment]
    cells_of_rows = list(listing.cells)
    for place, heading in enumerate(listing.headings):
        number = heading.startswith(" ")
        texts = [cells[place] for cells in cells_of_rows]
        kept = number or not any(" " in text for text in texts)  # names are copied, and grep finds them
        least = min(max((len(word) for text in texts for word in text.split()), default=0), LONGEST_WORD)
        justify: Literal["right", "left"] = "right" if number else "left"
        table.add_column(heading.strip(), justify=justify, no_wrap=kept, overflow="fold", min_width=least)
    for cells in cells_of_rows:
        table.add_row(*cells)
    return table


def progress_bar(*columns: ProgressColumn, **options: Any) -> Progress:
    """Return a progress bar on stderr that disappears at the end; it is not shown if stderr is not a terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    screen = literal_console(stderr=True)
    first = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    shown = (*first, *columns, TimeRemainingColumn())
    return Progress(*shown, console=screen, transient=True, disable=not screen.is_terminal, **options)


@cache
def _note_on_time(screen: Console) -> None:
    """Say once how long a cross-compilation takes."""
    screen.print("(the first compilation for a platform takes a minute or more, later ones seconds)", soft_wrap=True)


def announce(bar: Progress, task: TaskID, text: str, foreign: str = "other") -> None:
    """Show what happens now: on the bar, or as a line on stderr where that is no terminal, unless it is soon done."""
    bar.update(task, description=text)
    if not bar.console.is_terminal and foreign not in ("native", NATIVE.folder):
        bar.console.print(text, soft_wrap=True)
        if foreign != "other":
            _note_on_time(bar.console)


class RunBar:
    """Progress of a run on a progress bar."""

    def __init__(self, bar: Progress, description: str, stages: Mapping[float, str] | None = None) -> None:
        """Add a task to the bar; stages begin at fractions, and are printed where there is no terminal."""
        self._bar = bar
        self._stages, self._stage = stages or {}, ""
        self._task = bar.add_task(description, total=None)

    def update(self, done: int, total: int) -> None:
        """Show the progress; what an earlier call has done does not count for the speed."""
        stage = [text for begin, text in self._stages.items() if begin * total <= done][-1:]
        if stage and stage[0] != self._stage:
            self._stage = stage[0]
            announce(self._bar, self._task, self._stage)
        if self._bar.tasks[0].total is None:
            self._bar.reset(self._task, completed=done, total=total)
        self._bar.update(self._task, completed=done, total=total)
