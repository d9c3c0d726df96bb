"""Results of runs and sweeps as tables for the terminal."""

import math

import xarray as xr
from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task
from rich.table import Table
from rich.text import Text

from friction_fmus.cli.console import console, progress_bar, styled
from harness import Result
from harness.accuracy.assess import MARGIN
from harness.accuracy.measure_bounds import OF_LOOPS
from harness.masters import find_master


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


_STYLES = {"within tolerance": "green", "sensitive": "yellow", "step too long": "yellow", "invalid": "bold red"}
_STYLES |= dict.fromkeys(("not certain", "not converged"), "red")


def show_accuracy(result: Result) -> bool:
    """Print the error of each variable, and what to do."""
    table = Table(box=None, pad_edge=False)
    for heading in ("variable", "error bound", "of the range", "events within", "order", "verdict"):
        table.add_column(heading)
    for name, variable in result.data_vars.items():
        attributes = variable.attrs
        if "verdict" not in attributes:
            continue
        bound = float(result[attributes["ancillary_variables"]].max())
        order, late = attributes["observed_order"], attributes.get("event_error")
        table.add_row(
            str(name),
            f"{bound:.2g} {attributes.get('units', '')}".rstrip(),
            f"{attributes['relative_error']:.2g}",
            f"{late:.2g} s" if late is not None else "",
            f"{order:.1f}" if math.isfinite(order) else "",
            styled((attributes["verdict"], _STYLES[attributes["verdict"]])),
        )
    console.print(table)
    for name, variable in result.data_vars.items():
        if "period" in variable.attrs:
            console.print(
                "{}: period {:.4g} s ± {:.1g} s, amplitude {:.4g} ± {:.1g} {}".format(
                    name,
                    *(variable.attrs[key] for key in ("period", "period_error", "amplitude", "amplitude_error")),
                    variable.attrs.get("units", ""),
                ),
                soft_wrap=True,
            )
    return _conclude(result)


def _conclude(result: Result) -> bool:
    """Print the conclusion in a sentence."""
    attributes = result.attrs
    verdict, required = attributes["accuracy"], attributes["required_accuracy"]
    for name, variable in result.data_vars.items():
        if "energy" in variable.attrs:
            net, error = variable.attrs["energy"], variable.attrs["energy_error"]
            console.print(f"work done by {name}: {net:.4g} J ± {error:.1g} J", soft_wrap=True)
    if "largest_coupling_error" in attributes:
        console.print(f"largest coupling error: {attributes['largest_coupling_error']}", soft_wrap=True)
    error, source = attributes["tolerance_error"], attributes["tolerance_source"]
    console.print(f"{source} limits the accuracy to about {error:.1g} of the range", soft_wrap=True)
    step = attributes.get("suggested_step")
    text = {
        "within tolerance": f"all variables are accurate to {required:g} of their ranges",
        "sensitive": "the motion depends on the smallest errors: only its periods and amplitudes are accurate",
        "step too long": f"the required accuracy of {required:g} is not reached",
        "not certain": "the master newton gives another result: a motion is too fast for this master and step; "
        "use --master newton",
        "not converged": "the runs with other steps do not converge: use a much shorter step",
        "invalid": "the result is wrong",
    }[verdict]
    if verdict == "step too long" and step is None:
        text += f"; {_without_step(error, required, source)}"
    if step is not None:
        other = "" if find_master(attributes["master"]).implicit else "--master newton or "
        text += f"; use {other}--step {step:.6g}"
    if "suggested_factor" in attributes:
        text += f", with {attributes['suggested_factor']} times the values of every and delay"
    tolerances = [name for name in ("coupling_tolerance", "step_tolerance") if f"suggested_{name}" in attributes]
    settings = [f"{name} = {attributes[f'suggested_{name}']:.2g}" for name in tolerances]
    if settings:
        text += f" and {' and '.join(settings)} in [experiment]"
    console.print(text, soft_wrap=True)
    return bool(verdict == "within tolerance")


def _without_step(error: float, required: float, source: str) -> str:
    """Return what to do where no step is suggested."""
    if error < MARGIN * required:
        return "no practical step reaches it"
    if source == "loop_tolerance":
        return f"set loop_tolerance = {0.5 * MARGIN * required / OF_LOOPS:.1g} in [experiment]"
    return "require less" if source == "rounding" else f"lower the {source}"
