"""Steps of a study in parallel; the result of each is cached, so that an interrupted study can be resumed."""

import gc
import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from cattrs import Converter

import harness
from friction_fmus.axis.servo_loop import quiet_runs
from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.export.identified_axis import IdentifiedAxis, axis_from
from friction_fmus.listings import plain
from friction_fmus.version import VERSION
from harness.storage.files import keep, kept, make_folder
from harness.workers import worker_pool

CACHE: Final = ".study"  # subfolder of the results with the cached steps

_CONVERTER: Final = Converter(detailed_validation=False)
_CONVERTER.register_structure_hook(IdentifiedAxis, lambda content, _: axis_from(content))  # its types are from above

rebuild: Final = _CONVERTER.structure
"""``rebuild(content, kind)`` makes a dataclass from what `plain` and JSON made of one."""


@dataclass(frozen=True)
class Step:
    """Step of a study: call of a module-level function that returns a dataclass or a text."""

    name: str  # name, part of the file name
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    """Arguments: numbers, strings, arrays, paths, and mappings, sequences and dataclasses of them. For a path, the
    content of the file enters the key."""
    kind: type  # type of the result

    @property
    def key(self) -> str:
        """Hash of everything that the result depends on."""
        digest = hashlib.sha256(_program().encode())
        _feed(digest, (self.function.__module__, self.function.__qualname__, self.arguments))
        return digest.hexdigest()[:20]


class StepCache:
    """Cache of the results of steps, as JSON files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        make_folder(folder)
        self.reused = 0  # number of results read from the cache

    def get(self, step: Step) -> Any:
        """Return the cached result of a step; None if there is none."""
        try:
            result: Any = rebuild(json.loads(kept(self._path(step)) or b""), step.kind)
        except (ValueError, TypeError, KeyError):
            return None  # missing, damaged, or not written by this program: the step is repeated
        self.reused += 1
        return result

    def put(self, step: Step, result: Any) -> None:
        """Write the result of a step; a file is either complete or does not exist."""
        keep(self._path(step), json.dumps(plain(result)).encode())

    def _path(self, step: Step) -> Path:
        return self.folder / f"{step.name}-{step.key}.json"


def run_steps(
    steps: Sequence[Step], store: StepCache, executor: Executor | None, done: Callable[[Step], None] = lambda step: None
) -> list[Any]:
    """Run independent steps that are not in the cache."""
    results: dict[int, Any] = {}
    waiting: dict[Future[Any], int] = {}
    for place, step in enumerate(steps):
        if (known := store.get(step)) is not None:
            results[place] = known
            done(step)
        elif executor is not None:
            waiting[executor.submit(_quietly, step.function, step.arguments)] = place
        else:
            results[place] = _quietly(step.function, step.arguments)
            store.put(step, results[place])
            done(step)
    for future in as_completed(waiting):
        place = waiting[future]
        results[place] = future.result()
        store.put(steps[place], results[place])
        done(steps[place])
    return [results[place] for place in range(len(steps))]


@contextmanager
def workers(count: int) -> Iterator[Executor | None]:
    """Provide a pool of processes that have imported this package; None for one worker."""
    if count < 2:
        yield None
        return
    with worker_pool(count) as pool:
        for _ in range(count):
            pool.submit(_ready)
        yield pool


def clear_cache(out: Path) -> None:
    """Remove the cached steps of a study."""
    shutil.rmtree(out / CACHE, ignore_errors=True)


def _quietly(function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """Run a step without log messages."""
    with quiet_runs():
        return function(*arguments)


def _ready() -> None:
    """Import what the steps need; without its objects, the garbage collector takes a twentieth of the time less."""
    for module in ("comparison", "model_ranking"):
        import_module(f"friction_fmus.study.{module}")
    gc.freeze()


@cache
def _program() -> str:
    """Return a hash of version and sources of the program, because results may change with them."""
    digest = hashlib.sha256(VERSION.encode())
    packages = Path(__file__).parents[1], Path(harness.__file__).parent
    python = [path for package in packages for path in package.rglob("*.py")]
    for path in sorted([*python, *source_folder().rglob("*.[ch]"), *packages[1].rglob("*.[ch]")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    """Add a value and its structure to a hash."""
    if isinstance(value, np.ndarray):
        digest.update(f"array{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Path):
        digest.update(b"file" + hashlib.sha256(value.read_bytes()).digest())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__name__.encode())
        for each in fields(value):
            digest.update(each.name.encode())
            _feed(digest, getattr(value, each.name))
    elif isinstance(value, Mapping):
        digest.update(f"map{len(value)}".encode())
        for key in sorted(value):
            _feed(digest, key)
            _feed(digest, value[key])
    elif isinstance(value, (list, tuple)):
        digest.update(f"row{len(value)}".encode())
        if all(isinstance(each, float) for each in value):  # each alone would take ten times as long
            digest.update(repr(value).encode())
            return
        for each in value:
            _feed(digest, each)
    else:
        digest.update(repr(value).encode() + b"\0")
