"""What the fixture `lalliance_mission` gives a test: a way to start missions, which are ended with the test."""

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from lalliance_agents.config import Mission
from lalliance_testing.asking import check_seed, check_speed
from lalliance_testing.blame import blames_its_caller
from lalliance_testing.engine import Engine
from lalliance_testing.running import RunningMission
from lalliance_testing.story import tell
from mission_control.missions import load


@dataclass(frozen=True, slots=True)
class Settings:
    """What a test and the command line ask of its missions.

    Attributes:
        engine: what moves them: `real` or `simulated`.
        asked_speed: the speed that the test asks for.
        speed: the speed that the command line asks for, which counts more.
        seed: the seed that the command line asks for, which counts more than others.
        folder: where missions given as text are written to.
        beside: where mission files are looked for first.
    """

    engine: str
    asked_speed: float
    speed: float | None
    seed: int | None
    folder: Path
    beside: Path


class Launch:
    """Starts the missions of one test.

    Args:
        settings: what is asked of them.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._missions: list[tuple[RunningMission, Path]] = []

    def __repr__(self) -> str:
        return f"<Launch of {self._settings.engine} missions: {len(self._missions)}>"

    @property
    def engine(self) -> str:
        """What moves the missions of this test: `real` or `simulated`."""
        return self._settings.engine

    @blames_its_caller
    def __call__(
        self,
        mission: str | Path,
        *,
        speed: float | None = None,
        seed: int | None = None,
        may_not_fire: Iterable[str] = (),
    ) -> RunningMission:
        """Start a mission; it runs, and its first trial has begun, when this returns.

        Args:
            mission: the path of a mission file, relative to the test's own file or to the current directory; or its text.
            speed: mission seconds per real second; None: what the marker says.
            seed: in the place of the mission's own.
            may_not_fire: faults of the file that may end without having fired: their names, as `1-crash`, or their texts.

        Raises:
            UserError: it is no mission that can be run.
            LallianceError: it could not be brought to run.
        """
        settings = self._settings
        path = self._find(mission)
        loaded = load(path, for_team=settings.engine == "real")
        chosen = settings.seed if settings.seed is not None else seed
        if chosen is not None:
            loaded = loaded.model_copy(update={"seed": check_seed(chosen)})
        speed = settings.speed or check_speed(settings.asked_speed if speed is None else speed)
        running = RunningMission(loaded, _engine(settings.engine, path, loaded, speed), settings.engine, speed)
        running.excuse(may_not_fire)
        self._missions.append((running, path))
        running.start()
        return running

    def _find(self, mission: str | Path) -> Path:
        if isinstance(mission, str) and "\n" in mission:
            path = self._settings.folder / f"mission-{len(self._missions) + 1}.yaml"
            path.write_text(mission)
            return path
        beside = self._settings.beside / mission
        return beside if beside.exists() else Path(mission)

    def settle(self) -> str | None:
        """Judge the missions that the test did not finish; what is wrong, in a sentence."""
        return "; ".join(wrong for running, _ in self._missions if (wrong := running.settle()) is not None) or None

    def stories(self, nodeid: str) -> list[tuple[str, str]]:
        """For the report of a failed test: of each mission a title, and what happened."""
        return [tell(running, path, nodeid) for running, path in self._missions]

    def close(self) -> None:
        """End all missions, whatever comes in between."""
        with ExitStack() as all_of_them:
            for running, _ in self._missions:
                all_of_them.callback(running.close)


def _engine(kind: str, path: Path, mission: Mission, speed: float) -> Engine:
    if kind == "simulated":
        from lalliance_testing.twin import Twin  # noqa: PLC0415 - neither engine needs what the other one is made of

        return Twin(mission)
    from lalliance_testing.real import Real  # noqa: PLC0415 - the same

    return Real(path, mission, speed)
