"""The process: runs one probe after another, and writes each finding before the next call can end the process."""

import json
import mmap
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from .fmi2_library import MissingError, RawLibrary, RefusedError
from .fmi3_library import RawLibrary3

Report = Callable[..., None]  # ``report(rule, message, variable=None)``

Probe = Callable[[RawLibrary, Report], None]

PROBES: Final[dict[str, Probe]] = {}
SEVERAL: Final[set[str]] = set()  # probes that use more than one instance in a process
CRASHES: Final[dict[str, str]] = {}  # rules for a crash or a hang in a probe, if not the general ones
WITH: Final = {"wrong_guid": " with a guid that is not its own", "without_logger": " with a null pointer as logger"}
"""What is special about the calls of a probe."""
ONLY: Final[dict[str, str]] = {}  # probes of one interface only, "co-simulation" or "model exchange", or of FMI 3.0


def probe(*, several: bool = False, crash: str = "", only: str = "") -> Callable[[Probe], Probe]:
    """Register a probe under the name of its function."""

    def add(function: Probe) -> Probe:
        PROBES[function.__name__] = function
        if several:
            SEVERAL.add(function.__name__)
        if crash:
            CRASHES[function.__name__] = crash
        if only:
            ONLY[function.__name__] = only
        return function

    return add


def main(folder: str, names: list[str]) -> None:
    """Run probes."""
    _limit()
    place = Path(folder)
    job = json.loads((place / "job.json").read_text(encoding="utf-8"))
    report_file = os.open(place / "report", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    with (place / "trace").open("r+b") as file:
        trace = mmap.mmap(file.fileno(), 0)

    def write(**line: Any) -> None:
        os.write(report_file, json.dumps(line).encode() + b"\n")

    def report(rule: str, message: str, variable: str | None = None) -> None:
        write(finding=rule, message=message, variable=variable)

    write(probe="load")
    try:
        library = (RawLibrary3 if job.get("version") == 3 else RawLibrary)(job, trace)
    except OSError as error:
        message = f"the library cannot be loaded ({error}); build it for this platform"
        write(finding="binary-not-loadable", message=message, variable=None)
        write(end="load")
        return
    for name in names:
        write(probe=name)
        try:
            PROBES[name](library, report)
        except RefusedError as error:
            rule = "instantiate-fails" if error.function == "Instantiate" else "call-refused"
            advice = (
                f"accept the {library.token} of the XML" if rule != "call-refused" else "allow the call in this state"
            )
            report(rule, f"{library.named(error.function)} returned {error.status}{error.message}; {advice}")
        except MissingError:
            pass  # the first probe reports this
        except Exception as error:
            write(probe=name, fault=f"{type(error).__name__}: {error}")
            raise
    write(end="all")
    # skip the destructors of the library, whose order the FMU does not control
    sys.stdout.flush()
    os._exit(0)


def _limit() -> None:
    """Prevent core files and endless output."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 26, 1 << 26))
