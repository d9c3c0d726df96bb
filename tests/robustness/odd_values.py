"""Run the command line on many small files in one process, and report what was no run and no sentence.

A process of its own: its memory is limited, and a case that takes too long ends with an alarm.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

LONGEST = 30  # s, of a busy machine
MEMORY = 8 << 30  # bytes of addresses, of which numpy and its threads take 3 GB


class TooLongError(BaseException):
    """A case that does not end."""


def _alarm(signum: int, frame: object) -> None:
    raise TooLongError


def outcome(arguments: list[str]) -> tuple[int | None, str]:
    """Status of a command, None for a traceback, and what it printed on stderr."""
    from friction_fmus.__main__ import main

    said = io.StringIO()
    signal.alarm(LONGEST)
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            status: int | None = main(arguments)
    except TooLongError:
        return None, "it does not end"
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else 2, said.getvalue()
    except BaseException:
        return None, "".join(traceback.format_exc().splitlines(keepends=True)[-4:])
    finally:
        signal.alarm(0)
    return status, said.getvalue()


def main_of(folder: Path) -> None:
    """Each line of cases.jsonl is [label, file name, content, arguments]; bad.jsonl gets what went wrong."""
    signal.signal(signal.SIGALRM, _alarm)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    counts = {"runs": 0, "sentences": 0, "bad": 0}
    with (folder / "cases.jsonl").open() as cases, (folder / "bad.jsonl").open("w") as bad:
        for case in cases:
            label, name, content, arguments = json.loads(case)
            (folder / name).write_text(content, encoding="utf-8", errors="surrogateescape")
            (folder / "current").write_text(label)
            status, said = outcome(arguments)
            sentence = status == 2 and said.startswith("friction-fmus: ") and said.count("\n") == 1 and len(said) < 9999
            counts["runs" if status in (0, 1) else "sentences" if sentence else "bad"] += 1
            if status not in (0, 1) and not sentence:
                bad.write(json.dumps([label, status, said[-1500:]]) + "\n")
                bad.flush()
    (folder / "counts.json").write_text(json.dumps(counts))


if __name__ == "__main__":
    os.chdir(sys.argv[1])
    tempfile.tempdir = sys.argv[1]
    main_of(Path(sys.argv[1]))


def described(folder: Path) -> dict[str, Any]:
    """What a finished process has counted."""
    counts: dict[str, Any] = json.loads((folder / "counts.json").read_text())
    return counts
