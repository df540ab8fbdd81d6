"""Packages that only some commands need. They are looked for when they are used, so that the rest runs without them."""

import contextlib
from collections.abc import Iterator

from lalliance_agents.errors import UserError


class MissingExtraError(UserError):
    """A package of an extra is not installed."""


@contextlib.contextmanager
def extra(name: str) -> Iterator[None]:
    """Have packages of the extra `name` imported inside.

    Raises:
        MissingExtraError: one is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"this needs the package {(error.name or str(error)).partition('.')[0]}, which is not installed; "
            f"expected the {name} extra: pip install 'lalliance[{name}]'"
        ) from None
