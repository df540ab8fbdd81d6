"""What a robot's behaviour sets say of their tasks, and whether that has changed.

They are asked at each control step. What they raise is held against the task, never against the robot.
"""

import logging
from collections.abc import Iterable

from lalliance_agents.agent import translate
from lalliance_agents.agent.behavior import BehaviorSet, described
from lalliance_agents.model.events import Sensed

_log = logging.getLogger(__name__)


class Senses:
    """What was felt last of each task of one robot."""

    def __init__(self) -> None:
        self._felt: dict[str, tuple[bool, bool]] = {}
        self._broken: set[str] = set()
        self._contradicted: set[str] = set()

    def forget(self, repertoire: Iterable[BehaviorSet]) -> None:
        """Begin a trial in which nothing was felt, sensed or done."""
        self._felt.clear()
        for one in repertoire:
            one.sensed = None
            one.returned = False

    def feel(self, one: BehaviorSet) -> Sensed | None:
        """Ask a behaviour set how its task stands; None if that is as before."""
        try:
            felt = bool(one.applicable()), self._is_complete(one)
        except (Exception, SystemExit):
            if one.task not in self._broken:
                self._broken.add(one.task)
                _log.exception("sensing of %s failed; taken as not applicable", described(one))
            felt = False, False
        if self._felt.get(one.task) == felt:
            return None
        self._felt[one.task] = felt
        return translate.sensed(one.task, *felt)

    def _is_complete(self, one: BehaviorSet) -> bool:
        """What the set says; and where there is a world, that decides when a task is done."""
        says = bool(one.complete())
        if one.sensed is not None and says and not one.sensed.complete and one.task not in self._contradicted:
            self._contradicted.add(one.task)
            _log.warning("%s says that its task is complete, and the world says that it is not", described(one))
        return says or (one.sensed is not None and one.sensed.complete)
