"""A campaign on several processors: parts of it go to processes of their own, and what they find is added up as it comes."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from lalliance_agents.errors import LallianceError
from lalliance_study.campaign import Result, examine
from mission_control.processes import end_with_parent

#: Missions that are handed to a process at once, and parts that wait for each process.
PART = 16
AHEAD = 3


def parts(missions: int) -> Iterator[range]:
    """The numbers of a campaign, cut into parts."""
    return (range(first, min(first + PART, missions)) for first in range(0, missions, PART))


def run_campaign(seed: int, missions: int, jobs: int, report: Callable[[Result], None]) -> tuple[Result, bool]:
    """Examine the missions 0 … `missions` - 1; what came of them, and whether Ctrl-C ended it early.

    Args:
        seed: the campaign's seed.
        missions: how many.
        jobs: the number of processes; 1: this one.
        report: called with the whole result so far after each part.

    Raises:
        LallianceError: one of the processes was killed.
    """
    total = Result()
    try:
        found = _one_by_one(seed, missions) if jobs == 1 else _at_once(seed, missions, jobs)
        for result in found:
            total.add(result)
            report(total)
    except KeyboardInterrupt:
        return total, True
    return total, False


def _one_by_one(seed: int, missions: int) -> Iterator[Result]:
    return (examine(seed, part) for part in parts(missions))


def _at_once(seed: int, missions: int, jobs: int) -> Iterator[Result]:
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=_begin, initargs=(os.getpid(),))
    waiting: set[Future[Result]] = set()
    todo = parts(missions)
    try:
        while True:
            while len(waiting) < AHEAD * jobs and (part := next(todo, None)) is not None:
                waiting.add(_submit(pool, seed, part))
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for one in done:
                yield one.result()
    except BrokenProcessPool:
        raise LallianceError("a process of the campaign was killed; expected it to live, is memory short?") from None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        if waiting:
            # Told to end early: nobody will ask for what they are at.
            for child in multiprocessing.active_children():
                child.terminate()


def _submit(pool: ProcessPoolExecutor, seed: int, part: range) -> Future[Result]:
    """Hand over a part; a process that this starts is born deaf to Ctrl-C, which is for the parent alone."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        return pool.submit(examine, seed, part)
    finally:
        signal.signal(signal.SIGINT, before)


def _begin(parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(parent)
