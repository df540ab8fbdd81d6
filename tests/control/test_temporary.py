"""The folder of a run's own: there while it runs, and gone afterwards, whatever the run died of."""

import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from mission_control.temporary import own_folder


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_is_there_for_its_run_alone_and_goes_with_it(place: Path) -> None:
    with own_folder() as first:
        (first / "journal").write_text("something")
        assert first.stat().st_mode & 0o777 == 0o700
        with own_folder() as second:
            assert sorted(place.iterdir()) == sorted([first, second])
        assert (first / "journal").exists()
    assert list(place.iterdir()) == []


def test_what_a_killed_process_left_goes_with_the_next_one_and_nothing_else(place: Path) -> None:
    code = (
        "import tempfile; tempfile.tempdir = {!r}\n"
        "from mission_control.temporary import own_folder\n"
        "with own_folder() as folder:\n"
        "    (folder / 'journal').write_text('something')\n"
        "    print(folder, flush=True)\n"
        "    input()\n"
    )
    killed = subprocess.Popen(
        [sys.executable, "-c", code.format(str(place))], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert killed.stdout is not None
    left = Path(killed.stdout.readline().rstrip())
    with own_folder():
        assert left.exists()
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert (left / "journal").exists()
    for other in ("lalliance-1000", "lalliance-else", "run"):
        (place / other).mkdir()
    (place / "lalliance-run-file").touch()
    (place / "lalliance-run-link").symlink_to(place / "run")
    with own_folder() as own:
        assert not left.exists()
        assert {path.name for path in place.iterdir()} == {
            "lalliance-1000", "lalliance-else", "run", "lalliance-run-file", "lalliance-run-link", own.name,
        }  # fmt: skip


def test_a_folder_taken_for_a_leftover_before_it_was_locked_is_replaced(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, made = tempfile.mkdtemp, list[str]()

    def vanish_at_first(prefix: str) -> str:
        made.append(make(prefix=prefix))
        if len(made) == 1:
            Path(made[0]).rmdir()
        return made[-1]

    monkeypatch.setattr("tempfile.mkdtemp", vanish_at_first)
    with own_folder() as folder:
        assert [str(folder)] == made[1:]
        assert folder.exists()
