"""A folder for what a run keeps only for itself, which goes with it, or else with the next run of the same user.

Whoever uses such a folder holds a lock on it. The kernel releases a lock whatever its holder died of, so that a folder without
one is a leftover, which the next run removes; also of a process that was killed and could remove nothing itself.
"""

import contextlib
import fcntl
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

_PREFIX = "lalliance-run-"


@contextlib.contextmanager
def own_folder() -> Iterator[Path]:
    """A new folder that nobody but this user can enter, for as long as the context lasts.

    Raises:
        OSError: none can be made.
    """
    _remove_leftovers()
    folder, held = _locked(Path(tempfile.mkdtemp(prefix=_PREFIX)))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if held is not None:
            os.close(held)


def _locked(folder: Path) -> tuple[Path, int | None]:
    """`folder` and what holds the lock on it; another one if somebody took it for a leftover before it was locked."""
    while True:
        with contextlib.suppress(FileNotFoundError):
            held = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            try:
                fcntl.flock(held, fcntl.LOCK_EX)
            except OSError:  # there are no locks on this file system, and so nobody takes a folder for a leftover
                os.close(held)
                return folder, None
            if folder.exists():
                return folder, held
            os.close(held)
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))


def _remove_leftovers() -> None:
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            facts = folder.lstat()
            if stat.S_ISDIR(facts.st_mode) and facts.st_uid == os.getuid():
                _remove_if_left(folder)


def _remove_if_left(folder: Path) -> None:
    """Remove a folder that nobody holds.

    Raises:
        OSError: somebody does.
    """
    held = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(held)
