"""What a test did wrong or did not get is told at the line of the test, and not inside of this package."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from lalliance_agents.errors import LallianceError, UserError

P = ParamSpec("P")
T = TypeVar("T")


class ExpectationError(AssertionError):
    """A mission did not do what its test expects of it."""


def blames_its_caller(method: Callable[P, T]) -> Callable[P, T]:
    """Have errors of `method` that are sentences for the test's author end their traceback at the call."""

    @wraps(method)
    def call(*arguments: P.args, **named: P.kwargs) -> T:
        __tracebackhide__ = True
        try:
            return method(*arguments, **named)
        except (LallianceError, ExpectationError) as error:
            raise error.with_traceback(None) from None
        except ValueError as error:
            raise UserError(str(error)) from None

    return call
