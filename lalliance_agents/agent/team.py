"""Whom the robot listens to: teammates that share a task with it, and which tasks those are."""


class Team:
    """The teammates one robot knows of.

    Args:
        me: the robot itself.
        tasks: the tasks it can do.
        most: the number of teammates from which on no stranger is taken in.
    """

    def __init__(self, me: str, tasks: frozenset[str], most: int) -> None:
        self._me = me
        self._tasks = tasks
        self._most = most
        #: Teammate -> the tasks it shares with this robot.
        self.abilities: dict[str, frozenset[str]] = {}

    def meet(self, robot: str, tasks: frozenset[str]) -> None:
        """Remember that `robot` can do `tasks`."""
        if robot != self._me:
            self.abilities[robot] = tasks & self._tasks

    def knows(self, robot: str) -> bool:
        """Whether `robot` is a teammate."""
        return robot in self.abilities

    @property
    def full(self) -> bool:
        """Whether no further stranger is to become a teammate."""
        return len(self.abilities) >= self._most
