"""The C compiler: zig from PyPI, so that a machine without a compiler works, or what ``CC`` names."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path

from harness.errors import BuildError

FLAGS = (
    *("-std=c99", "-O2", "-g0", "-fPIC", "-fvisibility=hidden"),
    # no fused multiply-add, no relaxed arithmetic: what differs between machines is their libm
    *("-ffp-contract=off", "-fno-math-errno"),
    *("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"),
    "-DFMI2_OVERRIDE_FUNCTION_PREFIX",
)
LINK_FLAGS = ("-shared", "-s", "-lm")


def cache_folder() -> Path:
    """Where build results are kept; ``FRICTION_FMUS_CACHE`` overrides it."""
    import platformdirs  # not at the top: a build of the wheel has neither this nor fmpy

    return Path(os.environ.get("FRICTION_FMUS_CACHE") or platformdirs.user_cache_dir("friction-fmus"))


def header_folder() -> Path:
    """The FMI headers, which fmpy carries."""
    import fmpy

    return Path(fmpy.__file__).parent / "c-code"


def compiler() -> list[str]:
    """The command that compiles, without files."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    command = [sys.executable, "-m", "ziglang", "cc"]
    if sys.platform == "linux":
        # an old glibc, so that the FMU runs on other people's machines
        command += ["-target", f"{platform.machine()}-linux-gnu.2.17"]
    return command


@cache
def _version(command: tuple[str, ...]) -> str:
    try:
        return subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise BuildError(
            f"The C compiler {shlex.join(command)!r} does not run ({error}); install the package ziglang or set CC"
        ) from error


def identity() -> str:
    """All that decides what bytes come out for given sources."""
    command = compiler()
    shown = [part for part in command if part != sys.executable]
    return "\n".join([*shown, _version(tuple(command)), *FLAGS, *LINK_FLAGS])


def compile_library(folder: Path, source: str, target: Path, *, headers: bool = True) -> None:
    """Compiles a C file to a shared library.

    Parameters
    ----------
    folder : Path
        Holds the sources; the compiler runs there, so that no path enters the binary.
    source : str
        File to compile.
    target : Path
        Library to write.
    headers : bool
        Whether it includes the FMI headers.

    Raises
    ------
    BuildError
        With the compiler's first complaint.
    """
    include = ["-I", str(header_folder())] if headers else []
    command = [*compiler(), *FLAGS, *include, source, "-o", str(target), *LINK_FLAGS]
    if sys.platform == "linux":
        command.append("-Wl,--build-id=none")
    _version(tuple(compiler()))
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        complaints = [line for line in run.stderr.splitlines() if "error" in line] or run.stderr.splitlines()
        raise BuildError(f"{source} does not compile: {complaints[0] if complaints else 'the compiler failed'}")
