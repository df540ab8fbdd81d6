"""Packages that only the study needs, or only a study on several machines.

They are looked for when they are used, so that the rest runs without them.
"""

from importlib import import_module
from types import ModuleType

from lalliance_agents.extras import extra as needed_extra


def study_package(module: str, extra: str = "study") -> ModuleType:
    """A module of a package of the study extra, or of another one.

    Raises:
        MissingExtraError: it is not installed.
    """
    with needed_extra(extra):
        return import_module(module)
