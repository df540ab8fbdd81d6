"""`lalliance why`: what was decided and why, live or from a recording."""

import json
from collections.abc import AsyncIterator, Iterable
from pathlib import Path

import typer

from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import UserError
from mission_control.reach import reached
from mission_control.watch.absence import told_of_absence
from mission_control.watch.explain import plain, tell, unmoved
from mission_control.watch.happened import Happened
from mission_control.watch.onlooker import Onlooker, look, meet
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story
from mission_control.watch.window import Window
from mission_control.watch.words import printable


class Answer:
    """Prints what is asked about, as sentences or as JSON.

    Args:
        window: what is asked about.
        as_json: one document, or a line each where it goes on.
    """

    def __init__(self, window: Window, *, as_json: bool) -> None:
        self.window = window
        self._as_json = as_json

    def past(self, story: Story, now: str | None, *, goes_on: bool) -> None:
        """Print what has happened so far.

        Args:
            story: the mission as seen so far.
            now: how things stand, in a sentence.
            goes_on: whether more will follow.
        """
        found = self.window.of(story)
        if self._as_json and not goes_on:
            document = {"mission": story.mission, "robot": self.window.robot, "task": self.window.task, "now": now}
            typer.echo(json.dumps({**document, "happened": [plain(one) for one in found]}))
            return
        for one in found:
            self.add(one)
        if self._as_json:
            return
        if not found and not goes_on:
            typer.echo(printable(self._nothing(story)))
        if now is not None:
            typer.echo(printable(now))

    def add(self, one: Happened) -> None:
        """Print something that has just happened."""
        trial = f"trial {one.trial}, " if one.trial > 1 else ""
        typer.echo(json.dumps(plain(one)) if self._as_json else printable(trial + tell(one), LONGEST))

    def _nothing(self, story: Story) -> str:
        who = self.window.robot or "nobody"
        about = f" about {self.window.task}" if self.window.task else ""
        decided = "has decided nothing" if self.window.robot else "has decided anything"
        span = "" if self.window == Window(self.window.robot, self.window.task) else " in that time"
        others = sorted({str(one.robot) for one in story.decisions(task=self.window.task)})
        aside = f"; {', '.join(others)} did" if self.window.task and not span and others else ""
        return f"{who} {decided}{about}{span}{aside}"


#: Letters of a sentence that are printed.
LONGEST = 1000


def from_recording(bag: Path, seen: Iterable[Sighting], answer: Answer) -> None:
    """Answer from the recording at `bag`, in which this was seen.

    Raises:
        UserError: it has no such robot or task.
    """
    story = None
    for sighting in seen:
        if story is None:
            story = Story(sighting.key.partition("/")[2].partition("/")[0])
        story.take(sighting)
    if story is None:
        raise UserError(f"{bag} holds nothing of any mission; expected a recording of `lalliance record`")
    answer.window.check(story)
    answer.past(story, None, goes_on=False)


async def live(mission: str | None, connect: str | None, keys: Path | None, answer: Answer, *, follow: bool) -> None:
    """Answer from a mission that runs, and go on until it is over if that is wanted.

    Raises:
        UserError: there is no such mission, robot or task.
    """
    window = answer.window
    wants_now = window.robot is not None and window.task is not None
    async with (
        reached(mission, connect, keys) as there,
        Onlooker(there.bus, there.mission, MissionClock(), motivations=wants_now) as onlooker,
    ):
        story = Story(there.mission)
        await meet(onlooker, story)
        window.check(story)
        now = await _now(onlooker, story, window) if wants_now else None
        answer.past(story, now, goes_on=follow)
        if follow:
            async with told_of_absence(onlooker, there.endpoint):
                async for one in further(onlooker, story):
                    if window.holds(one):
                        answer.add(one)


async def _now(onlooker: Onlooker, story: Story, window: Window) -> str | None:
    """Why the robot is not on the task just now, if it is not and says so in time."""
    assert window.robot is not None and window.task is not None  # noqa: PT018, S101 - both were asked for
    seen, task = story.robots[window.robot], window.task
    if seen.tasks and task not in seen.tasks:
        return f"{seen.name} cannot do {task}; it can do {', '.join(seen.tasks)}"
    await look(onlooker, story, lambda: seen.motivations is not None or not seen.present)
    if not seen.present:
        return f"{seen.name} is not there now"
    if task in seen.attempts:
        return f"{seen.name} is on {task} now"
    factors = seen.motivations.sets.get(task) if seen.motivations is not None else None
    return None if factors is None else unmoved(seen.name, task, factors, unworkable(story, task))


def unworkable(story: Story, task: str) -> str:
    """Why nobody can work on a task that does not apply, as far as the world says."""
    found = story.tasks.get(task) if story.status is not None else None
    if found is None or (found.applicable and not found.complete):
        return "is complete or cannot be worked on just now"
    return "is complete" if found.complete else "cannot be worked on just now"


async def further(onlooker: Onlooker, story: Story) -> AsyncIterator[Happened]:
    """What happens from now on, until the mission is over."""
    async for sighting in onlooker:
        one = story.take(sighting)
        if one is not None:
            yield one
        if story.status is not None and story.status.mission in {"complete", "failed"}:
            return
