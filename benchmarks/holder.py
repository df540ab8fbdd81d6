"""A process that holds a presence of Zenoh's own (a liveliness token), and does nothing else.

    python benchmarks/holder.py ENDPOINT PARENT LEASE KEY

After a silence of LEASE seconds the router takes the process to be gone. `failover.py` starts it.
"""

import json
import signal
import sys
from typing import Any

import zenoh

from lalliance_agents.bus.session import client_settings
from lalliance_agents.lineage import end_with_parent


def hold(endpoint: str, lease: float, key: str) -> None:
    """Be present until killed."""
    settings: dict[str, Any] = client_settings(endpoint, 5.0)
    settings["transport"]["link"]["tx"]["lease"] = round(lease * 1000)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:
        token = session.liveliness().declare_token(key)
        signal.pause()
        del token


if __name__ == "__main__":
    end_with_parent(int(sys.argv[2]))
    hold(sys.argv[1], float(sys.argv[3]), sys.argv[4])
