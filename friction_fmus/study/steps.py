"""The pieces of a study side by side, each kept when it is done, so that a study that was broken off goes on."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cache
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Final, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

import harness
from friction_fmus.blocks.catalogue import source_folder
from friction_fmus.study.result import plain
from friction_fmus.version import VERSION
from harness.storage.cache import keep, kept

T = TypeVar("T")

KEPT: Final = ".study"
"""Folder in that of the results in which finished pieces are kept."""


@dataclass(frozen=True)
class Job:
    """A piece of the study: a function at module level, what it is given, and the dataclass that it returns.

    Attributes
    ----------
    name : str
        What it is, for file names.
    function : callable
        Returns a dataclass.
    arguments : tuple
        Of numbers, texts, arrays, paths (whose content counts), mappings, sequences and dataclasses of them.
    kind : type
        What it returns.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    kind: type

    @property
    def key(self) -> str:
        """Hash of everything the result depends on."""
        digest = hashlib.sha256(_program().encode())
        _feed(digest, (self.function.__module__, self.function.__qualname__, self.arguments))
        return digest.hexdigest()[:20]


class Store:
    """Results of jobs as JSON files.

    Parameters
    ----------
    folder : Path
        Where they are; made if needed.

    Attributes
    ----------
    reused : int
        How many results were there already.
    """

    def __init__(self, folder: Path) -> None:
        """Make the folder."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.reused = 0

    def get(self, job: Job) -> Any:
        """The result of a job, or None."""
        try:
            result = rebuild(job.kind, json.loads(kept(self._path(job)) or b""))
        except (ValueError, TypeError, KeyError):
            return None  # not there, damaged, or written by something else: it is done again
        self.reused += 1
        return result

    def put(self, job: Job, result: Any) -> None:
        """Keep the result of a job; the file is complete or not there."""
        keep(self._path(job), json.dumps(plain(asdict(result))).encode())

    def _path(self, job: Job) -> Path:
        return self.folder / f"{job.name}-{job.key}.json"


def do(
    jobs: Sequence[Job], store: Store, executor: Executor | None, done: Callable[[Job], None] = lambda job: None
) -> list[Any]:
    """Do jobs that do not depend on each other.

    Parameters
    ----------
    jobs : sequence of Job
        What to do.
    store : Store
        Has the results of those that are done, gets the others as they are finished.
    executor : Executor or None
        Where; None: here.
    done : callable
        Told each job that is finished.

    Returns
    -------
    list
        The results, in the order of the jobs.
    """
    results: dict[int, Any] = {}
    waiting: dict[Future[Any], int] = {}
    for place, job in enumerate(jobs):
        if (known := store.get(job)) is not None:
            results[place] = known
            done(job)
        elif executor is not None:
            waiting[executor.submit(_quietly, job.function, job.arguments)] = place
        else:
            results[place] = _quietly(job.function, job.arguments)
            store.put(job, results[place])
            done(job)
    for future in as_completed(waiting):
        place = waiting[future]
        results[place] = future.result()
        store.put(jobs[place], results[place])
        done(jobs[place])
    return [results[place] for place in range(len(jobs))]


@contextmanager
def workers(count: int) -> Iterator[Executor | None]:
    """Processes that have already imported this package, or None for one worker."""
    if count < 2:
        yield None
        return
    others = set(active_children())
    with ProcessPoolExecutor(count, get_context("spawn"), _prepare) as pool:
        for _ in range(count):
            pool.submit(_ready)
        try:
            yield pool
        except BaseException:  # what is under way is not wanted any more
            for process in set(active_children()) - others:
                process.terminate()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _prepare() -> None:
    """First thing in a process: Ctrl-C is for the study, and nothing is to outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def rebuild(kind: Any, content: Any) -> Any:
    """Make dataclasses again from what `asdict` and JSON made of them.

    Parameters
    ----------
    kind : type
        A dataclass whose fields are dataclasses, tuples and mappings of them, numbers, texts, or None.
    content : object
        What JSON holds.
    """
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        if content is None and NoneType in inner:
            return None
        return rebuild(next(each for each in inner if each is not NoneType), content)
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        made: Any = kind
        return made(**{each.name: rebuild(hints[each.name], content[each.name]) for each in fields(kind)})
    if origin is tuple:
        return tuple(rebuild(inner[0], each) for each in content)
    if origin is not None and issubclass(origin, Mapping):
        return {key: rebuild(inner[1], each) for key, each in content.items()}
    return float(content) if kind is float else content


def forget(out: Path) -> None:
    """Remove what is kept of a study."""
    shutil.rmtree(out / KEPT, ignore_errors=True)


def _quietly(function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """Do a job without the log of the parts: what fails in it is in its result, and many runs are meant to fail."""
    log = logging.getLogger("harness")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        return function(*arguments)
    finally:
        log.setLevel(before)


def _ready() -> None:
    """Do nothing; to be called makes a new process import this package."""


@cache
def _program() -> str:
    """Version and source text of the program: other programs give other results."""
    digest = hashlib.sha256(VERSION.encode())
    packages = Path(__file__).parents[1], Path(harness.__file__).parent
    python = [path for package in packages for path in package.rglob("*.py")]
    for path in sorted([*python, *source_folder().rglob("*.[ch]"), *packages[1].rglob("*.[ch]")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    """Put a value into a hash, with its structure."""
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
        for each in value:
            _feed(digest, each)
    else:
        digest.update(repr(value).encode() + b"\0")
