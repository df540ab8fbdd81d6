"""Work on all cores: parts go to processes of their own, and results come as they are ready.

Ctrl-C and a request to end are for the parent alone: it ends the children and says what it has. Children end with their parent,
whatever that dies of.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from lalliance_agents.errors import LallianceError
from lalliance_agents.lineage import end_with_parent

#: Parts that wait for each process.
AHEAD = 3

T = TypeVar("T")


def at_once(work: Callable[..., T], parts: Iterable[tuple[Any, ...]], jobs: int | None) -> Generator[T, None, None]:
    """What `work` returns for each of `parts`, in the order in which that comes.

    Args:
        work: a function of a module, called in another process.
        parts: its arguments, which can be pickled.
        jobs: the number of processes; None: one per core; 1: this one.

    Raises:
        LallianceError: one of the processes was killed.
    """
    jobs = len(os.sched_getaffinity(0)) if jobs is None else jobs
    return (work(*part) for part in parts) if jobs == 1 else _in_processes(work, iter(parts), jobs)


def _in_processes(work: Callable[..., T], parts: Iterator[tuple[Any, ...]], jobs: int) -> Generator[T, None, None]:
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, context, initializer=_begin, initargs=(os.getpid(),))
    waiting: set[Future[T]] = set()
    through = False
    try:
        while True:
            while len(waiting) < AHEAD * jobs and (part := next(parts, None)) is not None:
                waiting.add(_submit(pool, work, part))
            if not waiting:
                through = True
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for one in done:
                yield one.result()
    except BrokenProcessPool:
        raise LallianceError("a process that did a part of the work was killed; is memory short?") from None
    finally:
        # Not to wait although all is done would leave the interpreter to end it, which can fail at that (seen once).
        pool.shutdown(wait=through, cancel_futures=True)
        if not through:
            # Told to end early: nobody will ask for what they are at.
            for child in multiprocessing.active_children():
                child.terminate()


#: What ends this process, which is put off while another one is born.
_ENDS = (signal.SIGINT, signal.SIGTERM)


def _submit(pool: ProcessPoolExecutor, work: Callable[..., T], part: tuple[Any, ...]) -> Future[T]:
    """Hand over a part; a process that this starts is born deaf, as it inherits what is blocked here."""
    came: list[int] = []
    before = {number: signal.signal(number, lambda told, _: came.append(told)) for number in _ENDS}
    try:
        resource_tracker.ensure_running()  # which would unblock them if it were started along with the first process
        signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)
        return pool.submit(work, *part)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
        for number, handler in before.items():
            signal.signal(number, handler)
        for told in came:
            signal.raise_signal(told)


def _begin(parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
    end_with_parent(parent)


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[int, str], None]]:
    """A progress bar on standard error, if that is a terminal; the function given moves it on, with a remark."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda count, remark: bar.update(task, advance=count, description=f"{what} {remark}".strip())
