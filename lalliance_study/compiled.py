"""Where numba is: everything that is compiled passes through here, and nothing else imports numba.

The formulas of the Appendix are written once, in `lalliance_agents.model.equations`, which knows nothing of compiling. Here
they are made known to the compiler as they stand, so that the kernel calls the very functions that the robots call.

There is no cache on disk: it would not notice a change of another module. There is no `fastmath`: it would change results.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import numba
from numba.extending import register_jitable

from lalliance_agents.model import equations

P = ParamSpec("P")
R = TypeVar("R")

#: A record or an array of the kernel: numba finds out what is in it, mypy does not.
Memory = Any


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """The function, compiled at its first call. A division by 0 gives an infinity, as in C."""
    made: Callable[P, R] = numba.njit(nogil=True, error_model="numpy")(function)
    return made


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """The same for a small function that is called all the time, put in the place of each call."""
    made: Callable[P, R] = numba.njit(nogil=True, error_model="numpy", forceinline=True)(function)
    return made


def in_threads(function: Callable[P, R]) -> Callable[P, R]:
    """The same for a function whose `each` loops are shared out among threads."""
    made: Callable[P, R] = numba.njit(nogil=True, error_model="numpy", parallel=True)(function)
    return made


#: `range`, and inside a function `in_threads` a range whose passes run in parallel.
each: type[range] = numba.prange


def set_threads(count: int) -> None:
    """How many threads `in_threads` may use; the machine may have fewer."""
    most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    numba.set_num_threads(min(count, most))


for _formula in vars(equations).values():
    if isinstance(_formula, FunctionType) and _formula.__module__ == equations.__name__:
        register_jitable(_formula)
