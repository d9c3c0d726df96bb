"""Check FMUs, and SSPs with their FMUs, of any origin for faults.

The exit status is 1 if there are errors or warnings, and 2 if a file cannot be checked.
"""

import argparse
import json
from pathlib import Path

from friction_fmus.errors import FrictionError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="FMUs and SSPs to check")
    parser.add_argument("--format", choices=("text", "json", "sarif"), default="text", help="format of the report")
    parser.add_argument("--json", dest="format", action="store_const", const="json", help="the same as --format json")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="report file; default: the terminal")
    parser.add_argument("--static", action="store_true", help="do not run the binary")
    parser.add_argument("--ignore", action="append", default=[], metavar="RULE", help="ignore a rule; may be repeated")
    parser.add_argument("--timeout", type=float, default=30.0, metavar="S", help="time limit for each probe [s]")
    parser.add_argument("--rules", action="store_true", help="list the rules and exit")


def run(options: argparse.Namespace) -> int:
    """Check the files and write the report."""
    from friction_fmus.check import check
    from friction_fmus.check.findings import RULES, as_json, as_sarif, as_text, failed, rules_table
    from friction_fmus.cli.console import console, literal_console, progress_bar
    from harness.storage.files import atomic_path

    if options.rules and options.format == "json":
        fields = ("id", "severity", "section", "summary")
        print(json.dumps([{field: getattr(rule, field) for field in fields} for rule in RULES.values()], indent=2))
        return 0
    if options.rules:
        console.print(rules_table())
        return 0
    if not options.files:
        raise FrictionError("give the paths of FMUs to check, or --rules to list the rules")
    results = {}
    with progress_bar() as bar:
        for path in bar.track(options.files, description="checking"):
            results[path] = check(path, static=options.static, ignore=options.ignore, time_limit=options.timeout)
    if options.format == "text" and options.output is None:
        as_text(results, console)
    elif options.format == "text":
        with atomic_path(options.output) as temporary, temporary.open("w", encoding="utf-8") as file:
            as_text(results, literal_console(file=file, width=120))
    else:
        text = (as_json if options.format == "json" else as_sarif)(results) + "\n"
        if options.output is None:
            console.print(text, soft_wrap=True, end="")
        else:
            with atomic_path(options.output) as temporary:
                temporary.write_text(text, encoding="utf-8")
    return 1 if failed(results) else 0
