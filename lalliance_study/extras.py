"""Packages that only the study needs, or only a study on several machines.

They are looked for when they are used, so that the rest runs without them.
"""

from importlib import import_module
from types import ModuleType

from lalliance_agents.errors import UserError


class MissingExtraError(UserError):
    """A package of an extra is not installed."""


def study_package(module: str, extra: str = "study") -> ModuleType:
    """A module of a package of the study extra, or of another one.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"this needs the package {(error.name or module).partition('.')[0]}, which is not installed; "
            f"expected the {extra} extra: pip install 'lalliance[{extra}]'"
        ) from None
