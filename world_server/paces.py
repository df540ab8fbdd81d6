"""Whether the robots' mission time passes as fast as the world's: all are to be started with the same speed.

A robot at another speed misjudges every time that it learns and every silence, and nothing else gives that away. Each message
bears its sender's mission time; how fast it passes is seen in two messages of one life that lie far enough apart. Instants of
two clocks are never compared. Pure: the time comes in.
"""

from lalliance_agents.wire.messages import Message

#: The messages compared are at least so far apart, in mission and in real seconds: a late one then tells little that is wrong.
LEAST_SPAN = 10.0
LEAST_REAL_SPAN = 5.0
#: By which factor paces must differ to be told of.
DIFFERENT = 1.5


class Paces:
    """What was seen of each robot's clock.

    Args:
        speed: the world's mission seconds per real second.
    """

    def __init__(self, speed: float) -> None:
        self._span = max(LEAST_SPAN, LEAST_REAL_SPAN * speed)
        self._first: dict[str, tuple[int, float, float]] = {}
        self._judged: set[tuple[str, int]] = set()

    def different(self, message: Message, now: float) -> float | None:
        """How many times as fast as the world's a sender's time passes: once in each life, if that is not about 1.

        Args:
            message: of a robot of the mission.
            now: the world's mission time at its arrival, in seconds.
        """
        robot, life = message.sender, message.incarnation
        first = self._first.get(robot)
        if first is None or first[0] != life:
            self._first[robot] = life, message.at, now
            return None
        if (robot, life) in self._judged or now - first[2] < self._span:
            return None
        self._judged.add((robot, life))
        pace = (message.at - first[1]) / (now - first[2])
        return None if 1 / DIFFERENT < pace < DIFFERENT else pace
