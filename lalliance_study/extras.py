"""Packages that only the study needs. They are looked for when they are used, so that the rest runs without them."""

from importlib import import_module
from types import ModuleType

from lalliance_agents.extras import extra


def study_package(module: str) -> ModuleType:
    """A module of a package of the study extra.

    Raises:
        MissingExtraError: it is not installed.
    """
    with extra("study"):
        return import_module(module)
