"""Whether a folder holds the keys of everybody in a mission."""

from pathlib import Path

from lalliance_agents.bus.credentials import ROUTER, KeysError, credentials_in
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import OPERATOR, WORLD
from mission_control.shell import credentials_from


def check_team(keys: Path, path: Path, mission: Mission, *, with_router: bool = True) -> None:
    """Make sure that all processes of a mission can show who they are.

    Args:
        keys: the folder of keys.
        path: the mission's file.
        mission: what it says.
        with_router: whether there is to be a router too.

    Raises:
        KeysError: one of them cannot.
    """
    if not keys.is_dir():
        raise KeysError(
            f"{keys}: no such folder; expected the keys of this team: lalliance keys init {path} --keys {keys}"
        )
    strangers = [robot for robot in mission.robots if not credentials_in(keys, robot).folder.is_dir()]
    if strangers:
        raise KeysError(
            f"{keys}: these keys were made for another team, without {', '.join(strangers)} of {path}; "
            f"expected new ones, once these are moved away: lalliance keys init {path} --keys {keys}"
        )
    for name in (*([ROUTER] if with_router else []), WORLD, OPERATOR, *mission.robots):
        credentials_from(keys, name)
