"""Where numba is: everything that is compiled passes through here, and nothing else imports numba.

The formulas of the Appendix are written once, in `lalliance_agents.model.equations`, which knows nothing of compiling. Here
they are made known to the compiler as they stand, so that the kernel calls the very functions that the robots call.

There is no cache on disk: it would not notice a change of another module. There is no `fastmath`: it would change results.
"""

from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import numba
from numba.core import types
from numba.extending import register_jitable

from lalliance_agents.model import equations

P = ParamSpec("P")
R = TypeVar("R")

# The kernel's loops are short: to do several passes at once costs time, and much more to compile.
numba.config.LOOP_VECTORIZE = numba.config.SLP_VECTORIZE = 0  # type: ignore[attr-defined] # untyped

_njit: Callable[..., Any] = numba.njit
_unliteral: Callable[[types.Type], types.Type] = types.unliteral

#: A record or an array of the kernel: numba finds out what is in it, mypy does not.
Memory = Any


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """The function, compiled when a compiled function first calls it. A division by 0 gives an infinity, as in C."""
    return _made(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """The same for a small function that is called all the time, put in the place of each call."""
    return _made(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)


def entrance(function: Callable[P, R]) -> Callable[P, R]:
    """The same for a function that Python calls, in any number of threads at a time."""
    return _made(function, nogil=True)


def _made(function: Callable[P, R], **options: bool) -> Callable[P, R]:
    made = _njit(error_model="numpy", **options)(function)
    typed = made.get_call_template

    def of_kind(arguments: Sequence[types.Type], named: dict[str, types.Type]) -> Any:
        # Without this a function is compiled anew for each number that is written out in a call.
        return typed([_unliteral(one) for one in arguments], named)

    made.get_call_template = of_kind
    compiles: Callable[P, R] = made
    return compiles


for _formula in vars(equations).values():
    if isinstance(_formula, FunctionType) and _formula.__module__ == equations.__name__:
        register_jitable(_formula)
