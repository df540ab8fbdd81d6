"""The mind of one robot: events in, commands out.

A driver hands in what the robot perceives (`handle`) and calls `tick` once per control period. A tick computes the factors
of every behaviour set, lets motivations grow or fall, stops the active set or starts one, and says what to broadcast. All
that is decided carries the factors behind it. Sets are suppressed by the set that was active when the tick began, so a robot
that stops one task begins to want another from the next tick on.

Most ticks change nothing but ramps. A driver that wants to save them asks after a tick when the next one is needed: at the
first instant of its grid that is not before `wake`, unless an event comes first, and at the first not before `next_lapse`.
In between it says with `rest` which instants it left out, and lets the mind `beat` where an announcement is due. All that
the mind decides and says is then the same, to the last bit.
"""

import math
from collections.abc import Callable, Collection, Sequence

from lalliance_agents.model import equations
from lalliance_agents.model.appraisal import Appraisal, Moment
from lalliance_agents.model.cadence import Cadence
from lalliance_agents.model.events import (
    OCCASIONS,
    REASONS_TO_STOP,
    Activate,
    Announce,
    BodyFailed,
    Cause,
    Command,
    Deactivate,
    Decision,
    Event,
    Factors,
    Heard,
    Pace,
    RosterKnown,
    Sensed,
    Terms,
    TrialStarted,
)
from lalliance_agents.model.hearing import Hearing
from lalliance_agents.model.knowledge import Knowledge
from lalliance_agents.model.listening import Listener, News
from lalliance_agents.model.motivation import Motivation
from lalliance_agents.model.outlook import AT_ONCE, Outlook
from lalliance_agents.model.parameters import EARLY, SLACK, Architecture, Erratum, Learning, Parameters


class Mind:
    """L-ALLIANCE for one robot.

    Args:
        me: the robot's name.
        tasks: the tasks it can do, in the mission's order, which breaks ties.
        parameters: its parameters.
        now: the instant of its birth.
        draw: source of numbers in [0, 1); the model has no other randomness.
    """

    def __init__(
        self, me: str, tasks: Sequence[str], parameters: Parameters, *, now: float, draw: Callable[[], float]
    ) -> None:
        self.me = me
        self.parameters = parameters
        self._terms = Terms.of(parameters)
        self.knowledge = Knowledge(me, tasks, parameters)
        self.hearing = Hearing(
            parameters.silence_timeout,
            closed=not parameters.is_literal(Erratum.WINDOW_ENDS),
            per_attempt=not parameters.is_literal(Erratum.SECOND_PATIENCE),
        )
        self._appraisal = Appraisal(parameters, self.knowledge, self.hearing)
        self._draw = draw
        self._sets = {task: Motivation(task, 0.0) for task in tasks}
        self._listener = Listener(me, self._sets, self.hearing, self.knowledge)
        self._learns = parameters.architecture is Architecture.L_ALLIANCE
        self._boredom_rate = parameters.effective_boredom_rate
        self.cadence = Cadence(parameters.broadcast_period, now)
        self._roster: frozenset[str] | None = None
        self._before = now
        self._pending: list[Command] = []
        self._many = parameters.is_literal(Erratum.ONE_ACTIVE)
        # Where motivation 0 is below the threshold, a set that is suppressed is 0 whatever else speaks for or against it.
        self._suppresses = not (self._many or equations.reaches(0.0, parameters.threshold))
        self._moment: Moment | None = None
        self._beats = not parameters.is_literal(Erratum.IDLE_HEARTBEAT)
        self._collisions = not parameters.is_literal(Erratum.COLLISION)
        self._bored_at_work = parameters.is_literal(Erratum.BOREDOM_AT_WORK) and len(self._sets) == 1
        self._outlook = Outlook(parameters, self._appraisal, self.hearing, len(self._sets))
        self._wake: float | None = AT_ONCE
        self._begin_trial(Learning.ADAPTIVE, now)

    def __repr__(self) -> str:
        return f"<Mind {self.me}: {', '.join(self.active) or 'idle'}, {len(self._sets)} sets>"

    def _begin_trial(self, learning: Learning, now: float) -> None:
        for one in self._sets.values():
            if one.active:
                factors = self._appraise(one, self._moment_at(now, self._before, self.active), suppressed=False)
                one.factors = factors.having(one.value(now))
                self._pending.append(Deactivate(self._stop(one, now, Cause.NEW_TRIAL, None)))
            self._sets[one.task] = Motivation(one.task, self._draw(), since=now)
            self.knowledge.monitors[one.task].new_trial()
        self.hearing.forget()
        self._learning = learning
        self._born = now
        self._waiting = self._beats
        self._idle_since = now

    @property
    def active(self) -> list[str]:
        """The tasks whose sets are active: at most one, unless erratum 5 is read literally."""
        return [task for task, one in self._sets.items() if one.active_since is not None]

    def factors(self) -> dict[str, Factors]:
        """What produced each motivation at the last tick; of sets that could not but be 0, looked up only now."""
        if self._moment is None:
            return {}
        busy = bool(self.active)
        return {
            task: one.factors or self._appraise(one, self._moment, suppressed=busy) for task, one in self._sets.items()
        }

    def handle(self, event: Event, now: float) -> None:
        """Take in what was perceived at `now`; what follows from it is decided at the next tick."""
        learned = self.knowledge.version
        match event:
            case Heard():
                told = self._listener.hear(event, now)
                if told is not News.NONE:
                    may_matter = told is News.SOME and self._task_alone() is None
                    self._heed(may_matter or self.knowledge.version != learned)
            case Sensed() if event.task in self._sets:
                alone = self._task_alone()
                own_time = None if alone is None else self.knowledge.own_time(alone)
                self._sense(event, self._sets[event.task], now)
                self._heed(alone is None or alone == event.task or self.knowledge.own_time(alone) != own_time)
            case BodyFailed() if event.task in self._sets:
                self._sets[event.task].body_failed = self._sets[event.task].active
                self._heed(True)
            case TrialStarted():
                self._begin_trial(event.learning, now)
                self._heed(True)
            case RosterKnown():
                self._roster = event.robots - {self.me}
                self._heed(True)

    def _task_alone(self) -> str | None:
        """The task that this robot works on, if nothing that happens elsewhere can change what it does there."""
        one = self._at_work()
        if one is None or not self._suppresses or self._appraisal.influence_on_active:
            return None
        return one.task if self._appraisal.contender(one.task) is None else None

    def _at_work(self) -> Motivation | None:
        """The first set that is active."""
        return next((one for one in self._sets.values() if one.active_since is not None), None)

    def _heed(self, at_once: bool) -> None:
        """Something was perceived: a step is wanted at once, or, as nothing follows from it, when an attempt is judged."""
        if at_once or self._wake is None:
            self._wake = AT_ONCE
        elif self._wake > AT_ONCE:
            self._wake = min(self._wake, self.knowledge.settles_at() - EARLY)

    def is_refresh(self, event: Heard, now: float) -> bool:
        """Whether what is heard at `now` only goes on with what was heard before, so that `wake` stays as it is.

        It does if the teammate is not held to be silent, its last message was about the same task (or, like this one, none
        that this robot can do), and, on a task, it expects the same time and the monitor takes it for the same attempt.

        A run is a refresh and the messages after it of the same teammate, task, attempt and expected time, as long as none
        says to be active for less long than the one before, and none was under way for longer than tau. To hand in the last
        of a run alone, with the instant of its arrival, leaves the mind as if all had been handed in: provided it is done
        before any tick, before any other event but what other teammates say, and before `next_lapse` is believed.
        """
        return self._listener.is_refresh(event, now)

    def _sense(self, event: Sensed, one: Motivation, now: float) -> None:
        monitor = self.knowledge.monitors[event.task]
        if event.complete and not one.complete:
            monitor.completed(now)
        elif not event.applicable and one.applicable:
            monitor.interrupted(now)
        if event.complete != one.complete:
            self.hearing.watch(event.task, on=not event.complete)
        one.complete, one.applicable = event.complete, event.applicable

    def tick(self, now: float) -> list[Command]:
        """One control step; `now` never falls. Returns what the body and the radio are to do, in order."""
        before, self._before = self._before, now
        self.hearing.note_lapses(now)
        for monitor in self.knowledge.monitors.values():
            monitor.settle(now)
        commands, self._pending = self._pending, []
        working = self.active
        moment = self._moment = self._moment_at(now, before, working)
        for one in self._sets.values():
            if self._suppresses and one.active_since is None and (working or one.sensory_feedback == 0):
                one.keep_down(now)
                continue
            suppressed = bool(working) and working != [one.task]
            factors = self._appraise(one, moment, suppressed=suppressed)
            if one.active_since is not None:
                one.factors = factors.having(one.value(now))
                commands += self._continue(one, now)
            else:
                self._grow(one, factors, moment)
        activations = self._activate(now)
        any_news = self.hearing.note_checked()
        undecided = activations and self._task_alone() is None
        self._wake = AT_ONCE if commands or undecided or any_news or self._outlook.restless else None
        return commands + activations + self._announce(now, before, urgent=bool(activations))

    def wake(self) -> float:
        """The instant before which no tick would decide or change anything, but for silences; in seconds.

        A tick before it would let ramps grow and announce what is due, no more; it may be early, and a tick then does no
        harm. Minus infinity asks for the next step of the grid, infinity for none. It holds after a tick until an event is
        handled that is no refresh (`is_refresh`), which may make it earlier: minus infinity, if what was perceived can
        change what the next step decides. Learned times are not to be restored in between.
        """
        if self._wake is None:
            self._wake = self._foresee(self._before) - EARLY
        return self._wake

    def _foresee(self, now: float) -> float:
        changes = [self.knowledge.settles_at()]
        if self._waiting:
            changes.append(self._born + self.parameters.silence_timeout)
        elif not self.active:
            rate, threshold = self._boredom_rate, self.parameters.boredom_threshold
            if not equations.reaches(equations.boredom(rate, now - self._idle_since), threshold):
                changes.append(equations.ramp_reaches(0.0, self._idle_since, rate, threshold))
        working = self.active if self._suppresses else []
        changes += [self._outlook.next_change(self._sets[task], now) for task in working or self._sets]
        return min(changes, default=math.inf)

    def next_lapse(self, heeded: Collection[str] = ()) -> float:
        """The earliest instant at which a tick may find somebody silent that was not; cheap, and moved by each message.

        It may be early, never late, for what has been handed in; see `is_refresh` for what may be held back till now.

        Args:
            heeded: teammates of whom the driver knows that they go on with what they said last.
        """
        return self.hearing.next_lapse(heeded)

    def rest(self, until: float) -> None:
        """The steps up to and including `until`, at which nothing was to be done, were left out; none is undone."""
        self._before = max(self._before, until)
        self.hearing.note_checked(until)

    def _moment_at(self, now: float, before: float, working: list[str]) -> Moment:
        if self._waiting and self._roster_heard(now):
            self._waiting = False
            self._idle_since = before
        idle = self._bored_at_work or not working
        idle_for = now - self._idle_since if idle and not self._waiting else 0.0
        bored = equations.boredom(self._boredom_rate, idle_for)
        return Moment(now, before, self.hearing.present(now), bored, self._waiting)

    def _roster_heard(self, now: float) -> bool:
        """Erratum 4: the roster was heard, or one tau has passed."""
        if self._roster is not None and self.hearing.has_heard(self._roster):
            return True
        return equations.reaches(now - self._born, self.parameters.silence_timeout)

    def _appraise(self, one: Motivation, moment: Moment, *, suppressed: bool) -> Factors:
        if self._learns and self._learning is Learning.ACTIVE:
            return self._appraisal.learning(one, moment, suppressed=suppressed)
        return self._appraisal.adaptive(one, moment, suppressed=suppressed)

    def _grow(self, one: Motivation, factors: Factors, moment: Moment) -> None:
        """m_ij(t) of a set that is not active."""
        one.grow(0.0 if moment.waiting else factors.rate, moment.before)
        increment = one.rate * (moment.now - one.since)
        if factors.pace is Pace.RANDOM and factors.is_open:
            increment = self.parameters.threshold * self._draw()
        value = equations.motivation(
            one.base,
            increment,
            factors.sensory_feedback,
            factors.activity_suppression,
            factors.impatience_reset,
            factors.acquiescence,
            factors.learned_robot_influence,
        )
        if value <= 0.0 or factors.pace is Pace.RANDOM:
            one.hold(value, moment.now)
        one.factors = factors if value == 0.0 else factors.having(value)

    def _continue(self, one: Motivation, now: float) -> list[Command]:
        """Let the active set go on, or stop it."""
        cause, other = self._reason_to_stop(one, now)
        return [] if cause is None else [Deactivate(self._stop(one, now, cause, other))]

    def _reason_to_stop(self, one: Motivation, now: float) -> tuple[Cause | None, str | None]:
        factors = one.factors
        assert factors is not None  # noqa: S101 - set by `tick` just before
        rival = self._appraisal.rival(one, self.me, now) if self._collisions else None
        contender = self._appraisal.contender(one.task)
        # Acquiescence with no limit to an attempt is 0 only because of the contender.
        yields = equations.acquiescence(one.active_for(now), factors.psi, contender is not None, math.inf) == 0
        if factors.is_open and not (one.complete or one.body_failed or yields or rival is not None):
            return None, None
        reason = equations.reason_to_stop(
            one.complete,
            factors.sensory_feedback,
            one.body_failed,
            rival is not None,
            yields,
            factors.acquiescence,
            factors.impatience_reset,
            factors.learned_robot_influence,
            factors.activity_suppression,
        )
        others = {Cause.COLLISION: rival, Cause.CONTENDER: contender, Cause.RESET: contender}
        cause = REASONS_TO_STOP[reason]
        return cause, others.get(cause)

    def _stop(self, one: Motivation, now: float, cause: Cause, other: str | None) -> Decision:
        decision = self._decision(one, now, cause, other)
        if cause is not Cause.SENSED:
            self.knowledge.monitors[one.task].ceased(now, failed=not cause.is_blameless)
        one.deactivate(now)
        one.factors = decision.factors.having(0.0)
        if not self._bored_at_work:
            self._idle_since = now
        return decision

    def _decision(self, one: Motivation, now: float, cause: Cause, other: str | None) -> Decision:
        factors = one.factors
        assert factors is not None  # noqa: S101 - a set is appraised before anything is decided about it
        teammates = self._appraisal.teammates(one.task, now)
        steadily = not one.active and factors.pace is not Pace.RANDOM
        grown_for = now - one.rose_at if steadily else 0.0
        expected = one.expected if one.active else self._appraisal.expected_time(one.task)
        behind = factors, teammates, self._terms, one.active_for(now), other, grown_for, expected
        return Decision(now, cause.verb, one.task, cause, *behind)

    def _activate(self, now: float) -> list[Command]:
        """Erratum 5: incumbent first, then the highest motivation, then the lowest task index."""
        theta = self.parameters.threshold
        if not self._many and self.active:
            return []
        ready = [
            one for one in self._sets.values() if one.active_since is None and equations.reaches(one.value(now), theta)
        ]
        if not self._many:
            if not ready:
                return []
            highest = max(one.value(now) for one in ready)
            ready = [next(one for one in ready if one.value(now) >= highest - SLACK)]
            for one in self._sets.values():
                if one is not ready[0]:
                    one.hold(0.0, now)
        return [Activate(self._start(one, now)) for one in ready]

    def _start(self, one: Motivation, now: float) -> Decision:
        cause, other = self._occasion(one.task, now)
        decision = self._decision(one, now, cause, other)
        one.activate(now, self._appraisal.expected_time(one.task))
        self.knowledge.monitors[one.task].began(now)
        return decision

    def _occasion(self, task: str, now: float) -> tuple[Cause, str | None]:
        """Whose task this was, and why it can be taken."""
        teammates = self._appraisal.teammates(task, now)
        if not teammates:
            return Cause.FREE, None
        latest = teammates[0]
        return OCCASIONS[equations.occasion(latest.lapsed_at is not None, latest.present)], latest.robot

    def beat(self, now: float) -> list[Announce]:
        """A step at `now` that does no more than a tick with nothing to decide: announce what is due."""
        before, self._before = self._before, now
        self.hearing.note_checked(now)
        return self._announce(now, before, urgent=False)

    def announcement(self, now: float) -> list[Announce]:
        """What there is to announce at `now`: nothing for an idle robot that keeps quiet (IDLE_HEARTBEAT, literal)."""
        one = self._at_work()
        if one is not None:
            return [Announce(one.task, one.active_for(now), one.expected)]
        return [Announce(None)] if self._beats else []

    def _announce(self, now: float, before: float, *, urgent: bool) -> list[Announce]:
        if urgent:
            self.cadence.begin_anew(now)
        elif self.cadence.is_due(now, before):
            self.cadence.keep(now)
        else:
            return []
        return self.announcement(now)
