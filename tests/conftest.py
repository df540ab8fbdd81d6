"""Which event loop a test runs in: one with virtual time if it asks for it, else a real one."""

import asyncio
import os
import signal
from collections.abc import Callable, Mapping

import pytest
from support.virtual_time import VirtualTimeLoop

#: These need a docker daemon and what `with_docker.sh` tells of it.
collect_ignore = [] if "DAEMON_PID" in os.environ else ["compose"]


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    if item.get_closest_marker("virtual_time"):
        return {"virtual": VirtualTimeLoop}
    return {"real": asyncio.new_event_loop}


def pytest_configure() -> None:
    """Tests send SIGINT to processes, which would ignore it as whoever started pytest in the background had it do."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
