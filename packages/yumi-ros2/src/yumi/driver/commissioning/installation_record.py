"""The record of an installation: what was on a controller before the first one, on this machine's disk."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import SettingsError
from yumi.driver.commissioning.contents import Contents


@dataclass(slots=True)
class InstallationRecord:
    """What was there before the first installation on a controller, on this machine's disk.

    Attributes:
        path: of the file; the backup is beside it.
        before: what was there; None where nothing was installed.
        is_restart_due: whether cfg was changed, and the controller was not seen to restart since.
        backups: names of the backups on the controller, the newest last.
    """

    path: Path
    before: Contents | None = None
    is_restart_due: bool = False
    backups: tuple[str, ...] = ()

    @classmethod
    def of(cls, controller: str, folder: Path | None = None) -> InstallationRecord:
        """The record of a controller, by its name and serial number.

        Raises:
            SettingsError: the file cannot be read.
        """
        state = folder or Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "yumi"
        record = cls(state / "installations" / re.sub(r"[^\w.-]+", "_", controller) / "record.json")
        if record.path.is_file():
            try:
                value = json.loads(record.path.read_text(encoding="utf-8"))
                record.before = Contents.of_json(value["before"])
                record.is_restart_due, record.backups = bool(value["is_restart_due"]), tuple(value["backups"])
            except (OSError, ValueError, KeyError, TypeError, AssertionError) as error:
                raise SettingsError(
                    message("record_unreadable", file=str(record.path), reason=quoted(error))
                ) from error
        return record

    def check_writable(self) -> None:
        """Refuse a folder that no record can be written to.

        Raises:
            SettingsError: it cannot; ``XDG_STATE_HOME`` chooses another one.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            trial = self.path.with_suffix(".new")
            trial.write_bytes(b"")
            trial.unlink()
        except OSError as error:
            raise SettingsError(
                message("record_folder_not_writable", folder=str(self.path.parent), reason=error.strerror)
            ) from error

    def save(self) -> None:
        """Write it, so that it is there whatever happens next.

        Raises:
            SettingsError: it cannot be written.
        """
        assert self.before is not None, "a record of nothing is not saved"
        value = {
            "before": self.before.as_json(),
            "is_restart_due": self.is_restart_due,
            "backups": self.backups,
        }
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            new = self.path.with_suffix(".new")
            with new.open("w", encoding="utf-8") as opened:
                json.dump(value, opened, indent=1)
                opened.flush()
                os.fsync(opened.fileno())
            new.replace(self.path)
        except OSError as error:
            raise SettingsError(message("record_not_writable", file=str(self.path), reason=error.strerror)) from error

    def close(self) -> None:
        """Everything is as before: keep the record under another name, so that nothing is rolled back twice."""
        self.path.replace(self.path.with_name(f"rolled_back_{datetime.now():%Y%m%d_%H%M%S}.json"))
        self.before, self.is_restart_due = None, False
