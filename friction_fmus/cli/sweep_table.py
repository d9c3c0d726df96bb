"""The first runs of a sweep as a table."""

import xarray as xr
from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task
from rich.table import Table
from rich.text import Text

from friction_fmus.cli.console import progress_bar


class _Rate(ProgressColumn):
    """Runs per second."""

    def render(self, task: Task) -> Text:
        """Return the rate; empty until it is known."""
        return Text(f"{task.speed:.3g} runs/s" if task.speed else "")


def sweep_progress() -> Progress:
    """Return the progress bar of a sweep."""
    return progress_bar(_Rate(), speed_estimate_period=60)


ROWS = 10  # number of runs in the table

_GAP = 2
_OTHERS = ("wall_time", "error", "warnings")


def show_sweep(console: Console, result: xr.Dataset) -> None:
    """Print the first runs, with all swept parameters and as many results as fit the width of the console."""
    runs = min(result.sizes["run"], ROWS)
    parameters = [str(name) for name in result.coords if name != "run"]
    measures = [str(name) for name in result.data_vars if name not in _OTHERS]
    table = Table(box=None, pad_edge=False, padding=(0, _GAP, 0, 0))
    table.add_column("run", justify="right")
    columns = [[str(number) for number in result["run"].to_numpy()[:runs]]]
    width = console.width - len("run") - _GAP
    shown = 0
    for name in (*parameters, *measures):
        heading = _heading(result, name)
        cells = _cells(result, name, runs, failed=name == measures[0] if measures else False)
        width -= max(map(len, (*heading.splitlines(), *cells))) + _GAP
        if width < -_GAP and shown > len(parameters):
            break
        table.add_column(heading, justify="right", no_wrap=True)
        columns.append(cells)
        shown += 1
    for row in zip(*columns, strict=True):
        table.add_row(*row)
    console.print(table)
    left = {"runs": result.sizes["run"] - runs, "results": len(parameters) + len(measures) - shown}
    if more := ", ".join(f"{number} more {what}" for what, number in left.items() if number):
        console.print(f"... {more}: use -o FILE.csv", soft_wrap=True)


def _heading(result: xr.Dataset, name: str) -> str:
    unit = str(result[name].attrs.get("units", "1"))
    return name if unit == "1" else f"{name}\n[{unit}]"


def _cells(result: xr.Dataset, name: str, runs: int, *, failed: bool) -> list[str]:
    """Return the cells of a column; the first measure marks failed runs."""
    cells = [f"{value:.6g}" if isinstance(value, float) else str(value) for value in result[name].to_numpy()[:runs]]
    if name in result.coords:
        return cells
    errors = result["error"].to_numpy()[:runs]
    return [("failed" if failed else "") if error else cell for error, cell in zip(errors, cells, strict=True)]
