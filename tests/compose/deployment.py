"""A deployment under test: its compose file in the hands of a script that looks at it, breaks it and takes it away again."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
#: Everything may take longer on a busy machine; nothing is waited for longer than it takes.
PATIENCE = 120.0


def docker(*words: str, check: bool = True, timeout: float = PATIENCE) -> str:
    done = subprocess.run(["docker", *words], capture_output=True, text=True, check=False, timeout=timeout)
    assert done.returncode == 0 or not check, f"docker {' '.join(words)}: {done.stdout}{done.stderr}"
    return done.stdout.strip()


def until(condition: Callable[[], Any], what: str | Callable[[], str], *, seconds: float = PATIENCE) -> Any:
    """Look until `condition` gives something; that. If it never does, `what` it was is told."""
    end = time.monotonic() + seconds
    while True:
        if found := condition():
            return found
        assert time.monotonic() < end, f"not within {seconds:g} s: {what if isinstance(what, str) else what()}"
        time.sleep(0.05)


class Deployment:
    """One compose project."""

    def __init__(self, file: Path, keys: Path) -> None:
        self._file = file
        self._environment = {**os.environ, "LALLIANCE_KEYS": str(keys)}
        self._events: list[str] = []
        self._following: subprocess.Popen[str] | None = None

    def state(self) -> str:
        """What there is to see of it, for a person."""
        return self.run("ps", "--all") + self.run("logs", "--no-color", "--tail", "60")

    def take_away(self) -> None:
        """Remove its containers, network and volumes."""
        if self._following is not None:
            self._following.kill()
            self._following.communicate()
        self.run("--profile", "*", "down", "--remove-orphans", "--volumes", "--timeout", "1")

    def run(self, *words: str, timeout: float = PATIENCE) -> str:
        """`docker compose` with `words`, which must succeed; what it printed."""
        done = self.attempt(*words, timeout=timeout)
        assert done.returncode == 0, f"docker compose {' '.join(words)}: {done.stdout}{done.stderr}"
        return done.stdout

    def attempt(self, *words: str, timeout: float = PATIENCE) -> "subprocess.CompletedProcess[str]":
        """`docker compose` with `words`, whatever comes of it."""
        command = ["docker", "compose", "-f", str(self._file), *words]
        return subprocess.run(
            command, capture_output=True, text=True, check=False, env=self._environment, timeout=timeout
        )

    def up(self, mission: str) -> None:
        """Bring it up, with somebody who looks on from the beginning; there are no robots before that."""
        self.run("up", "--detach", "--pull", "never", "--wait", "router")
        program = (ROOT / "tests/support/onlooker.py").read_text()
        words = ["run", "--detach", "--no-deps", "--entrypoint", "python", "operator", "-c", program, mission]
        self._follow(self.run(*words).split()[-1])
        self.wait_for("looking on")
        self.run("up", "--detach", "--pull", "never")

    def _follow(self, container: str) -> None:
        """Have the lines of a container's output collected."""
        command = ["docker", "logs", "--follow", container]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self._following = process

        def collect() -> None:
            assert process.stdout is not None
            for line in process.stdout:
                self._events.append(line.rstrip())

        threading.Thread(target=collect, daemon=True).start()

    def so_far(self) -> int:
        """How many events there were."""
        return len(self._events)

    def happened(self, pattern: str, since: int = 0) -> re.Match[str] | None:
        """The latest event that matches, of those after the first `since`."""
        return next((found for line in reversed(self._events[since:]) if (found := re.search(pattern, line))), None)

    def wait_for(self, pattern: str, since: int = 0) -> "re.Match[str]":
        """Wait for an event that matches, if there was none yet after the first `since`."""
        found: re.Match[str] = until(
            lambda: self.happened(pattern, since), lambda: f"{pattern} in\n{chr(10).join(self._events[-40:])}"
        )
        return found

    def workers(self) -> dict[str, str]:
        """Which robot is on which task, as far as the world has told."""
        on: dict[str, str] = {}
        for line in list(self._events):
            if found := re.search(r"s  (\w+) starts ([\w-]+)", line):
                on[found[1]] = found[2]
            elif found := re.search(r"s  (\w+) (?:yields|is finished with|gives up|is gone)", line):
                on.pop(found[1], None)
        return on

    def is_there(self, robot: str) -> bool:
        """Whether the world has last told that the robot is there."""
        found = self.happened(rf"s  {robot} is (there|gone)")
        return found is not None and found[1] == "there"

    def container(self, service: str) -> str:
        """The id of a service's container."""
        return self.run("ps", "--all", "--quiet", service).strip()

    def facts(self, service: str) -> dict[str, Any]:
        """What docker knows of a service's container."""
        [facts] = json.loads(docker("inspect", self.container(service)))
        found: dict[str, Any] = facts
        return found

    def strike(self, service: str, number: signal.Signals = signal.SIGKILL) -> None:
        """Send a signal to a container's first process as an accident would, not as docker does: its restart policy applies."""
        in_daemon("kill", f"-{number.value}", str(self.facts(service)["State"]["Pid"]))

    def restarted(self, service: str, before: int) -> bool:
        """Whether the container runs again since it was started `before` times again."""
        facts = self.facts(service)
        return bool(facts["State"]["Running"] and facts["RestartCount"] > before)

    @contextlib.contextmanager
    def disconnected(self, service: str) -> Iterator[None]:
        """Take a container off its network for as long as the context lasts."""
        container = self.container(service)
        [network] = self.facts(service)["NetworkSettings"]["Networks"]
        docker("network", "disconnect", network, container)
        try:
            yield
        finally:
            docker("network", "connect", "--alias", service, network, container)

    @contextlib.contextmanager
    def slowed(self, service: str, *, delay: int, jitter: int, loss: int) -> Iterator[dict[str, int]]:
        """Delay what a container sends, in milliseconds, and lose some percent of it; at the end, what was done."""
        inside = ["nsenter", "-t", str(self.facts(service)["State"]["Pid"]), "-n", "--"]
        told: dict[str, int] = {}
        netem = ["delay", f"{delay}ms", f"{jitter}ms", "loss", f"{loss}%"]
        if (
            in_daemon(*inside, "tc", "qdisc", "add", "dev", "eth0", "root", "netem", *netem, check=False).returncode
            == 0
        ):
            yield told
            [shown] = json.loads(in_daemon(*inside, "tc", "-s", "-j", "qdisc", "show", "dev", "eth0").stdout)
            told |= {"packets": shown["packets"], "lost": shown["drops"]}
            in_daemon(*inside, "tc", "qdisc", "del", "dev", "eth0", "root")
            return
        program = [sys.executable, str(Path(__file__).with_name("slow_network.py"))]
        words = ["--delay", str(delay), "--jitter", str(jitter), "--loss", str(loss), "--seed", "1"]
        process = subprocess.Popen(
            [*into_daemon(), *inside, *program, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "slow\n", process.communicate()[1]
            yield told
        finally:
            # The first nsenter waits for the second, which has become the program itself.
            for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
                os.kill(int(child), signal.SIGTERM)
            out, err = process.communicate(timeout=20)
        told |= json.loads(out)
        assert not err


def into_daemon() -> list[str]:
    return ["nsenter", "-t", os.environ["DAEMON_PID"], "--net", "--mount", "--pid", "--"]


def in_daemon(*words: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """Run a command beside the daemon, in its namespaces."""
    done = subprocess.run([*into_daemon(), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0 or not check, f"{' '.join(words)}: {done.stdout}{done.stderr}"
    return done
