"""Arguments shared by several commands. This module must load fast, so it imports no large libraries."""

import argparse
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from friction_fmus.errors import FrictionError
from friction_fmus.identification.data import COLUMNS_EXAMPLE
from harness.engine import ENGINES
from harness.masters import master_names


def listed(words: Sequence[str]) -> str:
    """Return words as a list for a sentence: ``a, b or c``."""
    return f"{', '.join(words[:-1])} or {words[-1]}"


def parse_value(text: str) -> float | bool | str:
    """Return a number, a Boolean, or the text itself, such as the name of a master."""
    text = text.strip()
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return float(text)
    except ValueError:
        return text


def parse_assignment(text: str) -> tuple[str, float | bool | str]:
    """Return name and value of ``NAME=VALUE``: a number, true, false, or a number with a unit."""
    from harness.units import is_quantity

    name, equals, given = text.partition("=")
    value = parse_value(given)
    if not equals or (isinstance(value, str) and not is_quantity(value)):
        raise FrictionError(f"--set {text!r} is not NAME=VALUE; use a number, a number with a unit, true or false")
    return name.strip(), value


def parse_assignments(texts: Sequence[str] | None) -> dict[str, float | bool | str]:
    """Return the start values given by all options ``--set NAME=VALUE``."""
    return dict(parse_assignment(text) for text in texts or ())


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the option for a program that reads the output."""
    parser.add_argument("--json", action="store_true", help="print JSON, and everything else on stderr")


def print_json(options: argparse.Namespace, content: Any) -> None:
    """Print content as JSON, which has no infinity: such numbers become null. All other text goes to stderr."""
    from friction_fmus.listings import plain

    print(json.dumps(plain(content), indent=2), file=options.stdout)


def completed(action: argparse.Action) -> None:
    """Let the shell complete the names of blocks."""

    def names(**_: Any) -> Iterable[str]:
        from friction_fmus.blocks.catalogue import listing

        return listing()

    vars(action)["completer"] = names


def add_block(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the name of a block."""
    completed(parser.add_argument("name", metavar="NAME", help="name of a model, or its .c or .py file"))


def add_set(parser: argparse.ArgumentParser, name: str = "NAME") -> None:
    """Add the option for start values."""
    text = f"start value, also with a unit, such as {name.removesuffix('NAME')}Fc='0.002 kN'; may be repeated"
    parser.add_argument("--set", action="append", metavar=f"{name}=VALUE", help=text)


def add_system(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the system file."""
    parser.add_argument("system", type=Path, metavar="SYSTEM", help="system file: .toml or .ssp")


def add_target(parser: argparse.ArgumentParser, *takes: str, flag: str = "--target") -> None:
    """Add the choice among the targets that take an FMU, a law, or others, and the options of all of them."""
    from friction_fmus.export.targets import DEFAULT, targets

    known = {name: target for each in takes for name, target in targets(each).items()}
    default = DEFAULT.get(takes[0])
    text = "; ".join(["what is written", *(f"{name}: {target.summary}" for name, target in known.items())])
    text += f"; default: {default}" if default else ""
    parser.add_argument(flag, choices=known, default=default, required=default is None, help=text)
    for option in {option.name: option for target in known.values() for option in target.options}.values():
        kind: dict[str, Any] = {"choices": option.choices} if option.choices else {"action": "store_true"}
        kind = {"metavar": option.metavar} if option.metavar else kind
        parser.add_argument(f"--{option.name}", help=option.help, default=argparse.SUPPRESS, **kind)


def target_options(options: argparse.Namespace, takes: str) -> dict[str, Any]:
    """Return the given options of the targets."""
    from friction_fmus.export.targets import targets

    names = {option.name for target in targets(takes).values() for option in target.options}
    return {name: value for name, value in vars(options).items() if name in names}


def add_fmu_target(parser: argparse.ArgumentParser) -> None:
    """Add the platforms and the target of what an FMU is made of."""
    parser.add_argument(
        "--platform",
        nargs="+",
        default=["native"],
        metavar="PLATFORM",
        help="native (default), all, FMI platform names such as win64, or wasm32 for JavaScript",
    )
    version: dict[str, Any] = {"type": "fmi{}".format, "default": argparse.SUPPRESS}
    parser.add_argument("--fmi", dest="target", metavar="{2,3}", help="version of FMI; default: 2", **version)
    add_target(parser, "fmu")


def add_experiment(parser: argparse.ArgumentParser) -> None:
    """Add step, end time, master and engine; the harness validates the names."""
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s]")
    parser.add_argument("--stop", type=float, metavar="T", help="end time [s]")
    parser.add_argument("--master", metavar="NAME", help=f"master algorithm: {listed(master_names())}")
    parser.add_argument(
        "--engine",
        default="auto",
        metavar="NAME",
        help=f"loop over the steps: {listed(ENGINES)} for this system; default: auto",
    )


def add_allow_inaccurate(parser: argparse.ArgumentParser) -> None:
    """Add the option that ignores results reported as wrong."""
    text = "exit with status 0 instead of 1 if a result is reported as wrong"
    parser.add_argument("--allow-inaccurate", action="store_true", help=text)


def add_workers(parser: argparse._ActionsContainer) -> None:
    """Add the option for the number of worker processes."""
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes; default: number of processors")


def add_scheduler(parser: argparse._ActionsContainer) -> None:
    """Add the option for the address of a dask cluster."""
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this dask cluster")


def add_column_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what the columns of a data file are."""
    parser.add_argument(
        "--columns", default="", metavar="TEXT", help=f'columns by number or heading, such as "{COLUMNS_EXAMPLE}"'
    )
    parser.add_argument(
        "--gain",
        default="",
        metavar="GAIN",
        help="factor of the drive signal, such as '0.5 N.m/A', or '6 N.m' for 100 %%",
    )
