"""Run a system of FMUs.

Without -o, the final, smallest and largest value and the rms value of each variable are printed. If the run fails, the
result recorded up to that time is written. The exit status is 1 if the result is reported as wrong, unless
--allow-inaccurate is given. With --accuracy the run is repeated with other steps to estimate the error of each
variable; with --require the exit status is also 1 if one of them is less accurate.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import harness
from friction_fmus.cli.arguments import (
    add_allow_inaccurate,
    add_experiment,
    add_json,
    add_set,
    add_system,
    listed,
    parse_assignments,
    print_json,
)
from friction_fmus.errors import FrictionError
from harness.errors import HarnessError, Interrupted
from harness.notebook import Listing, counted
from harness.results import FORMATS
from harness.storage.files import make_folder

_PICTURES = (".png", ".svg", ".pdf")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_system(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"result file: {listed(tuple(FORMATS))}")
    add_json(parser)
    add_experiment(parser)
    add_set(parser, "PART.NAME")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="parameter set (.ssv)")
    parser.add_argument("--record", action="append", metavar="PATTERN", help="variables to record; may be repeated")
    parser.add_argument("--resume", type=Path, metavar="FILE", help="resume from the state in this file")
    parser.add_argument("--checkpoint", type=Path, metavar="FILE", help="write the state at the end to this file")
    parser.add_argument("--pace", type=float, metavar="FACTOR", help="speed relative to real time (1: real time)")
    parser.add_argument("--events", action="store_true", help="record values before and after events, in two rows")
    parser.add_argument("--plot", type=Path, metavar="FILE", help=f"plot the result: {listed(_PICTURES)}")
    parser.add_argument("--accuracy", action="store_true", help="estimate the error of each variable")
    parser.add_argument(
        "--require", type=float, metavar="ERROR", help="required accuracy relative to the range, such as 1e-3"
    )
    add_allow_inaccurate(parser)


def run(options: argparse.Namespace) -> int:
    """Run the system and write the result."""
    from friction_fmus.cli.console import RunBar, console, drawn, progress_bar
    from friction_fmus.cli.inputs import open_system
    from harness.engine.defect import inaccurate

    if options.output and options.output.suffix.lower() not in FORMATS:
        raise FrictionError(f"the format of {options.output} is unknown; use {listed(tuple(FORMATS))}")
    if options.plot and options.plot.suffix not in _PICTURES:
        raise FrictionError(f"the picture format of {options.plot} is unknown; use {listed(_PICTURES)}")
    output, picture = (path and path.absolute() for path in (options.output, options.plot))
    with open_system(options.system) as opened, progress_bar() as bar:
        system = opened.with_parameters(options.parameters) if options.parameters else opened
        system = system.with_start(parse_assignments(options.set))
        try:
            result = system.run(
                step=options.step,
                stop=options.stop,
                master=options.master,
                record=options.record,
                progress=RunBar(bar, system.name),
                resume=options.resume,
                checkpoint=options.checkpoint,
                pace=options.pace,
                events=options.events,
                engine=options.engine,
                accuracy=options.accuracy if options.require is None else options.require,
            )
        except (HarnessError, Interrupted) as error:
            if error.result is None or output is None:
                raise
            message = str(error) or "interrupted"
            kind = FrictionError if isinstance(error, HarnessError) else Interrupted
            raise kind(f"{message}; {_keep(error.result, message, output, options.output)}") from error
    if output:
        done = "replaced" if output.exists() else "wrote"
        _save(result, output)
        console.print(f"{done} {options.output}: {_size(result)}", soft_wrap=True)
    else:
        console.print(_size(result))
    if picture:
        done = "replaced" if picture.exists() else "wrote"
        make_folder(picture.parent)
        harness.plot(result, picture)
        console.print(f"{done} {options.plot}", soft_wrap=True)
    values = _values(result)
    if options.json:
        print_json(options, values.records)
    elif not output:
        console.print(drawn(values, title=False, padding=(0, 2, 0, 0)))
    missed = False
    if "accuracy" in result.attrs:
        from friction_fmus.cli.result_tables import show_accuracy

        reached = show_accuracy(result)
        missed = options.require is not None and not reached
    return int((inaccurate(result.attrs) or missed) and not options.allow_inaccurate)


def _keep(result: harness.Result, message: str, path: Path, shown: Path) -> str:
    """Write the incomplete result of a failed run, and return where it is, as part of a sentence."""
    try:
        _save(result.assign_attrs(incomplete=message), path)
    except (HarnessError, OSError) as error:
        return f"the incomplete result is lost: {error}"
    return f"the incomplete result is in {shown}, {_size(result)}"


def _values(result: harness.Result) -> Listing:
    """Return what a run amounts to: numbers for each variable, and its error if that is known."""
    from harness.sweeps.measures import KINDS

    kinds = {kind: KINDS[kind] for kind in ("final", "min", "max", "rms")}
    bounds = {variable.attrs.get("ancillary_variables") for variable in result.data_vars.values()}
    rows = []
    for name in [name for name in result.data_vars if name not in bounds]:
        values = result[name].to_numpy().astype(float)
        rows.append((str(name), result[name].attrs.get("units", "1"), *(float(of(values)) for of in kinds.values())))
    return Listing("", ("variable", "unit", *(f" {kind}" for kind in kinds)), rows)


def _save(result: harness.Result, path: Path) -> None:
    make_folder(path.parent)
    harness.save_result(result, path)


def _size(result: harness.Result) -> str:
    bounds = sum("ancillary_variables" in variable.attrs for variable in result.data_vars.values())
    t = result["time"].to_numpy()
    variables = counted(len(result.data_vars) - bounds, "variable")
    return f"{variables}, {counted(len(t), 'time point')} ({t[0]:g} to {t[-1]:g} s)"
