"""The controller's disk has an end."""

from __future__ import annotations

import pytest

from virtual_irc5.controller import file_store
from virtual_irc5.controller.file_store import DISK_CAPACITY, LONGEST_PATH, MOST_FILES, FileStore
from virtual_irc5.controller_log import RefusalReason, Refused


@pytest.fixture
def store() -> FileStore:
    return FileStore({"HOME:/a.mod": "MODULE a ENDMODULE"})


def refusal(store: FileStore, path: str, content: bytes = b"") -> RefusalReason:
    with pytest.raises(Refused) as refused:
        store.write(path, content)
    return refused.value.reason


def test_disk_that_is_full_takes_nothing_more(store: FileStore) -> None:
    store.write("TEMP:/big", bytes(DISK_CAPACITY - 1000))
    assert refusal(store, "HOME:/more", bytes(1001)) is RefusalReason.NO_SPACE
    assert "HOME:/more" not in store


def test_file_that_is_replaced_makes_room_for_the_new_one(store: FileStore) -> None:
    store.write("TEMP:/big", bytes(DISK_CAPACITY - 1000))
    assert not store.write("TEMP:/big", bytes(DISK_CAPACITY - 500))


def test_disk_takes_so_many_files_only(store: FileStore) -> None:
    for number in range(MOST_FILES - len(file_store.DISK_DEVICES) - 1):
        store.write(f"TEMP:/{number}", b"")
    assert refusal(store, "TEMP:/one-more") is RefusalReason.NO_SPACE
    with pytest.raises(Refused, match="the disk is full"):
        store.make_directory("TEMP:/directory")


def test_path_has_an_end(store: FileStore) -> None:
    assert refusal(store, "TEMP:/" + "x" * LONGEST_PATH) is RefusalReason.BAD_VALUE


def test_copies_count(store: FileStore) -> None:
    store.write("TEMP:/big", bytes(DISK_CAPACITY // 2))
    with pytest.raises(Refused, match="the disk is full"):
        store.copy("TEMP:/big", "TEMP:/again")
