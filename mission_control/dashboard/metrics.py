"""The mission for Prometheus, as it is when somebody asks. Names on the bus become labels, in limited numbers."""

from collections.abc import Callable, Iterable, Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.registry import Collector

from mission_control.dashboard.chronicle import Chronicle
from world_server.world import Stage

#: Robots up to which silence is told of each pair; in a larger team, of each robot as a whole.
PAIRS_UP_TO = 20

Metric = CounterMetricFamily | GaugeMetricFamily
Sample = tuple[tuple[str, ...], float]


class MissionMetrics(Collector):
    """Collects the metrics of one mission.

    Args:
        chronicle: of the mission.
        clock: the present instant on the clock of the sightings, in seconds.
        viewers: how many look at the page.
        missed: how many messages the onlooker could not take.
    """

    def __init__(
        self,
        chronicle: Chronicle,
        clock: Callable[[], float],
        viewers: Callable[[], int],
        missed: Callable[[], int],
    ) -> None:
        self._chronicle = chronicle
        self._clock = clock
        self._viewers = viewers
        self._missed = missed

    def page(self) -> bytes:
        """What Prometheus reads."""
        registry = CollectorRegistry(auto_describe=False)
        registry.register(self)
        return generate_latest(registry)

    def collect(self) -> Iterator[Metric]:
        """All metrics as they are now."""
        yield from self._mission()
        yield from self._robots()
        yield from self._tasks()
        yield _gauge("dashboard_viewers", "Viewers of the page", (), [((), self._viewers())])
        missed = [((), float(self._missed()))]
        yield _counter("onlooker_missed", "Messages that the onlooker could not take", (), missed)

    def _mission(self) -> Iterator[Metric]:
        story, status = self._chronicle.story, self._chronicle.story.status
        stage = status.mission if status else Stage.WAITING.value
        stages = [((one.value,), float(one.value == stage)) for one in Stage]
        yield _gauge("mission_stage", "1 for the stage that the mission is in", ("stage",), stages)
        yield _gauge("mission_trial", "The trial", (), [((), story.trial)])
        elapsed = status.elapsed if status else 0.0
        yield _gauge("mission_elapsed_seconds", "Mission time since the trial began", (), [((), elapsed)])
        yield _gauge("mission_faults", "Faults in force", (), [((), len(story.faults))])
        read = [(pair, float(count)) for pair, count in sorted(story.messages.items())]
        yield _counter("messages", "Messages seen, by kind and by what became of them", ("kind", "verdict"), read)
        taken = [((cause,), float(count)) for cause, count in sorted(self._chronicle.takeovers.items())]
        yield _counter("takeovers", "Takeovers, by cause", ("cause",), taken)

    def _robots(self) -> Iterator[Metric]:
        now, robots = self._clock(), dict(self._chronicle.seen_robots())
        present = [((name,), float(bool(seen.present))) for name, seen in robots.items()]
        yield _gauge("robot_present", "1 while the robot's process is there", ("robot",), present)
        heard = [((name,), max(now - seen.heard_at, 0.0)) for name, seen in robots.items() if seen.heard_at is not None]
        yield _gauge("robot_silence_seconds", "Mission time since the robot was last heard", ("robot",), heard)
        links = {name: seen.link for name, seen in robots.items() if seen.link is not None}
        kept = [((name,), float(link.ticks)) for name, link in links.items()]
        yield _counter("control_periods", "Control steps made", ("robot",), kept)
        lost = [((name,), float(link.missed)) for name, link in links.items()]
        yield _counter("control_periods_missed", "Control periods without a step", ("robot",), lost)
        silences = [
            ((name, mate), one.silence)
            for name, link in links.items()
            for mate, one in link.teammates.items()
            if one.silence is not None and mate in robots
        ]
        if len(robots) <= PAIRS_UP_TO:
            told = "Mission time since the robot last heard the teammate"
            yield _gauge("link_silence_seconds", told, ("robot", "teammate"), silences)
        lapsed = [
            ((name,), float(sum(one.lost_for is not None for one in link.teammates.values())))
            for name, link in links.items()
        ]
        yield _gauge("robot_silent_teammates", "Teammates that the robot takes to have ceased", ("robot",), lapsed)

    def _tasks(self) -> Iterator[Metric]:
        tasks = self._chronicle.story.tasks
        progress = [((name,), task.progress) for name, task in tasks.items()]
        yield _gauge("task_progress", "How far the task is, from 0 to 1", ("task",), progress)
        complete = [((name,), float(task.complete)) for name, task in tasks.items()]
        yield _gauge("task_complete", "1 when the task is complete", ("task",), complete)


def _gauge(name: str, told: str, labels: tuple[str, ...], samples: Iterable[Sample]) -> GaugeMetricFamily:
    family = GaugeMetricFamily(f"lalliance_{name}", told, labels=labels)
    for values, value in samples:
        family.add_metric(values, value)
    return family


def _counter(name: str, told: str, labels: tuple[str, ...], samples: Iterable[Sample]) -> CounterMetricFamily:
    family = CounterMetricFamily(f"lalliance_{name}", told, labels=labels)
    for values, value in samples:
        family.add_metric(values, value)
    return family
