"""When a robot's sets will change by themselves: the instants at which a driver that skips steps must not.

A motivation is a ramp, and a gate opens or closes at an instant that is known beforehand, as long as nothing new is heard or
sensed. Here these instants are read off the state that a step has left. They are bounds: a step made before one of them is
wasted and does no harm, one left out after it would be missed. Silences are not among them (`Hearing.next_lapse`), since
each message moves them.
"""

import math

from lalliance_agents.model import equations
from lalliance_agents.model.appraisal import Appraisal
from lalliance_agents.model.events import Factors, Pace
from lalliance_agents.model.hearing import Hearing
from lalliance_agents.model.motivation import Motivation
from lalliance_agents.model.parameters import SLACK, Erratum, Parameters

#: The next step, whenever it is.
AT_ONCE = -math.inf


class Outlook:
    """Looks ahead for one robot.

    Args:
        parameters: the robot's parameters.
        appraisal: what it makes of its tasks.
        hearing: what it has heard.
        sets: the number of its behaviour sets.
    """

    def __init__(self, parameters: Parameters, appraisal: Appraisal, hearing: Hearing, sets: int) -> None:
        self._threshold = parameters.threshold
        self._appraisal = appraisal
        self._hearing = hearing
        literal = parameters.is_literal
        #: Whether every step counts: windows that may miss an instant, sets that strike one another out, boredom that
        #: grows in the factors of the active set, a threshold that 0 reaches.
        self.restless = (
            literal(Erratum.WINDOW_ENDS)
            or literal(Erratum.ONE_ACTIVE)
            or (literal(Erratum.BOREDOM_AT_WORK) and sets == 1)
            or equations.reaches(0.0, parameters.threshold)
        )

    def next_change(self, one: Motivation, now: float) -> float:
        """The earliest instant at which the step after `now` may find `one` changed, but for its ramp."""
        factors = one.factors
        if one.active_since is None and one.sensory_feedback == 0:
            return math.inf
        if factors is None:
            return AT_ONCE
        if one.active_since is not None:
            return self._end_of_attempt(one.task, one.active_since, factors, now)
        if not factors.is_open:
            return math.inf  # what opens a gate is an event, a silence, boredom, or a step that was not the last
        expected = 0.0 if factors.pace is Pace.WAITING else factors.rate
        if factors.pace is Pace.RANDOM or one.rate != expected:
            return AT_ONCE
        ready = equations.ramp_reaches(one.base, one.since, one.rate, self._threshold)
        return min(ready, self._appraisal.patience_ends(one.task, now))

    def _end_of_attempt(self, task: str, since: float, factors: Factors, now: float) -> float:
        """Lambda, psi where there is a contender, and the patience that shows in the factors of the active set."""
        limits = [factors.lambda_]
        if self._hearing.anybody_on(task, now):
            limits.append(factors.psi)
        # A time that is unknown, erratum 10 read literally, limits nothing.
        ends = [since + limit for limit in limits if not math.isnan(limit)]
        return min(*ends, math.inf, self._appraisal.patience_ends(task, now)) - SLACK
