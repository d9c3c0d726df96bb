"""The C compiler: zig from PyPI, so that no system compiler is needed, or the command in ``CC``."""

import os
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from harness.errors import BuildError, MissingPackageError
from harness.extras import require
from harness.storage.files import ScratchFolder, hash_of


def source_folder() -> Path:
    """Return the folder ``fmu_src``, in a checkout or an installed package."""
    package = Path(__file__).parents[1]
    places = (package.parent / "fmu_src", package.parent / "friction_fmus" / "fmu_src")
    return next(place for place in places if place.is_dir())


def included(unit: str, files: Mapping[str, str]) -> dict[str, str]:
    """Return the text of a file to compile and of the files that it can include."""
    folders = set(re.findall(r'^#include "([^"/]+)/', files[unit], re.M))
    found = (
        {name: text for name, text in files.items() if name.split("/")[0] in folders}
        if folders
        else {name: text for name, text in files.items() if "/" not in name and name.endswith(".h")}
    )
    return {unit: files[unit], **found}


def guid_of(files: Mapping[str, str], *texts: str) -> str:
    """Return a GUID that identifies sources and other texts."""
    digits = hash_of((*texts, *(part for item in sorted(files.items()) for part in item)))
    return "{" + "-".join(digits[a:b] for a, b in ((0, 8), (8, 12), (12, 16), (16, 20), (20, 32))) + "}"


FLAGS = (
    *("-std=c99", "-O2", "-g0", "-fPIC", "-fvisibility=hidden"),
    # no fused multiply-add and no relaxed arithmetic, so that machines differ in their libm only
    *("-ffp-contract=off", "-fno-math-errno"),
    *("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"),
    *("-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX"),
)
LINK_FLAGS = ("-shared", "-s", "-lm")
STRICT = "-Wl,-z,defs"  # what nothing defines is an error; not with sanitizers, which define more
SECTIONS = ("-ffunction-sections", "-fdata-sections")  # so that the linker can remove what nothing calls
INLINING = ("-O2", "-flto") if sys.platform == "linux" else ()  # across files; zig's linkers for others have no -flto
QUIET = ("-w", "-std=gnu11")  # flags for files of other tools, which may use what C99 lacks

_EXPORTS = (
    *("malloc", "free", "fmi2FreeInstance", "fmi2SetupExperiment", "fmi2EnterInitializationMode"),
    *("fmi2ExitInitializationMode", "fmi2Reset", "fmi2DoStep", "fmi2SetRealInputDerivatives", "fmi2FreeFMUstate"),
    *(f"fmi2{verb}{kind}" for verb in ("Get", "Set") for kind in ("Real", "Integer", "Boolean", "FMUstate")),
)
"""What a WebAssembly module exports beside its memory and the functions of ``fmu_src/wasm``."""

_WASM_LINK_FLAGS = (
    *("-mexec-model=reactor", "-Os", "-s"),
    "-Wl,-z,stack-size=1048576",  # the stack lies below all data, so that an overflow is an error
    *(f"-Wl,--export={name}" for name in _EXPORTS),
)
_SMALL = tuple(f"-D{name}=wasm_{name}" for name in ("snprintf", "vsnprintf", "exp2", "log"))
"""Functions of the C library that would make a module much larger, and have substitutes in ``fmu_src/wasm``."""
_CACHE_OF_ZIG = "ZIG_GLOBAL_CACHE_DIR"


def cache_folder() -> Path:
    """Make and return the folder for cached build results; ``FRICTION_FMUS_CACHE`` overrides it."""
    import platformdirs  # imported here, as the build of the wheel has neither this package nor fmpy

    folder = Path(os.environ.get("FRICTION_FMUS_CACHE") or platformdirs.user_cache_dir("friction-fmus"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BuildError(
            f"the folder {folder} for compiled files cannot be made ({error.strerror}): set the environment variable "
            "FRICTION_FMUS_CACHE to a writable folder"
        ) from error
    return folder


def header_folder() -> Path:
    """Return the folder of the FMI headers, which fmpy contains."""
    found = find_spec("fmpy")
    assert found is not None and found.origin is not None
    return Path(found.origin).parent / "c-code"


def compiler(target: str | None = None) -> list[str]:
    """Return the compiler command, without file names."""
    if target is None and os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    command = [str(_zig()), "cc"]
    if target is None and sys.platform == "linux":
        # an old glibc, so that the FMU runs on older systems
        target = f"{platform.machine()}-linux-gnu.2.17"
    return [*command, "-target", target] if target else command


@cache
def _zig() -> Path:
    """Return the program of the package ziglang: `python -m ziglang` starts Python for each file."""
    require("ziglang", "a compilation needs it, or a compiler in CC")
    import ziglang

    return Path(ziglang.__file__).parent / ("zig.exe" if os.name == "nt" else "zig")


def lacking() -> MissingPackageError | None:
    """Return why nothing can be compiled for this machine; None if something can."""
    try:
        compiler()
    except MissingPackageError as error:
        return error
    return None


@cache
def _version(command: tuple[str, ...]) -> str:
    try:
        # zig leaves an empty a.o when asked for its version with -target ...-macos
        with ScratchFolder() as scratch:
            for lacks in (_CACHE_OF_ZIG not in os.environ, False):
                run = subprocess.run(
                    [*command, "--version"], cwd=scratch, capture_output=True, text=True, check=not lacks
                )
                if run.returncode == 0:
                    break
                os.environ[_CACHE_OF_ZIG] = str(cache_folder() / "zig")  # without a home, zig knows no folder
        return run.stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise BuildError(
            f"The C compiler {shlex.join(command)!r} does not run ({error}); install the Python package ziglang or set "
            "CC"
        ) from error


def identity(target: str | None = None) -> str:
    """Return everything that determines the compiled bytes for given sources."""
    command = compiler(target)
    shown = command if target is None and os.environ.get("CC") else ["zig", *command[1:]]  # without its folder
    link = _WASM_LINK_FLAGS if _is_wasm(target) else LINK_FLAGS
    return "\n".join([*shown, _version(tuple(command)), *_flags(target), *link])


def _is_wasm(target: str | None) -> bool:
    return "wasm" in (target or "")


def _flags(target: str | None, *, own: bool = True) -> list[str]:
    """Return the flags for a file of this project, or of another tool."""
    if not _is_wasm(target):
        return [*FLAGS]
    replaced = {"-O2": ("-Os",), "-fPIC": ()}  # a module is downloaded, and never moved in memory
    return [*(flag for given in FLAGS for flag in replaced.get(given, (given,))), *(_SMALL if own else ())]


def compile_library(
    folder: Path, source: str, library: Path, *, headers: bool = True, target: str | None = None
) -> None:
    """Compile a C file to a shared library."""
    include = ["-isystem", str(header_folder())] if headers else []
    command = [*compiler(target), *_flags(target), *include, source, "-o", str(library), *_link_flags(library, target)]
    _run(folder, command, f"{source} does not compile", target)


def compile_object(
    folder: Path,
    source: str,
    output: Path,
    *,
    form: str = "-c",
    warns: bool = True,
    target: str | None = None,
    inlining: Sequence[str] = (),
) -> None:
    """Compile a C file that includes the FMI headers; see `compile_library`."""
    command = [
        *compiler(target),
        *_flags(target, own=warns),
        *SECTIONS,
        *inlining,
        *(() if warns else QUIET),
        "-isystem",  # the headers of FMI 3.0 have function types without prototype
        str(header_folder()),
        *((form, "-P") if form == "-E" else (form,)),
        source,
        "-o",
        str(output),
    ]
    _run(folder, command, f"{source} does not compile", target)


def link_library(
    folder: Path, objects: Sequence[str], library: Path, *, target: str | None = None, inlining: Sequence[str] = ()
) -> None:
    """Link object files to a shared library; see `compile_library`."""
    flags = [*_link_flags(library, target), *object_flags(target, inlining)]
    command = [*compiler(target), *objects, "-o", str(library), *flags]
    _run(folder, command, f"{library.name} cannot be linked; correct the sources of its parts", target)


def object_flags(target: str | None, inlining: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the flags with which the linker removes what nothing calls, and finds what nothing defines."""
    name = target or sys.platform
    if "macos" in name or name == "darwin":
        return ("-Wl,-dead_strip",)
    # under Windows a missing function is an error anyway; a sanitizer defines its own in the program
    strict = "linux" in name and not any(flag.startswith("-fsanitize") for flag in compiler(target))
    alone = (*inlining, "-nostartfiles") if inlining else ()  # without their static variables, see `compiled.py`
    return ("-Wl,--gc-sections", *((STRICT,) if strict else ()), *alone)


def _link_flags(library: Path, target: str | None) -> list[str]:
    if _is_wasm(target):
        return [*_WASM_LINK_FLAGS]
    if "linux" in (target or sys.platform):
        return [*LINK_FLAGS, "-Wl,--build-id=none"]
    if "macos" in (target or "") or sys.platform == "darwin":
        return [*LINK_FLAGS, f"-Wl,-install_name,@rpath/{library.name}"]
    return [*LINK_FLAGS]


def _run(folder: Path, command: Sequence[str], what: str, target: str | None) -> None:
    _version(tuple(compiler(target)))
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        lines = run.stderr.splitlines()
        complaints = [line for line in lines if re.search("error|undefined|multiple definition", line)] or lines
        first = complaints[0] if complaints else "the compiler failed"
        raise BuildError(f"{what}: " + re.sub(r"^(.+?):(\d+)(:\d+)?: (fatal )?error: ", r"\1, line \2: ", first))
