"""Parts of a study on several machines: through joblib, whose Dask backend hands them to the workers of a Dask scheduler.

    dask scheduler --host 192.0.2.1            on one machine
    dask worker tcp://192.0.2.1:8786           on each, in an environment with this version of lalliance[cluster]
    lalliance study run --preset paper --out DIR --backend dask --scheduler tcp://192.0.2.1:8786

Rows come back to the machine of the last command, and are kept there alone.
"""

import logging
from collections.abc import Callable, Generator, Iterable
from importlib.metadata import version
from typing import Any, TypeVar

from lalliance_agents.errors import LallianceError, UserError
from lalliance_study.extras import study_package

#: A scheduler that has not answered after this many seconds does not, and one without workers gets none.
PATIENCE = 8.0
#: Parts that wait for each worker.
AHEAD = 3

T = TypeVar("T")


def at_workers_of(address: str) -> Callable[[Callable[..., T], Iterable[tuple[Any, ...]]], Generator[T, None, None]]:
    """How parts are handed out by the scheduler at `address`, such as `tcp://192.0.2.1:8786`.

    Raises:
        UserError: it does not answer, has no workers, or has some with another version; among these `MissingExtraError`.
    """
    distributed = study_package("distributed", "cluster")
    joblib = study_package("joblib", "cluster")
    for name in ("distributed", "tornado"):  # what there is to be told is told by the errors below
        logging.getLogger(name).setLevel(logging.CRITICAL)
    client = _client(distributed, address)

    def hand_out(work: Callable[..., T], parts: Iterable[tuple[Any, ...]]) -> Generator[T, None, None]:
        try:
            with joblib.parallel_config(backend="dask", client=client):
                at_work = joblib.Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch=f"{AHEAD}*n_jobs")
                yield from at_work(joblib.delayed(work)(*part) for part in parts)
        except (OSError, distributed.CancelledError, distributed.KilledWorker) as error:
            raise LallianceError(f"the scheduler at {address} is lost ({error})") from None
        finally:
            client.close()

    return hand_out


def _client(distributed: Any, address: str) -> Any:
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        why = "it does not answer" if isinstance(error, OSError) else str(error)
        raise UserError(f"--scheduler {address}: {why}; expected a Dask scheduler, as tcp://HOST:8786") from None
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        found = client.run(_version)
    except TimeoutError:
        client.close()
        raise UserError(f"--scheduler {address}: it has no workers; expected at least one dask worker") from None
    strange = next(((worker, one) for worker, one in found.items() if one != _version()), None)
    if strange is not None:
        client.close()
        raise UserError(f"worker {strange[0]} has lalliance {strange[1]}; expected {_version()}, as here")
    return client


def _version() -> str:
    return version("lalliance")
