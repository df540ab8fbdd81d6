"""A file is there whole or not at all."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from lalliance_agents.whole_file import written_whole


class CrashError(BaseException):
    """As a process that ends here."""


def write(path: Path, *parts: bytes | Callable[[], None]) -> None:
    with written_whole(path) as file:
        for part in parts:
            file.write(part) if isinstance(part, bytes) else part()


def test_a_file_takes_the_place_of_another_only_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "kept"
    path.write_bytes(b"old")
    with written_whole(path) as file:
        file.write(b"new")
        file.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), CrashError()])
@pytest.mark.parametrize("step", ["open", "write", "fsync", "replace"])
def test_a_crash_at_any_step_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, failure: BaseException
) -> None:
    path = tmp_path / "kept"
    path.write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise failure

    with monkeypatch.context() as patch:
        if step != "write":
            patch.setattr(os if step == "fsync" else Path, step, fail)
        with pytest.raises(type(failure)):
            write(path, *((b"half", fail) if step == "write" else (b"whole",)))
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
