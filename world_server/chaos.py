"""What an operator may do to a running mission: put faults in force, end them, and ask which there are.

A command comes as a query and is answered at once, with what was done or with the sentence that says why not. The fault in it
is spelled and checked as in a mission file; when it begins is always now.
"""

from collections.abc import Callable
from typing import Any

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.drops import CUT_OFF
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.wire.keys import OPERATOR
from lalliance_agents.wire.messages import LONGEST_LINE, ChaosAnswer, ChaosCommand, decode, encode
from world_server.history import History

#: Faults that one mission can have had in all: an operator's script that runs wild ends here.
MOST_FAULTS = 1000
#: Faults in an answer: the latest.
SHOWN_FAULTS = 100


class ChaosDesk:
    """Answers commands.

    Args:
        history: of the world they are about.
        messenger: gives the answers their header.
        clock: the present instant, in seconds of mission time.
        settle: called before each answer; makes what was done last, and tells others of it.
    """

    def __init__(
        self, history: History, messenger: Messenger, clock: Callable[[], float], settle: Callable[[], None]
    ) -> None:
        self._history = history
        self._world = history.world
        self._messenger = messenger
        self._clock = clock
        self._settle = settle

    def answer(self, ask: Sample) -> list[Sample]:
        """The answer to one command."""
        try:
            text = self._carry_out(decode(ChaosCommand, ask.payload))
        except MessageError as error:
            self._messenger.drop(error.reason, OPERATOR, str(error))
            return self._reply(ask, done=False, text=f"not a command: {error}")
        except UserError as error:
            return self._reply(ask, done=False, text=str(error))
        return self._reply(ask, done=True, text=text)

    def _carry_out(self, command: ChaosCommand) -> str:
        now = self._clock()
        if command.verb == "status":
            self._history.advance(now)
            return f"{self._world.stage} at {self._world.elapsed:.1f} s{self._cut_off()}"
        if command.verb == "inject" and len(self._world.failures.entries) >= MOST_FAULTS:
            raise UserError(f"this mission has had {MOST_FAULTS} faults; expected no more than that")
        return self._history.obey(command, now)

    def _cut_off(self) -> str:
        """Of whom nothing is used any more, and by whom; empty: of nobody."""
        pairs = [f"{one['of']} at {one['at']}" for one in self._world.ledger.drops() if one["reason"] == CUT_OFF]
        return f"; cut off: {', '.join(pairs)}" if pairs else ""

    def _reply(self, ask: Sample, *, done: bool, text: str) -> list[Sample]:
        self._settle()
        faults: list[dict[str, Any]] = self._world.failures.report()
        answer = ChaosAnswer(
            **self._messenger.header(), done=done, text=text[:LONGEST_LINE], faults=faults[-SHOWN_FAULTS:]
        )
        return [Sample(ask.key, encode(answer))]
