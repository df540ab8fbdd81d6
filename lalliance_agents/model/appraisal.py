"""What a robot makes of one task at one instant: every factor of the motivation, from what it heard and what it knows.

This is the lower half of the Appendix, put together: which category a task is in, how impatient the robot is about it, what
suppresses it. Nothing is changed here and nothing is decided; `mind` does both. Each doubtful place of the Appendix is
decided by the reading of its `Erratum`.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lalliance_agents.model import equations
from lalliance_agents.model.events import Factors, Pace, Teammate
from lalliance_agents.model.hearing import Contact, Hearing
from lalliance_agents.model.knowledge import Knowledge
from lalliance_agents.model.motivation import Expectation, Motivation
from lalliance_agents.model.parameters import SLACK, Architecture, Erratum, Parameters


class Moment(NamedTuple):
    """What all sets of a robot have in common at one step."""

    now: float
    before: float
    """The step before: what was heard since is news."""
    present: Sequence[str]
    boredom: float
    waiting: bool
    """Whether motivation has to wait for the roster (erratum 4)."""


class Appraisal:
    """Computes the factors of one robot's behaviour sets.

    Args:
        parameters: the robot's parameters.
        knowledge: its learned times.
        hearing: what it has heard.
    """

    def __init__(self, parameters: Parameters, knowledge: Knowledge, hearing: Hearing) -> None:
        self._parameters = parameters
        self._threshold = parameters.threshold
        self._collision_window = parameters.effective_collision_window
        self._knowledge = knowledge
        self._hearing = hearing
        self._learns = parameters.architecture is Architecture.L_ALLIANCE
        literal = parameters.is_literal
        #: Whether a robot goes on comparing itself with others while it works (erratum 1, literal).
        self.influence_on_active = literal(Erratum.INFLUENCE_ON_ACTIVE)
        self._reset_on_active = literal(Erratum.RESET_ON_ACTIVE)
        self._slowest_of_all = literal(Erratum.SLOWEST_OF_WHOM)
        self._learning_looks_back = literal(Erratum.LEARNING_WINDOW)
        self._gives_up = not literal(Erratum.GIVE_UP_RULE)

    def adaptive(self, one: Motivation, moment: Moment, *, suppressed: bool) -> Factors:
        """The factors of `one` in the adaptive phase; its motivation is left at 0 for the caller to fill in.

        activity_suppression_ij(t): 0 while another set is active, which the caller says by `suppressed`.
        """
        on_task = self._hearing.on_task(one.task, moment.now)
        expected = self._expect(one, moment.present, contended=bool(on_task))
        pace, rate = self._impatience(one, moment, expected, on_task)
        return Factors(
            0.0,
            pace,
            rate,
            self._threshold / expected.fast,
            expected.category,
            expected.own_time,
            expected.best_time,
            moment.boredom,
            one.sensory_feedback,
            0 if suppressed else 1,
            self._reset(one, moment),
            equations.acquiescence(one.active_for(moment.now), expected.psi, expected.contended, expected.lambda_),
            self._influence(one, moment, expected.category),
            expected.psi,
            expected.lambda_,
        )

    def _expect(self, one: Motivation, present: Sequence[str], *, contended: bool) -> Expectation:
        """What is expected of a task; computed anew only when something it depends on has changed."""
        known, task = one.expectation, one.task
        if (
            known is not None
            and known.learned == self._knowledge.version
            and known.present is present
            and known.contended is contended
        ):
            return known
        own_time = self._knowledge.own_time(task)
        best_time = self._knowledge.best_time(task, present)
        # A robot does not expect to be best by a time that is only a lower bound: or it returns to its failure before
        # it is bored enough to try what a stuck teammate holds, and the two never come free.
        expects = self._knowledge.knows_teammates and not self._knowledge.has_failed(task)
        category = equations.task_category(own_time, best_time, contended, expects, self._parameters.ordering)
        fast = self._fast_rate(one, category, own_time)
        psi, lambda_ = self._patience_with_oneself(task, own_time, best_time)
        one.expectation = Expectation(
            self._knowledge.version, present, contended, own_time, best_time, category, fast, psi, lambda_
        )
        return one.expectation

    def learning(self, one: Motivation, moment: Moment, *, suppressed: bool) -> Factors:
        """m_ij(t), active learning phase: the factors of `one`; no impatience, no acquiescence, no giving up."""
        own_time = self._knowledge.own_time(one.task)
        return Factors(
            motivation=0.0,
            pace=self._pace(one, moment, Pace.RANDOM),
            rate=0.0,
            delay=0.0,
            category=2,
            own_time=own_time,
            best_time=self._knowledge.best_time(one.task, moment.present),
            boredom=moment.boredom,
            sensory_feedback=one.sensory_feedback,
            activity_suppression=0 if suppressed else 1,
            impatience_reset=1 if one.active else equations.learning_impatience(self._taken(one.task, moment)),
            acquiescence=1,
            learned_robot_influence=1,
            psi=math.inf,
            lambda_=math.inf,
        )

    def teammates(self, task: str, now: float) -> tuple[Teammate, ...]:
        """What is known of all who were heard on `task`, the last one heard first."""
        own_time, silences = self._knowledge.own_time(task), self._hearing.silences(now)
        found = [
            Teammate(
                robot=contact.robot,
                first_heard=contact.first,
                last_heard=contact.last,
                lapsed_at=contact.lapsed_at,
                present=self._hearing.is_present(contact.robot, now),
                patience=self._patience(contact, task, own_time),
                task_time=self._knowledge.time_of(contact.robot, task),
                silent_for=silences[contact.robot],
                started=contact.started,
                expected=contact.expected,
            )
            for contact in self._hearing.contacts(task)
        ]
        return tuple(sorted(found, key=lambda one: (-one.last_heard, one.robot)))

    def contender(self, task: str) -> str | None:
        """The teammate on `task` that was heard last; None if there is none."""
        on_task = [contact for contact in self._hearing.contacts(task) if contact.lapsed_at is None]
        return min(on_task, key=lambda one: (-one.last, one.robot)).robot if on_task else None

    def rival(self, one: Motivation, me: str, now: float) -> str | None:
        """A teammate that started the same task at the same time and expects to be faster (erratum 15)."""
        if one.active_since is None:
            return None
        for contact in self._hearing.contacts(one.task):
            if (
                self._hearing.is_on(contact, now)
                and equations.collides(one.active_since, contact.started, self._collision_window)
                and equations.gives_way(one.expected, contact.expected, contact.robot < me)
            ):
                return contact.robot
        return None

    def expected_time(self, task: str) -> float:
        """The time that this robot announces to need for `task`, in seconds."""
        if not self._learns:
            return self._parameters.for_set(task).yield_time
        own_time = self._knowledge.own_time(task)
        return self._parameters.initial_task_time if math.isnan(own_time) else own_time

    def _taken(self, task: str, moment: Moment) -> bool:
        if not self._learning_looks_back:
            return self._hearing.anybody_on(task, moment.now)
        return any(contact.robot in moment.present for contact in self._hearing.contacts(task))

    def _fast_rate(self, one: Motivation, category: int, own_time: float) -> float:
        parameters = self._parameters
        if not self._learns:
            return parameters.for_set(one.task).fast_rate
        low, high = self._knowledge.span()
        wait = equations.delay(
            parameters.ordering,
            category,
            own_time,
            low,
            self._knowledge.scale(low, high),
            parameters.min_delay,
            parameters.max_delay,
            one.draw,
        )
        return equations.fast_rate(parameters.threshold, wait)

    def _impatience(
        self, one: Motivation, moment: Moment, expected: Expectation, on_task: Sequence[Contact]
    ) -> tuple[Pace, float]:
        """impatience_ij(t): the least delta_slow of those who hold this robot back, else delta_fast."""
        pace, rate, slow = Pace.FAST, expected.fast, []
        for contact in on_task:
            phi, slow_rate = self._held(one.task, contact, expected)
            if equations.holds_back(True, self._hearing.heard_until(contact, moment.now - phi)):
                slow.append(slow_rate)
        if slow:
            if self._slowest_of_all:
                slow = [self._held(one.task, contact, expected)[1] for contact in self._hearing.contacts(one.task)]
            pace, rate = Pace.SLOW, min(slow)
        if math.isnan(rate):
            return Pace.UNDEFINED, 0.0
        return self._pace(one, moment, pace), rate

    def _held(self, task: str, contact: Contact, expected: Expectation) -> tuple[float, float]:
        """phi_ij(k, t) in seconds, and delta_slow_ij(k, t)."""
        held = expected.held.get(contact.robot)
        if held is None:
            phi = self._patience(contact, task, expected.own_time)
            held = expected.held[contact.robot] = phi, self._slow_rate(task, phi)
        return held

    def patience_ends(self, task: str, now: float) -> float:
        """The earliest instant after `now` at which patience with somebody on `task` runs out; infinity if there is none."""
        earliest, own_time = math.inf, self._knowledge.own_time(task)
        for contact in self._hearing.contacts(task):
            phi = self._patience(contact, task, own_time)
            if self._hearing.is_on(contact, now) and not self._hearing.heard_until(contact, now - phi):
                ends = self._hearing.beginning(contact) + phi
                earliest = ends if ends < earliest else earliest  # no time, erratum 10 read literally, is no less
        return earliest - SLACK

    @staticmethod
    def _pace(one: Motivation, moment: Moment, pace: Pace) -> Pace:
        if one.active_since is not None:
            return Pace.WORKING
        return Pace.WAITING if moment.waiting else pace

    def _patience(self, contact: Contact, task: str, own_time: float) -> float:
        if not self._learns:
            return self._parameters.for_set(task).patience
        their_time = self._knowledge.time_of(contact.robot, task)
        return equations.patience(self._parameters.strategy, own_time, own_time if their_time is None else their_time)

    def _slow_rate(self, task: str, phi: float) -> float:
        if not self._learns:
            return self._parameters.for_set(task).slow_rate
        return equations.slow_rate(self._parameters.threshold, phi)

    def _patience_with_oneself(self, task: str, own_time: float, best_time: float) -> tuple[float, float]:
        """The times psi and lambda, in seconds."""
        parameters = self._parameters
        if not self._learns:
            by_hand = parameters.for_set(task)
            return by_hand.yield_time, by_hand.give_up_time
        give_up = equations.give_up_time(parameters.give_up_factor, own_time) if self._gives_up else math.inf
        return equations.yield_time(parameters.strategy, own_time, best_time), give_up

    def _reset(self, one: Motivation, moment: Moment) -> int:
        if one.active_since is not None and not self._reset_on_active:
            return 1
        return equations.impatience_reset(self._hearing.any_news(one.task, moment.before, moment.now))

    def _influence(self, one: Motivation, moment: Moment, category: int) -> int:
        if not self._learns or (one.active_since is not None and not self.influence_on_active):
            return 1
        return equations.learned_robot_influence(moment.boredom, self._parameters.boredom_threshold, category)
