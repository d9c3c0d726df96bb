"""Pools of worker processes that end as soon as the process that started them ends or has an error."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Provide a pool of new processes; if the block raises, running calls are not waited for."""
    others = set(active_children())
    with ProcessPoolExecutor(count, get_context("spawn"), _prepare) as pool:
        try:
            yield pool
        except BaseException:
            for process in set(active_children()) - others:
                process.terminate()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def end_with_parent(clean_up: Callable[[], object] = lambda: None) -> None:
    """Let this worker process clean up and end as soon as its parent has ended, whatever it computes."""

    def wait() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            clean_up()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _prepare() -> None:
    """Prepare a worker process: ignore Ctrl-C, which the parent handles, and end with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
