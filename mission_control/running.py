"""Which missions run on this machine, and where their buses are: so that nobody has to copy endpoints.

Each `lalliance run` keeps a small file with the endpoint of its bus, `<mission>.<some letters>`, in a folder that nobody but
its user can write to: `$XDG_RUNTIME_DIR/lalliance`, or `lalliance-<user id>` where temporary files are. For as long as it lives
it holds a lock on the file. The kernel releases a lock whatever its holder died of, so that a file without one is a leftover,
which whoever comes across it removes. A mission runs just as well where no such file can be kept.
"""

import contextlib
import fcntl
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def announced(mission: str, endpoint: str) -> Iterator[None]:
    """Let others on this machine find the mission for as long as the context lasts."""
    path = descriptor = None
    # Not being found is no reason not to run.
    with contextlib.suppress(OSError):
        if (folder := _folder()) is not None:
            # Hidden until it is locked and complete.
            descriptor, hidden = tempfile.mkstemp(prefix=f".{mission}.", dir=folder)
            path = Path(hidden)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            os.write(descriptor, endpoint.encode())
            path = path.rename(folder / path.name[1:])
    try:
        yield
    finally:
        if path is not None:
            path.unlink(missing_ok=True)
        if descriptor is not None:
            os.close(descriptor)


def endpoints(mission: str) -> list[str]:
    """Where the missions of this name run that were started here."""
    return [endpoint for name, endpoint in running() if name == mission]


def running() -> list[tuple[str, str]]:
    """The missions that were started here and run, each with the endpoint of its bus."""
    try:
        folder = _folder()
        files = [] if folder is None else sorted(folder.glob("[!.]*.*"))
    except OSError:
        return []
    found = ((path.name.rpartition(".")[0], _endpoint(path)) for path in files)
    return [(mission, endpoint) for mission, endpoint in found if endpoint is not None]


def _endpoint(path: Path) -> str | None:
    """What the file says, if whoever wrote it still lives."""
    with contextlib.suppress(OSError, UnicodeDecodeError), path.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return file.read()
        path.unlink(missing_ok=True)
    return None


def _folder() -> Path | None:
    """The folder, made if need be; None if others could have put something into it."""
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    user = os.getuid()
    folder = Path(given, "lalliance") if given else Path(tempfile.gettempdir(), f"lalliance-{user}")
    folder.mkdir(mode=0o700, exist_ok=True)
    facts = folder.lstat()
    is_ours = stat.S_ISDIR(facts.st_mode) and facts.st_uid == user and not facts.st_mode & 0o022
    return folder if is_ours else None
