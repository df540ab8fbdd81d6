"""Parts of a study on several machines: handed to the workers of a Dask scheduler.

    dask scheduler --host 192.0.2.1            on one machine
    dask worker tcp://192.0.2.1:8786           on each, in an environment with this version of lalliance[cluster]
    lalliance study run --preset paper --out DIR --backend dask --scheduler tcp://192.0.2.1:8786

Rows come back to the machine of the last command, and are kept there alone. What a lost worker was at is done again by another
one. A scheduler that is lost ends the run, which the same command then goes on with; joblib's Dask backend would wait for
ever.
"""

import logging
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from importlib.metadata import version
from typing import Any, TypeVar

from lalliance_agents.errors import LallianceError, UserError
from lalliance_study.extras import study_package
from lalliance_study.pool import AHEAD

#: A scheduler that has not answered after this many seconds does not, and one without workers gets none.
PATIENCE = 5.0
#: How often is looked whether the scheduler is still there, in seconds.
LOOK = 1.0

T = TypeVar("T")


def at_workers_of(address: str) -> Callable[[Callable[..., T], Iterable[tuple[Any, ...]]], Generator[T, None, None]]:
    """How parts are handed out by the scheduler at `address`, such as `tcp://192.0.2.1:8786`.

    Raises:
        UserError: it does not answer, has no workers, or has some with another version; among these `MissingExtraError`.
    """
    distributed = study_package("distributed", "cluster")
    for name in list(logging.root.manager.loggerDict):  # what there is to be told is told by the errors below
        if name.partition(".")[0] in {"distributed", "tornado", "asyncio"}:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    client = _client(distributed, address)

    def hand_out(work: Callable[..., T], parts: Iterable[tuple[Any, ...]]) -> Generator[T, None, None]:
        try:
            yield from _hand_out(distributed, client, work, iter(parts))
        except (OSError, distributed.CancelledError):
            raise LallianceError(
                f"the scheduler at {address} is lost; the same command goes on with what is left"
            ) from None
        finally:
            client.close(timeout=LOOK)

    return hand_out


def _hand_out(
    distributed: Any, client: Any, work: Callable[..., T], parts: Iterator[tuple[Any, ...]]
) -> Generator[T, None, None]:
    waiting: set[Any] = set()
    while True:
        threads = sum(client.nthreads().values())
        while len(waiting) < AHEAD * max(threads, 1) and (part := next(parts, None)) is not None:
            waiting.add(client.submit(work, *part, pure=False))
        if not waiting:
            return
        with suppress(TimeoutError):
            done, waiting = distributed.wait(waiting, timeout=LOOK, return_when="FIRST_COMPLETED")
            for one in done:
                yield one.result()


def _client(distributed: Any, address: str) -> Any:
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        why = "it does not answer" if isinstance(error, OSError) else str(error)
        raise UserError(f"--scheduler {address}: {why}; expected a Dask scheduler, as tcp://HOST:8786") from None
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        found = client.run(_version)
    except TimeoutError:
        client.close(timeout=LOOK)
        raise UserError(f"--scheduler {address}: it has no workers; expected at least one dask worker") from None
    strange = next(((worker, one) for worker, one in found.items() if one != _version()), None)
    if strange is not None:
        client.close(timeout=LOOK)
        raise UserError(f"worker {strange[0]} has lalliance {strange[1]}; expected {_version()}, as here")
    return client


def _version() -> str:
    return version("lalliance")
