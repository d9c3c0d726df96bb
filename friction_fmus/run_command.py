"""The command ``run``: a system file, run to a result file."""

from __future__ import annotations

import argparse
from pathlib import Path

from friction_fmus.errors import FrictionError
from friction_fmus.terminal import RunBar, console, parse_assignment, progress_bar
from harness import HarnessError, Interrupted, Result, System, masters, plot, save_result
from harness.coupling import inaccurate
from harness.results import FORMATS

_PICTURES = (".png", ".svg", ".pdf")


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("system", type=Path, metavar="SYSTEM", help="system file: .toml or .ssp")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help=f"result: {_listed(tuple(FORMATS))}"
    )
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s]")
    parser.add_argument("--stop", type=float, metavar="T", help="end time [s]")
    parser.add_argument("--master", metavar="NAME", help=_listed(tuple(masters())))
    parser.add_argument("--set", action="append", metavar="PART.NAME=VALUE", help="start value; may be repeated")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="parameter set: .ssv")
    parser.add_argument("--record", action="append", metavar="PATTERN", help="what is recorded; may be repeated")
    parser.add_argument("--resume", type=Path, metavar="FILE", help="go on from the state in this file")
    parser.add_argument("--checkpoint", type=Path, metavar="FILE", help="write the state at the end")
    parser.add_argument("--pace", type=float, metavar="FACTOR", help="simulated seconds a second, 1 is real time")
    parser.add_argument("--plot", type=Path, metavar="FILE", help=f"also draw the result: {_listed(_PICTURES)}")
    add_allow_inaccurate(parser)


def add_allow_inaccurate(parser: argparse.ArgumentParser) -> None:
    """The option of the commands that run a system."""
    text = "end with status 0 even if a result is reported as wrong, otherwise with 1"
    parser.add_argument("--allow-inaccurate", action="store_true", help=text)


def run_system(options: argparse.Namespace) -> int:
    """A system file, run to a result file; of a run that fails, what was recorded until then.

    The status is 1 if the result is reported as wrong, unless that is allowed.
    """
    if options.output.suffix.lower() not in FORMATS:
        raise FrictionError(f"{options.output} has no known format; end the name in {_listed(tuple(FORMATS))}")
    if options.plot and options.plot.suffix not in _PICTURES:
        raise FrictionError(f"{options.plot} has no known picture format; end the name in {_listed(_PICTURES)}")
    output, picture = options.output.absolute(), options.plot and options.plot.absolute()
    with open_system(options.system) as opened, progress_bar() as bar:
        system = opened.with_parameters(options.parameters) if options.parameters else opened
        system = system.with_start(dict(parse_assignment(text) for text in options.set or ()))
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
            )
        except (HarnessError, Interrupted) as error:
            if error.result is None:
                raise
            message = str(error) or "interrupted"
            kind = FrictionError if isinstance(error, HarnessError) else Interrupted
            raise kind(f"{message}; {_keep(error.result, message, output, options.output)}") from error
    _save(result, output)
    if picture:
        picture.parent.mkdir(parents=True, exist_ok=True)
        plot(result, picture)
    console.print(f"{options.output}: {_size(result)}", soft_wrap=True)
    return int(inaccurate(result.attrs) and not options.allow_inaccurate)


def open_system(path: Path) -> System:
    """The system in a .toml or .ssp file.

    Raises
    ------
    HarnessError
        If there is none.
    """
    from friction_fmus.package import fmu

    return System.from_ssp(path) if path.suffix.lower() == ".ssp" else System.from_toml(path, resolve=fmu)


def _keep(result: Result, message: str, path: Path, shown: Path) -> str:
    """Write what a failed run recorded; end of a sentence that says where it is, by the path that the user gave."""
    try:
        _save(result.assign_attrs(incomplete=message), path)
    except (HarnessError, OSError) as error:
        return f"what was recorded until then is lost: {error}"
    return f"what was recorded until then is in {shown}, {_size(result)}"


def _save(result: Result, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    save_result(result, path)


def _size(result: Result) -> str:
    return f"{result.sizes['time']} rows of {len(result.data_vars)} variables"


def _listed(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"
