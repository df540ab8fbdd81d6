"""A mission as one frozen record: its tasks, its team, the parameters, the phases and the faults.

This is what a mission file says, after checking. Everything that can be judged from the mission alone is judged here,
once, when the record is built; whoever holds a `Mission` need not check again. An error that belongs to one place of
the file carries the path of that place (`misplaced`), so that `mission_file` can name the line. What the environment
makes of its own options is checked by the environment.
"""

import json
from collections.abc import Iterator, Sequence
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, GetPydanticSchema, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError, core_schema, to_json

from lalliance_agents.errors import exact
from lalliance_agents.fault_checks import contradiction, ends_work, misfit
from lalliance_agents.faults import AnyFault, Fault, describe, robot_of
from lalliance_agents.model.parameters import Architecture, Learning, NotNegative, Parameters, Positive, Record
from lalliance_agents.suggestions import like_or_any
from lalliance_agents.wire.keys import NAME_PATTERN

_DOTTED = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*"
FACTORY_PATTERN = f"^{_DOTTED}:{_DOTTED}$"
ENVIRONMENT_PATTERN = f"^{_DOTTED}(:{_DOTTED})?$"

Name = Annotated[str, Field(pattern=NAME_PATTERN)]
"""Robots, tasks and missions: 1 to 64 of A-Z a-z 0-9 _ -, because they become chunks of keys."""


def misplaced(path: Sequence[str | int], message: str, errors: Sequence[ErrorDetails] = ()) -> PydanticCustomError:
    """An error that a validator of the whole mission found at the place `path` of the file.

    Args:
        path: fields, names and indices from the top of the file.
        message: what is wrong there.
        errors: the errors of a record that was checked there on its own, with places counted from `path`; where they
            are given, they say more than `message`.
    """
    return PydanticCustomError("misplaced", "{message}", {"message": message, "path": list(path), "errors": errors})


_EMPTY_MEANS_DEFAULTS = GetPydanticSchema(
    lambda record, handler: core_schema.no_info_after_validator_function(
        lambda value: record() if value is None else value, core_schema.nullable_schema(handler(record))
    )
)


class EnvironmentChoice(Record):
    """Which environment the mission takes place in; further fields are that environment's own options."""

    model_config = ConfigDict(extra="allow")

    kind: Annotated[str, Field(pattern=ENVIRONMENT_PATTERN)] = "task_pool"
    """`task_pool`, `box_pushing`, or `package.module:Class` for an environment of one's own."""

    @property
    def options(self) -> dict[str, Any]:
        """What the mission says for the environment itself to check."""
        return dict(self.model_extra or {})


class TaskSpec(Record):
    """One task of the mission."""

    after: tuple[Name, ...] = ()
    """Tasks that must be complete before this one can be worked on."""
    arrives: NotNegative = 0.0
    """When the task comes into being, in seconds after the trial's start."""


class RobotSpec(Record):
    """One robot of the team."""

    tasks: Annotated[dict[Name, Positive], Field(min_length=1)]
    """The tasks it can do, each with the time it needs alone, in seconds."""
    joins: NotNegative = 0.0
    """When its process is started, in seconds after the live trial's start; 0: from the beginning."""
    behaviors: Annotated[str, Field(pattern=FACTORY_PATTERN)] | None = None
    """`package.module:factory` of behaviour sets of one's own; the default lets the world's body do the work."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Parameters in which this robot differs from the team, spelled as in a mission file."""


class Phase(Record):
    """A row of trials of the mission with one way of learning."""

    learning: Learning = Learning.ADAPTIVE
    """`active`: a training mission, tasks chosen at random; `adaptive`: a live one."""
    trials: Annotated[int, Field(ge=1, le=10_000)] = 1
    """How often the mission is repeated."""
    until: Literal["full"] | None = None
    """`full`: ends before `trials` are over as soon as every robot's monitors are full; only for active learning."""

    @model_validator(mode="after")
    def _check_until(self) -> Self:
        if self.until and self.learning is not Learning.ACTIVE:
            raise ValueError(
                f"until: full needs learning: active, robots that are {self.learning} need not try all tasks"
            )
        return self


class Mission(Record):
    """Everything a mission file says."""

    name: Name
    """The mission's name; it is the first chunk of all its keys."""
    environment: EnvironmentChoice = EnvironmentChoice()
    """What the tasks are made of."""
    tasks: Annotated[dict[Name, Annotated[TaskSpec, _EMPTY_MEANS_DEFAULTS]], Field(min_length=1)]
    """The tasks, in the order that breaks ties; nothing after a task's name means its defaults."""
    robots: Annotated[dict[Name, RobotSpec], Field(min_length=1)]
    """The team."""
    parameters: Parameters = Parameters()
    """Parameters of every robot."""
    phases: Annotated[tuple[Phase, ...], Field(min_length=1)] = (Phase(),)
    """Trials, one phase after the other; the last trial of all is the live one: its time is the makespan."""
    faults: tuple[AnyFault, ...] = ()
    """Faults of the live trial."""
    knowledge: Literal["none", "given"] = "none"
    """What robots know before the first trial: nothing, or the true times of all who share their tasks."""
    control_period: Annotated[float, Field(ge=0.001, le=10, allow_inf_nan=False)] = 0.1
    """Time between two control steps of a robot, in seconds."""
    deadline: Positive = 600.0
    """A trial that is not complete after this many seconds has failed."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """All that is drawn in a run comes from this number; how the processes' times interleave does not."""

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        self._check_tasks()
        self._check_abilities()
        self._check_instants()
        self._check_rates()
        self._check_by_hand()
        self._check_faults()
        self._check_live_trial()
        return self

    def _check_tasks(self) -> None:
        for name, task in self.tasks.items():
            for index, needed in enumerate(task.after):
                if needed not in self.tasks:
                    raise misplaced(
                        ("tasks", name, "after", index),
                        f"{needed!r} is not a task of this mission{like_or_any(needed, self.tasks)}",
                    )
                if needed in task.after[:index]:
                    raise misplaced(("tasks", name, "after", index), f"{needed!r} is listed twice; expected it once")
        try:
            TopologicalSorter({name: task.after for name, task in self.tasks.items()}).prepare()
        except CycleError as error:
            circle = error.args[1][::-1]
            raise misplaced(
                ("tasks", circle[0], "after"), f"the prerequisites form a circle: {' after '.join(circle)}"
            ) from None

    def _check_abilities(self) -> None:
        for name, robot in self.robots.items():
            for task in robot.tasks:
                if task not in self.tasks:
                    raise misplaced(
                        ("robots", name, "tasks", task),
                        f"{task!r} is not a task of this mission{like_or_any(task, self.tasks)}",
                    )
        for task in self.tasks:
            if not self.able(task):
                raise misplaced(("tasks", task), "no robot can do this task; expected at least one robot that lists it")

    def _check_instants(self) -> None:
        for name, task in self.tasks.items():
            self._check_before_deadline(task.arrives, ("tasks", name, "arrives"))
        for name, robot in self.robots.items():
            self._check_before_deadline(robot.joins, ("robots", name, "joins"))

    def _check_before_deadline(self, instant: float, path: tuple[str | int, ...]) -> None:
        if instant >= self.deadline:
            raise misplaced(
                path,
                f"{exact(instant)} s is not before the mission's deadline; expected less than {exact(self.deadline)} s",
            )

    def _check_rates(self) -> None:
        for name in self.robots:
            own = self.parameters_of(name)
            if own.broadcast_period < self.control_period * (1 - 1e-9):
                raise misplaced(
                    self._where(name, "broadcast_rate"),
                    f"robot {name} cannot send {exact(own.broadcast_rate)} messages/s with a control_period of "
                    f"{exact(self.control_period)} s; expected at most {1 / self.control_period:g}",
                )
            for teammate in self.teammates(name):
                theirs = self.parameters_of(teammate)
                if own.silence_timeout <= 2 * theirs.broadcast_period:
                    raise misplaced(
                        self._where(name, "silence_timeout"),
                        f"silence_timeout {own.silence_timeout:g} s of robot {name} must be longer than two broadcast "
                        f"periods of {teammate}, 2/broadcast_rate = {2 * theirs.broadcast_period:g} s",
                    )

    def _where(self, robot: str, field: str) -> tuple[str, ...]:
        own = self.robots[robot].parameters
        return ("robots", robot, "parameters", field) if field in own else ("parameters", field)

    def _check_by_hand(self) -> None:
        for name in self.robots:
            for task in self.parameters_of(name).by_hand_tasks:
                if task not in self.tasks:
                    raise misplaced(
                        (*self._where(name, "by_hand_tasks"), task),
                        f"{task!r} is not a task of this mission{like_or_any(task, self.tasks)}",
                    )

    def _check_faults(self) -> None:
        for index, fault in enumerate(self.faults):
            wrong = self.misfit(fault)
            if wrong is not None:
                raise misplaced(("faults", index, *wrong[0]), wrong[1])
            self._check_before_deadline(fault.at, ("faults", index, "at"))
            self._check_before_deadline(fault.until or 0.0, ("faults", index, "until"))
        for index, fault in enumerate(self.faults):
            for number, earlier in enumerate(self.faults[:index]):
                against = contradiction(fault, earlier, self.robots)
                if against is not None:
                    raise misplaced(("faults", index), f"{against} (see faults.{number})")

    def misfit(self, fault: Fault) -> tuple[tuple[str | int, ...], str] | None:
        """What of a fault does not fit this mission, and where in the fault; None if it fits."""
        wrong = misfit(fault, self.robots, lambda robot: self.robots[robot].tasks)
        robot = robot_of(fault)
        if wrong is None and robot is not None and fault.at < (joins := self.robots[robot].joins):
            sentence = (
                f"at {exact(fault.at)} s robot {robot} is not there; expected not before it joins, {exact(joins)} s"
            )
            return ("at",), sentence
        return wrong

    def _check_live_trial(self) -> None:
        planned = self.faults or any(robot.joins > 0 for robot in self.robots.values())
        if planned and self.live.until and self.live.trials > 1:
            raise misplaced(
                ("phases", len(self.phases) - 1, "until"),
                "faults and joins belong to the last trial, and until: full leaves open which one that is; "
                "expected a further phase after this one",
            )

    def able(self, task: str) -> list[str]:
        """The robots that can do `task`, in the mission's order."""
        return [name for name, robot in self.robots.items() if task in robot.tasks]

    def teammates(self, robot: str) -> list[str]:
        """The other robots that share a task with `robot`, in the mission's order."""
        own = self.robots[robot].tasks.keys()
        return [name for name, other in self.robots.items() if name != robot and own & other.tasks.keys()]

    def parameters_of(self, robot: str) -> Parameters:
        """The parameters in force for `robot`."""
        return self._parameters[robot]

    @cached_property
    def _parameters(self) -> dict[str, Parameters]:
        return {name: self._override(name, spec.parameters) for name, spec in self.robots.items()}

    def _override(self, robot: str, changes: dict[str, Any]) -> Parameters:
        if not changes:
            return self.parameters
        base = self.parameters.model_dump(mode="json", exclude_unset=True)
        try:
            return Parameters.model_validate_json(to_json({**base, **changes}), strict=True)
        except ValidationError as error:
            found: list[ErrorDetails] = json.loads(error.json(include_url=False))
            raise misplaced(("robots", robot, "parameters"), found[0]["msg"], found) from None

    @property
    def live(self) -> Phase:
        """The phase whose last trial is the live one."""
        return self.phases[-1]

    def warnings(self) -> list[str]:
        """Sentences about values that are allowed and probably not meant."""
        found = []
        times = [time for robot in self.robots.values() for time in robot.tasks.values()]
        mean = sum(times) / len(times)
        delay = self.parameters.max_delay
        if self.parameters.architecture is Architecture.L_ALLIANCE and delay > 0.05 * mean:
            value = (
                f"{delay:g} s"
                if "max_delay" in self.parameters.model_fields_set
                else f"not given; the default of {delay:g} s"
            )
            found.append(
                f"parameters.max_delay: {value} is {100 * delay / mean:.0f} % of the mean task time ({mean:.3g} s); above 5 % "
                f"robots spend a noticeable part of the mission waiting; {0.04 * mean:.1g} s is about right"
            )
        if self.parameters.silence_timeout >= self.deadline:
            found.append(
                f"parameters.silence_timeout: with {exact(self.parameters.silence_timeout)} s no failure is noticed before the "
                f"deadline of {exact(self.deadline)} s"
            )
        for task in self.tasks:
            fastest = min(self.robots[robot].tasks[task] for robot in self.able(task))
            if fastest > self.deadline:
                deadline = exact(self.deadline)
                found.append(
                    f"tasks.{task}: its fastest robot needs {exact(fastest)} s, longer than the deadline of {deadline} s"
                )
        return [*found, *self._never_done()]

    def _never_done(self) -> Iterator[str]:
        """Sentences about tasks for which no robot is left, or none is there at first."""
        doomed: dict[str, list[str]] = {}
        for task in self.tasks:
            ends = [self._end_of_work(robot, task) for robot in self.able(task)]
            if None not in ends:
                told = " and ".join(f"{describe(fault)} at {fault.at:g} s" for fault in ends if fault is not None)
                doomed.setdefault(told, []).append(f"tasks.{task}")
            if sum(phase.trials for phase in self.phases) > 1 and all(
                self.robots[robot].joins > 0 for robot in self.able(task)
            ):
                yield f"tasks.{task}: its robots join in the last trial; those before it cannot complete"
        for told, tasks in doomed.items():
            yield (
                f"{', '.join(tasks)}: no robot is left for it after {told}; if it is still open then, the mission is not "
                "expected to complete"
            )

    def _end_of_work(self, robot: str, task: str) -> Fault | None:
        """The fault from which on `robot` does not work on `task` any more, if there is one."""
        ending = [fault for fault in self.faults if robot_of(fault) == robot and ends_work(fault, task)]
        return min(ending, key=lambda fault: fault.at, default=None)
