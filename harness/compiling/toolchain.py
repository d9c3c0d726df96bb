"""The C compiler: zig from PyPI, so that a machine without a compiler works, or what ``CC`` names."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
import tempfile
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


def compiler(target: str | None = None) -> list[str]:
    """The command that compiles, without files.

    Parameters
    ----------
    target : str or None
        What zig is to compile for, as ``x86_64-windows-gnu``; by default this machine, by the compiler ``CC`` if
        that is set.
    """
    if target is None and os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    command = [sys.executable, "-m", "ziglang", "cc"]
    if target is None and sys.platform == "linux":
        # an old glibc, so that the FMU runs on other people's machines
        target = f"{platform.machine()}-linux-gnu.2.17"
    return [*command, "-target", target] if target else command


@cache
def _version(command: tuple[str, ...]) -> str:
    try:
        # zig leaves an empty a.o where it is asked for its version with -target ...-macos
        with tempfile.TemporaryDirectory(prefix="friction-fmus-") as scratch:
            run = subprocess.run([*command, "--version"], cwd=scratch, capture_output=True, text=True, check=True)
        return run.stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise BuildError(
            f"The C compiler {shlex.join(command)!r} does not run ({error}); install the package ziglang or set CC"
        ) from error


def identity(target: str | None = None) -> str:
    """All that decides what bytes come out for given sources."""
    command = compiler(target)
    shown = [part for part in command if part != sys.executable]
    return "\n".join([*shown, _version(tuple(command)), *FLAGS, *LINK_FLAGS])


def compile_library(
    folder: Path, source: str, library: Path, *, headers: bool = True, target: str | None = None
) -> None:
    """Compiles a C file to a shared library.

    Parameters
    ----------
    folder : Path
        Holds the sources; the compiler runs there, so that no path enters the binary.
    source : str
        File to compile.
    library : Path
        What to write.
    headers : bool
        Whether it includes the FMI headers.
    target : str or None
        As in `compiler`.

    Raises
    ------
    BuildError
        With the compiler's first complaint.
    """
    include = ["-I", str(header_folder())] if headers else []
    command = [*compiler(target), *FLAGS, *include, source, "-o", str(library), *LINK_FLAGS]
    if "linux" in (target or sys.platform):
        command.append("-Wl,--build-id=none")
    elif "macos" in (target or "") or sys.platform == "darwin":
        command.append(f"-Wl,-install_name,@rpath/{library.name}")
    _version(tuple(compiler(target)))
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        complaints = [line for line in run.stderr.splitlines() if "error" in line] or run.stderr.splitlines()
        raise BuildError(f"{source} does not compile: {complaints[0] if complaints else 'the compiler failed'}")
