"""How a mission that runs is found on its own machine, and what is left when it does not run any more."""

from pathlib import Path

import pytest

from mission_control.running import announced, endpoints

pytestmark = pytest.mark.alone


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "lalliance"


def test_a_mission_is_found_by_its_name_while_it_runs(folder: Path) -> None:
    with announced("depot", "tcp/127.0.0.1:1"):
        assert endpoints("depot") == ["tcp/127.0.0.1:1"]
        assert endpoints("depo") == endpoints("depot-2") == []
        [file] = folder.iterdir()
        assert (folder.stat().st_mode & 0o777, file.stat().st_mode & 0o777) == (0o700, 0o600)
        with announced("depot", "tcp/127.0.0.1:2"):
            assert sorted(endpoints("depot")) == ["tcp/127.0.0.1:1", "tcp/127.0.0.1:2"]
        assert endpoints("depot") == ["tcp/127.0.0.1:1"]
    assert endpoints("depot") == []
    assert list(folder.iterdir()) == []


def test_what_a_killed_mission_left_is_not_found_and_is_removed(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    (folder / "depot.left-behind").write_text("tcp/127.0.0.1:1")
    assert endpoints("depot") == []
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_a_folder_that_others_can_write_to_is_not_used(folder: Path, mode: int) -> None:
    folder.mkdir()
    folder.chmod(mode)
    with announced("depot", "tcp/127.0.0.1:1"):
        assert list(folder.iterdir()) == []
        assert endpoints("depot") == []


def test_a_mission_runs_where_nothing_can_be_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder / "nowhere"))
    with announced("depot", "tcp/127.0.0.1:1"):
        assert endpoints("depot") == []


def test_without_a_runtime_folder_there_is_one_of_the_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with announced("depot", "tcp/127.0.0.1:1"):
        assert endpoints("depot") == ["tcp/127.0.0.1:1"]
        [folder] = tmp_path.iterdir()
        assert folder.stat().st_mode & 0o777 == 0o700
