"""I/O signals and RAPID variables by name, as a person gives and reads them: text in, text out."""

from __future__ import annotations

import re
from math import isfinite

from yumi.errors import CommandRefused, ControllerRefused, ProtocolError
from yumi.hardware.cabinet import Cabinet
from yumi.hardware.rws_client import RwsClient
from yumi.rws import rapid_values

_NAME = re.compile(r"[A-Za-z]\w{0,31}")
_SIGNAL = re.compile(r"[A-Za-z][\w/]{0,95}")
_BAD_VALUE, _FORBIDDEN, _UNKNOWN = 400, 403, 404


class ControllerData:
    """Signals and variables of one controller.

    Args:
        client: a connected client.
        cabinet: says whether requests are accepted.
    """

    def __init__(self, client: RwsClient, cabinet: Cabinet) -> None:
        self._client = client
        self._cabinet = cabinet

    def read_signal(self, name: str) -> str:
        """The logical value of an I/O signal.

        Raises:
            CommandRefused: the controller has no such signal.
        """
        return _number(self._signal(name))

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal, and see that it keeps the value.

        Raises:
            CommandRefused: no such signal, or no such value; nothing was changed.
            RobotNotReady: not in AUTO, where this controller takes none.
            ControllerRefused: the controller does not let remote clients write it.
        """
        wanted = _checked_number(name, value)
        self._signal(name)
        self._set_signal(name, wanted)
        kept = self._signal(name)
        if kept != wanted:
            raise CommandRefused(
                f"Signal {name} is {_number(kept)} after {_number(wanted)} was written; see who sets it."
            )

    def read_variable(self, task: str, module: str, name: str) -> str:
        """The value of a RAPID variable as RAPID writes it.

        Raises:
            CommandRefused: there is none of that name.
        """
        self._type_of(task, module, name)
        return self._client.symbol(task, module, name)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable.

        Args:
            task: as ``T_ROB_R``.
            module: that declares it.
            name: its name.
            value: as RAPID writes it: ``1.5``, ``TRUE``, ``"text"``, ``[1,[2,3]]``.

        Raises:
            CommandRefused: there is none of that name, ``value`` is no RAPID value or not of its type, or it is a
                constant; nothing was changed.
            RobotNotReady: not in AUTO.
        """
        self._cabinet.check_automatic()
        kind = self._type_of(task, module, name)
        try:
            rapid_values.decode(value)
        except ProtocolError as error:
            raise CommandRefused(
                f"{value!r} is no RAPID value; {module}/{name} of {task} takes a {kind}, such as {_example(kind)}."
            ) from error
        try:
            self._client.set_symbol(task, module, name, value)
        except ControllerRefused as error:
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(
                f"The controller does not take {value} for {module}/{name} of {task}: it is a {kind}, such as "
                f"{_example(kind)}, or a constant, which cannot be written."
            ) from error

    def _set_signal(self, name: str, value: float) -> None:
        try:
            self._client.set_signal(name, value)
        except ControllerRefused as error:
            if error.status == _FORBIDDEN:
                self._cabinet.check_automatic()  # what may be written in AUTO may be forbidden in manual
            if error.status != _BAD_VALUE:
                raise
            raise CommandRefused(
                f"The controller does not take {_number(value)} for signal {name}; a digital signal is 0 or 1, another "
                "one has the range of its configuration."
            ) from error

    def _signal(self, name: str) -> float:
        if not _SIGNAL.fullmatch(name):
            raise CommandRefused(f"{name!r} is no name of a signal; give one of the controller's I/O signals.")
        try:
            return self._client.signal(name).value
        except ControllerRefused as error:
            if error.status != _UNKNOWN:
                raise
            raise CommandRefused(f"The controller has no signal {name}; look at its list of I/O signals.") from error

    def _type_of(self, task: str, module: str, name: str) -> str:
        for word in (task, module, name):
            if not _NAME.fullmatch(word):
                raise CommandRefused(f"{word!r} is no RAPID name; give task, module and variable.")
        try:
            return self._client.symbol_type(task, module, name)
        except ControllerRefused as error:
            raise CommandRefused(f"The controller has no {module}/{name} in task {task}; check the names.") from error


def _checked_number(name: str, value: str | float) -> float:
    try:
        number = float(value)
    except ValueError as error:
        raise CommandRefused(f"{value!r} is no value for signal {name}; give a number.") from error
    if not isfinite(number):
        raise CommandRefused(f"Signal {name} cannot be {number}; give a finite number.")
    return number


def _number(value: float) -> str:
    return str(int(value)) if value.is_integer() else repr(value)


def _example(kind: str) -> str:
    return {"bool": "TRUE", "string": '"text"', "num": "1.5", "dnum": "1.5"}.get(kind, "[1,[2,3]]")
