"""Work over many items: in this process, over the cores, or on Dask.

All three give each item's result once, in no particular order, and survive what kills a process.
"""

import contextlib
import logging
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, TypeVar

from piezoest._checks import integer

Item = TypeVar("Item")
Result = TypeVar("Result")

# Tasks that Dask's scheduler knows of at a time: enough for a thousand cores, and no burden.
IN_FLIGHT = 1000
PATIENCE = 15.0  # s until a scheduler that does not answer is given up


def in_processes(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    processes: int | None = None,
    *,
    crashed: Callable[[Item], Result] | None = None,
) -> Iterator[Result]:
    """Work on items over the cores.

    `work`: what is done with each; a module's function, as for `pickle`. `processes`: how many; default one
    for each core, 1 works in this process. `crashed`: result of an item whose process died over it. The items
    that were under way when a process died are tried again, each alone. Without it the death is an error.
    """
    processes = integer("processes", os.cpu_count() or 1 if processes is None else processes, 1)
    if processes == 1:
        yield from map(work, items)
        return
    queue = deque(items)
    while queue:
        suspects = yield from _until_death(work, queue, processes, 2 * processes)
        if suspects and crashed is None:
            raise BrokenProcessPool("a process died at its work")
        if crashed is not None:
            yield from one_by_one(work, suspects, crashed)


def one_by_one(
    work: Callable[[Item], Result], items: Iterable[Item], crashed: Callable[[Item], Result]
) -> Iterator[Result]:
    """Work on one item after the other, in another process. `crashed`: see `in_processes`."""
    queue = deque(items)
    while queue:
        guilty = yield from _until_death(work, queue, 1, 1)
        yield from map(crashed, guilty)


def _until_death(
    work: Callable[[Item], Result], queue: deque[Item], processes: int, at_a_time: int
) -> Generator[Result, None, list[Item]]:
    """Work on the queue in new processes; returns what was under way when one of them died."""
    under_way: dict[Future[Result], Item] = {}
    dead: list[Item] = []
    with _pool(processes) as pool:
        while True:
            while queue and not dead and len(under_way) < at_a_time:
                item = queue.popleft()
                try:
                    under_way[pool.submit(work, item)] = item
                except BrokenProcessPool:
                    # Another one's death, seen before it could be known.
                    queue.appendleft(item)
                    break
            if not under_way:
                return dead
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                item = under_way.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    dead.append(item)
                else:
                    yield result


@contextlib.contextmanager
def _pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """New processes, which end at once if the work is given up."""
    # Numba and forked processes do not go together.
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(processes, context, initializer=_in_child)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()
        raise
    pool.shutdown()


def _in_child() -> None:
    """Leave Ctrl-C to the process that asked for the work, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        parent.join()
        os._exit(1)


def on_dask(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    scheduler: str | None = None,
    processes: int | None = None,
    *,
    crashed: Callable[[Item], Result] | None = None,
    modules: Sequence[Path] = (),
) -> Iterator[Result]:
    """Work on items with Dask: the work of a worker that is lost is done again by another.

    `scheduler`: address of a cluster's; default one of this machine's cores. `crashed`: result of an item
    over which worker after worker died; without it that is an error. `modules`: files that workers import.
    """
    try:
        import distributed
    except ImportError:
        raise ValueError("Dask is not installed: pip install 'piezoest[dask]'") from None
    with _client(scheduler, processes) as client:
        for path in modules:
            client.upload_file(str(path))
        queue = iter(items)
        under_way: dict[Any, Item] = {}

        def submit_next() -> list[Any]:
            for item in queue:
                # Not pure: Dask must not take two equal calls for one.
                future = client.submit(work, item, pure=False)
                under_way[future] = item
                return [future]
            return []

        first = [future for _ in range(IN_FLIGHT) for future in submit_next()]
        completed = distributed.as_completed(first, loop=client.loop)
        for future in completed:
            item = under_way.pop(future)
            try:
                result = future.result()
            except distributed.KilledWorker:
                if crashed is None:
                    raise
                result = crashed(item)
            completed.update(submit_next())
            yield result


def _client(scheduler: str | None, processes: int | None) -> Any:
    """Client of a cluster, or of one made for it on this machine."""
    import distributed

    workers = integer("processes", os.cpu_count() or 1 if processes is None else processes, 1)
    local = {"n_workers": workers, "threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    given = local if scheduler is None else {"address": scheduler}
    try:
        return distributed.Client(**given, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"scheduler {scheduler} does not answer: {error}") from None


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep what piezoest logs from the screen, where Python puts warnings that nobody has asked for."""
    log, nobody = logging.getLogger("piezoest"), logging.NullHandler()
    log.addHandler(nobody)
    try:
        yield
    finally:
        log.removeHandler(nobody)
