"""Laws in files, found by folder, inside or outside the package."""

import hashlib
import importlib.util
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

from friction_fmus.blocks.law_summaries import law_paths
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.law import Law
from harness.storage.files import LARGEST_TEXT, reason, require_regular


def discover_laws(path: Path | str) -> list[Law]:
    """Load the laws of a folder, or of one file."""
    path = Path(path)
    if not path.exists():
        raise FrictionError(f"There is no law file or folder {path}; give an existing path")
    files = law_paths(path) if path.is_dir() else [path]
    found: dict[str, Law] = {}
    for file in files:
        for value in vars(_load(file)).values():
            # an imported law belongs to the file that defines it
            if not isinstance(value, Law) or value.path.resolve() != file.resolve():
                continue
            other = found.setdefault(value.name, value)
            if other is not value:
                raise FrictionError(f"Two laws are called {value.name}: in {other.path.name} and in {file.name}")
    return list(found.values())


def _load(file: Path) -> ModuleType:
    file = file.resolve()
    try:
        require_regular(file, LARGEST_TEXT)
        content = file.read_bytes()
    except OSError as error:
        raise FrictionError(f"{file.name} cannot be loaded: {reason(error)}; give a Python file") from error
    return _module(file, hashlib.sha256(content).hexdigest())


@cache
def _module(file: Path, digest: str) -> ModuleType:
    """Return the module of a law file with this content, which is executed once."""
    name = f"law_file_{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise FrictionError(f"{file.name} is not a Python file; a law file ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look up their module
    bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # write no files to a user's folder
    try:
        spec.loader.exec_module(module)
    except FrictionError:
        del sys.modules[name]
        raise
    except Exception as error:
        del sys.modules[name]
        raise FrictionError(f"{file.name} cannot be loaded: {type(error).__name__}: {error}") from error
    finally:
        sys.dont_write_bytecode = bytecode
    return module
