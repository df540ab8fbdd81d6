"""The parameters of L-ALLIANCE, as the code has them."""

from collections.abc import Callable

from lalliance_agents.model.parameters import HandSet, Parameters
from made.records import fields

PARTS: dict[str, Callable[[], str]] = {"parameters": lambda: fields(Parameters), "by-hand": lambda: fields(HandSet)}
