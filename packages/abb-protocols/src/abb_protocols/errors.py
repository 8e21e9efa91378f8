"""The errors of yumi, drawn once: what is refused, missing, not ready, not reached, not confirmed or not connected.

Each class is one decision of the caller::

    YumiError
    ├── SettingsError        a configuration file or option is wrong: mend it and start again
    ├── MissingPrerequisite  the machine lacks something: install it
    ├── CommandRefused       a request broke a rule; nothing was changed: ask for something else
    │   └── TrajectoryRefused    the request was a trajectory; with the result code of FollowJointTrajectory
    ├── SwitchFailed         a controller failed while it was switched: read what is active now, then mend it
    ├── RobotNotReady        the robot is in the wrong state for the request: bring it there first
    │   └── StopNotConfirmed     a person stopped it, or a collision: look at the robot, then confirm the stop
    ├── PlanNotFound         no path leads there, or none was found in time; ``why`` says which
    ├── GoalNotReached       a motion or grip ended elsewhere than it should: look why, then order again
    ├── NoConnection         nothing answers at the address: check cable, address, power
    ├── LoginRefused         the controller is there but does not accept the user or password
    ├── ControllerRefused    the controller answered "no", with ABB's code
    ├── ProtocolError        the other side said something that has no meaning in the protocol
    └── RapidError           a RAPID module does not parse, or a RAPID program stopped with an error
"""

from __future__ import annotations

from enum import Enum

from abb_protocols.catalogue import Message, message


class YumiError(Exception):
    """Base of all errors; its string is one sentence for a person, in the words of this program's front end.

    Attributes:
        said: what it says, as a code with values; code that decides by an error looks at its class or at this code.
    """

    def __init__(self, said: Message | str) -> None:
        super().__init__(said)
        self.said = said if isinstance(said, Message) else message("text", text=said)

    def __str__(self) -> str:
        return str(self.said)


class SettingsError(YumiError):
    """A configuration value is wrong; the message names the file, the key and what is allowed."""


class MissingPrerequisite(YumiError):
    """The machine lacks something yumi needs; the message says what to install."""


def missing_extra(what: Message, package: str, extra: str) -> MissingPrerequisite:
    """That ``what`` is missing, and how ``extra`` of ``package`` brings it, from an index or in a clone."""
    return MissingPrerequisite(message("extra_missing", what=what, package=package, extra=extra))


class CommandRefused(YumiError):
    """A request broke a rule and changed nothing; the message gives the value and the limit."""


class TrajectoryRefused(CommandRefused):
    """A trajectory broke a rule.

    Attributes:
        code: the error code of control_msgs/action/FollowJointTrajectory that says so.
    """

    def __init__(self, said: Message | str, code: int) -> None:
        super().__init__(said)
        self.code = code


class SwitchFailed(YumiError):
    """A controller raised an error while it was activated; the message says what became of the others."""


class RobotNotReady(YumiError):
    """The robot is not in the state the request needs; the message says what to do first.

    Attributes:
        stop: id of the stop that a person must confirm before anything moves; empty where there is none.
    """

    def __init__(self, said: Message | str, stop: str = "") -> None:
        super().__init__(said)
        self.stop = stop


class StopNotConfirmed(RobotNotReady):
    """An emergency stop, a guard stop or a collision waits for a person's confirmation; nothing was changed."""


class WhyNoPlan(Enum):
    """Why a plan was not found."""

    NO_PATH = "no_path"
    """Complete searches found none: all that was tried is too near to something. The same goal fails again."""

    TIME_IS_UP = "time_is_up"
    """A search was cut short. There may be a path: give more time, or plan again when the machine is less busy."""


class PlanNotFound(YumiError):
    """No path was found.

    Attributes:
        why: whether there is none, or time was up.
        processor_share: how much of the time the planner had a processor, 0 to 1; little on a busy machine.
    """

    def __init__(self, said: Message | str, why: WhyNoPlan = WhyNoPlan.NO_PATH, processor_share: float = 1.0) -> None:
        super().__init__(said)  # alone, as another process makes it anew of that and sets the rest
        self.why = why
        self.processor_share = processor_share


class GoalNotReached(YumiError):
    """A motion or a grip was begun and ended elsewhere than ordered; the arm holds, the message says why.

    Attributes:
        stop: id of the stop that a person must confirm before anything moves; empty where there is none.
    """

    def __init__(self, said: Message | str, stop: str = "") -> None:
        super().__init__(said)
        self.stop = stop


class NoConnection(YumiError):
    """Nothing answered at the address in time."""


class LoginRefused(YumiError):
    """The controller refused the user name or the password."""


class ControllerRefused(YumiError):
    """The controller understood the request and refused it.

    Attributes:
        status: the HTTP status.
        code: ABB's return code (reference/rws.md §3.5), or None when the body had none.
    """

    def __init__(self, said: Message | str, *, status: int, code: int | None = None) -> None:
        super().__init__(said)
        self.status = status
        self.code = code


class ProtocolError(YumiError):
    """Bytes or a document that have no meaning in the protocol."""


class RapidError(YumiError):
    """A RAPID module does not parse, or a RAPID program stopped with an unhandled error."""
