"""RAPID's I/O and time: setting, reading and waiting for signals, and waiting for time to pass."""

from __future__ import annotations

from yumi.rapid.builtins.data import DATA
from yumi.rapid.library import Call, Deadline, Library, Wait

SIGNALS = Library(DATA)
PULSE_S = 0.2  # the length of PulseDO without \PLength


def _write(call: Call, value: float) -> None:
    r"""Set the call's signal, after \SDelay where it is given; the program goes on at once."""
    task, name = call.task, call["Signal"].name
    if call.present("SDelay"):
        task.timers.add(task.now + call["SDelay"], lambda: task.write_signal(name, value))
    else:
        task.write_signal(name, value)


@SIGNALS.instruction("Set", "VAR signaldo Signal")
def set_output(call: Call) -> None:
    call.task.write_signal(call["Signal"].name, 1.0)


@SIGNALS.instruction("Reset", "VAR signaldo Signal")
def reset_output(call: Call) -> None:
    call.task.write_signal(call["Signal"].name, 0.0)


@SIGNALS.instruction("InvertDO", "VAR signaldo Signal")
def invert_output(call: Call) -> None:
    name = call["Signal"].name
    call.task.write_signal(name, 0.0 if call.task.read_signal(name) else 1.0)


@SIGNALS.instruction("SetDO", r"\num SDelay | \switch Sync, VAR signaldo Signal, num Value")
def set_digital_output(call: Call) -> None:
    _write(call, 1.0 if call["Value"] else 0.0)


@SIGNALS.instruction("SetGO", r"\num SDelay, VAR signalgo Signal, num Value")
def set_group_output(call: Call) -> None:
    _write(call, call["Value"])


@SIGNALS.instruction("SetAO", "VAR signalao Signal, num Value")
def set_analog_output(call: Call) -> None:
    call.task.write_signal(call["Signal"].name, call["Value"])


@SIGNALS.instruction("PulseDO", r"\switch High, \num PLength, VAR signaldo Signal")
def pulse_output(call: Call) -> None:
    r"""A pulse away from the present level and back, or high and then low with \High; the program goes on."""
    task, name = call.task, call["Signal"].name
    level = 0.0 if call.present("High") else task.read_signal(name)
    task.write_signal(name, 0.0 if level else 1.0)
    task.timers.add(task.now + call.get("PLength", PULSE_S), lambda: task.write_signal(name, level))


def _level(call: Call) -> float:
    return call.task.read_signal(call["Signal"].name)


for _name, _type, _returns in (
    ("DInput", "signaldi", "dionum"),
    ("DOutput", "signaldo", "dionum"),
    ("GInput", "signalgi", "num"),
    ("GOutput", "signalgo", "num"),
    ("AInput", "signalai", "num"),
    ("AOutput", "signalao", "num"),
):
    SIGNALS.function(_name, f"VAR {_type} Signal", _returns)(_level)


@SIGNALS.function("TestDI", "VAR signaldi Signal", "bool")
def is_set(call: Call) -> bool:
    return bool(_level(call))


# Waiting ----------------------------------------------------------------------------------------------------------


@SIGNALS.instruction("WaitTime", r"\switch InPos, num Time")
def wait_time(call: Call) -> Wait:
    yield from wait_in_position(call)
    end = call.task.now + max(0.0, call["Time"])
    while call.task.now < end:
        yield end


def wait_in_position(call: Call) -> Wait:
    while not call.task.is_settled(call):
        yield None


def _wait_for_level(call: Call) -> Wait:
    deadline, value = Deadline.of(call), call["Value"]
    while _level(call) != value:
        if deadline.is_over():
            return
        yield deadline.due
    deadline.met()


for _name, _type in (
    ("WaitDI", "signaldi"),
    ("WaitDO", "signaldo"),
    ("WaitGI", "signalgi"),
    ("WaitGO", "signalgo"),
):
    SIGNALS.instruction(_name, rf"VAR {_type} Signal, num Value, \num MaxTime, \VAR bool TimeFlag")(_wait_for_level)
