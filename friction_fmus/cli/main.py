"""Build the parser from the modules of the commands and run one of them."""

from __future__ import annotations

import argparse
import importlib
import inspect
import io
import logging
import pkgutil
import sys
from collections.abc import Sequence

from friction_fmus.cli import commands
from friction_fmus.errors import FrictionError, visible
from friction_fmus.version import VERSION
from harness.errors import HarnessError
from harness.extras import extra_of, missing
from harness.storage.files import stamped


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands and options."""
    top = argparse.ArgumentParser(
        prog="friction-fmus", description="Friction models and friction compensators as FMI 2.0 and 3.0 FMUs."
    )
    top.add_argument("--version", action="version", version=f"friction-fmus {VERSION}")
    top.add_argument("--debug", action="store_true", help="show the traceback of an error")
    added = top.add_subparsers(title="commands", metavar="COMMAND", dest="command", required=True)
    for found in pkgutil.iter_modules(commands.__path__):
        module = importlib.import_module(f"{commands.__name__}.{found.name}")
        description = inspect.getdoc(module) or ""
        first = description.partition("\n")[0].rstrip(".")
        command = added.add_parser(found.name, help=first[:1].lower() + first[1:], description=description)
        command.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        command.set_defaults(run=module.run)
        module.add_arguments(command)
    return top


class _Visible(logging.Formatter):
    """Format of log messages, which repeat texts of FMUs."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        return visible(super().format(record))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command."""
    options = parser().parse_args(arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # file names may be invalid UTF-8
    handler = logging.StreamHandler()
    handler.setFormatter(_Visible("%(name)s: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    try:
        stamped()  # libraries read the variable too, but raise errors of their own
        return options.run(options) or 0
    except (FrictionError, HarnessError, ModuleNotFoundError, OSError) as error:
        if isinstance(error, ModuleNotFoundError) and not isinstance(error, HarnessError):
            if not error.name or extra_of(error.name) is None:
                raise
            error = missing(error.name, f"`friction-fmus {options.command}` needs it")
        if options.debug:
            raise
        text = str(error)
        if isinstance(error, OSError) and error.strerror:
            text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
        print("friction-fmus:", "\n".join(map(visible, text.split("\n"))), file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        print(f"friction-fmus: {str(error) or 'interrupted'}", file=sys.stderr)
        return 130
