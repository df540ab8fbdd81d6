"""When a robot broadcasts: at rate rho, by the control step nearest to the instant due, and at once when it takes up a task."""

from lalliance_agents.model.equations import announces_from


class Cadence:
    """The instants of one robot's announcements.

    Args:
        period: 1 / rho, in seconds.
        now: when the first is due.

    Attributes:
        due: when the next is due, in seconds.
    """

    def __init__(self, period: float, now: float) -> None:
        self._period = period
        self.due = now

    def is_due(self, now: float, before: float) -> bool:
        """Whether the step at `now`, after one at `before`, is to announce: it is the first nearest to the instant due."""
        return now >= announces_from(self.due, now - before)

    def next_step(self, first: float, period: float, step: int) -> int:
        """The first step from `step` on that is to announce, if all steps of a grid are made, which begins at `first`."""
        due, before = self.due, first + (step - 1) * period
        while (now := first + step * period) < announces_from(due, now - before):
            before = now
            step += 1
        return step

    def keep(self, now: float) -> None:
        """The announcement that was due is made at `now`; the next keeps the rate, unless it would be late already."""
        kept = self.due + self._period
        self.due = kept if kept > now else now + self._period

    def begin_anew(self, now: float) -> None:
        """An announcement is made at `now` that was not due."""
        self.due = now + self._period
