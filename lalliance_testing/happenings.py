"""What happens in a mission, in the words in which a test waits for it; the same from real processes and from the simulator.

What an operator hears is a `Happened`: the world's events, the robots' decisions, and remarks on processes. `Wanted` says
which of them a test waits for.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.model.events import Cause
from lalliance_agents.suggestions import like_or_any
from mission_control.watch.happened import KINDS, Happened
from world_server.world import Stage

_CAUSES = {*(cause.value for cause in Cause), Stage.COMPLETE.value, Stage.FAILED.value}


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a test waits for: a kind of event and what is to be true of it; None: anything.

    Attributes:
        text: what its text is to contain.
    """

    kind: str
    robot: str | None = None
    task: str | None = None
    cause: str | None = None
    other: str | None = None
    fault: str | None = None
    text: str | None = None

    @classmethod
    def of(cls, kind: str, facts: Mapping[str, str | None], mission: Mission) -> "Wanted":
        """What `kind` and `facts` ask for, checked against the mission.

        Raises:
            UserError: no such thing can happen in this mission.
        """
        known = [field.name for field in fields(cls) if field.name != "kind"]
        _check(kind, KINDS, "a kind of event")
        for name in facts:
            _check(name, known, "a fact of an event")
        for name in ("robot", "other"):
            _check(facts.get(name), mission.robots, "a robot of this mission")
        _check(facts.get("task"), mission.tasks, "a task of this mission")
        _check(facts.get("cause"), _CAUSES, "a cause")
        return cls(kind, **facts)

    def fits(self, event: Happened) -> bool:
        """Whether this is it."""
        return (
            event.kind == self.kind
            and all(wanted == getattr(event, name) for name, wanted in self._facts() if name != "text")
            and (self.text is None or self.text in event.text)
        )

    def _facts(self) -> Iterator[tuple[str, str]]:
        return ((name, value) for name, value in asdict(self).items() if name != "kind" and value is not None)

    def __str__(self) -> str:
        return " ".join([self.kind, *(f"{name}={value}" for name, value in self._facts())])


def _check(word: str | None, known: Mapping[str, object] | list[str] | set[str], what: str) -> None:
    if word is not None and word not in known:
        raise UserError(f"{word!r} is not {what}{like_or_any(word, sorted(known))}")
