from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady
from abb_runtime.process.single_instance import SingleInstance, lock_folder
from refusals import refused

NAME = "yumi-test at 127.0.0.1:80/x"


def taken(owner: Message) -> Message:
    return message("ros_domain_taken", owner=owner)


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def test_only_one_may_claim_a_name_and_the_other_learns_who_did() -> None:
    first, second = (SingleInstance(NAME, taken) for _ in range(2))
    first.claim()
    with refused(RobotNotReady, "ros_domain_taken", owner=message("owner_process", process=str(os.getpid()))):
        second.claim()
    first.release()
    second.claim()
    second.release()


def test_name_is_free_again_when_its_process_was_killed(folder: Path) -> None:
    text = (
        f"from abb_runtime.process.single_instance import SingleInstance\nSingleInstance({NAME!r}, str).claim()\n"
        "print('claimed', flush=True)\ninput()"
    )
    child = subprocess.Popen([sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    with child:
        assert child.stdout is not None
        assert child.stdout.readline() == "claimed\n"
        own = SingleInstance(NAME, taken)
        with refused(RobotNotReady, "ros_domain_taken", owner=message("owner_process", process=str(child.pid))):
            own.claim()
        child.kill()
    own.claim()
    own.release()


def test_lock_cannot_be_taken_or_read_by_other_users(folder: Path) -> None:
    only = SingleInstance(NAME, taken)
    only.claim()
    (file,) = folder.iterdir()
    assert file.stat().st_mode & 0o077 == 0
    only.release()


def test_folder_for_temporary_files_serves_where_there_is_no_folder_of_the_login(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder / "gone"))
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    own = lock_folder()
    assert own == folder / f"yumi-{os.getuid()}"
    assert own.stat().st_mode & 0o777 == 0o700
    own.chmod(0o755)
    with refused(RobotNotReady, "lock_folder_open_to_others", folder=str(own)):
        SingleInstance(NAME, taken).claim()
