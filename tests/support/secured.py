"""Keys for tests, good and bad."""

import datetime
from collections.abc import Sequence
from pathlib import Path

from mission_control.deploy.authority import Validity, make_keys
from mission_control.deploy.keys_command import HOSTS


def new_keys(
    folder: Path, *robots: str, hosts: Sequence[str] = (), since: float = -86400.0, until: float = 86400.0
) -> Path:
    """Keys of a team, valid from `since` until `until`, in seconds from now."""
    now = datetime.datetime.now(datetime.UTC)
    instants = (now + datetime.timedelta(seconds=seconds) for seconds in (since, until))
    make_keys(folder, robots, [*HOSTS, *hosts], Validity(*instants))
    return folder
