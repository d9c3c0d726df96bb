"""Build the parser from the modules of the commands and run one of them."""

import argparse
import importlib
import inspect
import io
import logging
import os
import pkgutil
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from itertools import takewhile
from typing import Any, NoReturn

from friction_fmus.cli import commands
from friction_fmus.errors import FrictionError, did_you_mean, visible
from friction_fmus.version import VERSION
from harness.errors import HarnessError
from harness.extras import extra_of, missing
from harness.storage.files import stamped


class _Parser(argparse.ArgumentParser):
    """A parser whose errors suggest what was meant."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; a misspelt option of a command is an error before its value counts as another argument."""
        for each in takewhile("--".__ne__, args or () if self.get_default("run") else ()):
            if each.startswith("--") and not any(
                o.startswith(each.partition("=")[0]) for o in self._option_string_actions
            ):
                self.error(f"unrecognized arguments: {each}")
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """End the program with a sentence and the status 2."""
        if found := re.fullmatch(r"argument (\S+): invalid choice: '(.*)' \(choose from (.*)\)", message):
            name, given, known = found[1], found[2], re.findall(r"'([^']*)'", found[3])
            hint = did_you_mean(given, known) or f"; use {', '.join(known)}"
            message = f"there is no {name.lower()} {given!r}{hint}"
        elif found := re.match(r"unrecognized arguments: (-\S+)", message):
            message = f"there is no option {found[1]}{did_you_mean(found[1], self._option_string_actions)}"
        _, *command = self.prog.split()
        self.exit(2, f"{self.prog}: {message}\n`friction-fmus help{' '.join(['', *command])}` shows the usage.\n")


def parser(given: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser of all commands; of the options, only those of the command that is given, if one is."""
    top = _Parser(
        prog="friction-fmus",
        description="Friction models and friction compensators as FMI 2.0 and 3.0 FMUs.",
        epilog="Exit status: 0 success; 1 the result needs attention, as the help of a command says; 2 error "
        "(nothing was done); 130 interrupted.",
    )
    top.add_argument("--version", action="version", version=f"friction-fmus {VERSION}")
    top.add_argument("--debug", action="store_true", help="show the traceback of an error")
    added = top.add_subparsers(title="commands", metavar="COMMAND", dest="command")
    names = [found.name for found in pkgutil.iter_modules(commands.__path__)]
    chosen = next((each for each in given if each in (*names, "--version")), None)
    for name in names:
        if chosen not in (None, name):
            added.add_parser(name)  # its name is known to suggestions
            continue
        module = importlib.import_module(f"{commands.__name__}.{name}")
        description = inspect.getdoc(module) or ""
        first = description.partition("\n")[0].rstrip(".")
        command = added.add_parser(name, help=first[:1].lower() + first[1:], description=description)
        command.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        command.set_defaults(run=module.run, parser=command)
        module.add_arguments(command)
    added.add_parser("help", help="show the options of a command: help COMMAND")
    return top


class _Visible(logging.Formatter):
    """Format of log messages, which repeat texts of FMUs."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        return visible(super().format(record))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # more threads only wait for each other
    given = list(sys.argv[1:] if arguments is None else arguments)
    top = parser(given)
    if "_ARGCOMPLETE" in os.environ:  # a shell asks what could follow
        import argcomplete

        argcomplete.autocomplete(top)
    if given[:1] == ["help"] or not given:
        given = [*given[1:2], "--help"]
    options, unknown = top.parse_known_args(given)
    if unknown:
        vars(options).get("parser", top).error(f"unrecognized arguments: {' '.join(unknown)}")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # file names may be invalid UTF-8
    handler = logging.StreamHandler()
    handler.setFormatter(_Visible("%(name)s: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    try:
        stamped()  # libraries read the variable too, but raise errors of their own
        options.stdout = sys.stdout
        with redirect_stdout(sys.stderr) if vars(options).get("json") else nullcontext():
            return options.run(options) or 0
    except (FrictionError, ModuleNotFoundError, OSError) as error:
        if isinstance(error, ModuleNotFoundError) and not isinstance(error, HarnessError):
            if not error.name or extra_of(error.name) is None:
                raise
            error = missing(error.name, f"`friction-fmus {options.command}` needs it")
        if options.debug:
            raise
        text = str(error)
        if isinstance(error, OSError) and error.strerror:
            text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
        print("friction-fmus:", visible(text), file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        print(f"friction-fmus: {str(error) or 'interrupted'}", file=sys.stderr)
        return 130
