"""A second program beside a running driver: it looks and asks over the driver's local endpoint, and drives nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from math import isfinite
from types import TracebackType
from typing import Literal, TypeVar

from yumi.api.motion import Position
from yumi.driver import endpoint as wire
from yumi.driver.endpoint import (
    ControllerStatus,
    DriverState,
    EndpointClient,
    GripReport,
    MotionReport,
    Request,
    find_driver,
)
from yumi.errors import CommandRefused
from yumi.robot.joints import JOINT_COUNT, Side, joints

T = TypeVar("T")
Arms = wire.Arm | Sequence[wire.Arm]


def attach(robot: str = "", *, on_step: Callable[[str], None] = lambda step: None) -> RunningDriver:
    """The driver that runs on this machine, of ``yumi up`` or of a script's ``yumi.connect``.

    ::

        with yumi.attach() as driver:
            print(driver.state.arms["right"].position)
            driver.move_to(right="home")

    Args:
        robot: its robot's address or its namespace, where several drivers run.
        on_step: given each step of what the driver does for this program.

    Raises:
        RobotNotReady: no driver runs, or several do; the message says what to do.
    """
    return RunningDriver(EndpointClient(find_driver(robot)), on_step)


class RunningDriver:
    """A running driver as another program sees it; one request at a time.

    Every method returns when it is done, and raises what the driver raised: a YumiError with its sentence.

    Args:
        client: the connection to it.
        on_step: given each step of what it does.
    """

    def __init__(self, client: EndpointClient, on_step: Callable[[str], None] = lambda step: None) -> None:
        self._client = client
        self._on_step = on_step

    def __enter__(self) -> RunningDriver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<yumi.RunningDriver {self._client.path.stem}>"

    def close(self) -> None:
        """Disconnect; a motion that this program has asked for is stopped."""
        self._client.close()

    @property
    def state(self) -> DriverState:
        """All that the driver knows: robot, arms, controllers, grippers, the newest events."""
        return self._client.ask(wire.GetState(), DriverState)

    def watch(self, rate: float = 30.0) -> Iterator[DriverState]:
        """The state ``rate`` times a second (0.1 to 60), with the events since the one before.

        A connection that watches asks for nothing else: attach once more for that.
        """
        return self._client.watch(rate)

    @property
    def controllers(self) -> Mapping[str, tuple[ControllerStatus, ...]]:
        """The controllers of each arm."""
        return self._client.ask(wire.GetControllers(), dict[str, tuple[ControllerStatus, ...]])

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller; it can be set, 0.01 to 1."""
        return self.state.speed_scale

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self._ask(wire.SetSpeedScale(speed_scale=float(value)), str)

    def start_egm(self, arms: Arms = ()) -> str:
        """Start EGM on ``"right"``, ``"left"`` or the arms that are configured, with the controllers on top."""
        return self._ask(wire.StartEgm(arms=_several(arms)), str)

    def stop_egm(self) -> str:
        """Bring the arms to rest and end EGM; waits for nothing else that the driver does."""
        return self._ask(wire.StopEgm(), str)

    def set_mode(self, mode: wire.ModeName) -> str:
        """Bring the robot to ``motors_off``, ``ready``, ``egm_left``, ``egm_right`` or ``egm_both``."""
        return self._ask(wire.SetMode(mode=mode), str)

    def recover(self, confirm: str = "") -> str:
        """Bring the robot back after a stop; ``confirm`` is ``state.stop``, after a person has looked at the robot."""
        return self._ask(wire.Recover(confirm=confirm), str)

    def calibrate(self, arms: Arms = ("right", "left")) -> str:
        """Close the fingers of grippers and call that zero."""
        return self._ask(wire.Calibrate(arms=_several(arms)), str)

    def open_gripper(self, arm: wire.Arm, width: float | None = None) -> GripReport:
        """Open a gripper to ``width`` [m], or as far as it goes."""
        return self._ask(wire.Grip(arm=arm, action="open", width=width), GripReport)

    def close_gripper(self, arm: wire.Arm, force: float | None = None) -> GripReport:
        """Close a gripper and hold what is there with ``force`` [N]."""
        return self._ask(wire.Grip(arm=arm, action="close", force=force), GripReport)

    def switch(self, arm: wire.Arm, activate: Sequence[str] = (), deactivate: Sequence[str] = ()) -> str:
        """Activate and deactivate controllers of one arm in one step."""
        return self._ask(wire.SwitchControllers(arm=arm, activate=tuple(activate), deactivate=tuple(deactivate)), str)

    def move_to(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
        timeout: float | None = None,
        is_pose: bool = False,
        is_linear: bool = False,
        speed: float | None = None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> str:
        """Move arms, and return when they stand at their goals; the controllers that commanded them do so again then.

        A program that ends meanwhile, also by Ctrl-C, stops them.

        Args:
            right: joint positions [rad], (7,) in chain order; the name of a pose; or some joints by name, the others
                stay.
            left: the same of the left arm.
            speed_scale: factor on the joints' highest speeds, on top of the driver's, above 0 up to 1; None takes the
                controller's.
            acceleration: the same for accelerations and jerks.
            timeout: arms that take longer are stopped [s].
            is_pose: positions are poses of the tools in use instead: x, y, z [m], and w, x, y, z, or the orientation
                stays.
            is_linear: the tools move there on straight lines.
            speed: of the tools on lines, at most [m/s].
            on_motion: given how far the motions are, ten times a second.

        Raises:
            CommandRefused: a position is impossible, an arm moves already, or another program moves it.
            RobotNotReady: EGM does not run on the arm.
            GoalNotReached: a motion ended elsewhere.
        """
        goals = {
            side: _position(position)
            for side, position in ((Side.RIGHT, right), (Side.LEFT, left))
            if position is not None
        }
        request = wire.Move(
            right=goals.get(Side.RIGHT),
            left=goals.get(Side.LEFT),
            speed_scale=speed_scale,
            acceleration=acceleration,
            timeout=timeout,
            is_pose=is_pose,
            is_linear=is_linear,
            speed=speed,
        )
        return self._client.ask(request, str, self._on_step, on_motion, timeout=None)

    def allow_collision(self, part: str, other: str, *, seconds: float = 10.0) -> ExitStack:
        """Let two parts touch for a while, as :meth:`yumi.api.robot.Robot.allow_collision`, which raises the same.

        They are kept apart again, too, when this program disconnects or ends.
        """
        self._ask(wire.AllowCollision(part=part, other=other, seconds=float(seconds)), str)
        end = ExitStack()
        end.callback(lambda: self._ask(wire.AllowCollision(part=part, other=other, seconds=0.0), str))
        return end

    def jog(self, arm: wire.Arm, speeds: Sequence[float]) -> None:
        """Move an arm with joint speeds [rad/s], (7,) in chain order, for 0.06 s; call it again while it is to move.

        Raises:
            CommandRefused: the speeds are no seven finite numbers, or another client or motion moves the arm.
            RobotNotReady: EGM does not run on the arm.
        """
        values = _position(speeds)
        if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
            raise CommandRefused(f"Jog refused: expected {JOINT_COUNT} speeds in chain order.")
        self._ask(wire.Jog(arm=arm, speeds=joints(values)), str)

    def jog_tool(
        self,
        arm: wire.Arm,
        *,
        linear: Sequence[float] = (0.0, 0.0, 0.0),
        angular: Sequence[float] = (0.0, 0.0, 0.0),
        elbow: float = 0.0,
        frame: Literal["base", "tool"] = "base",
    ) -> None:
        """Move the fingertips of an arm with a velocity for 0.06 s; as :meth:`jog`, which raises the same.

        Args:
            arm: which.
            linear: velocity x, y, z [m/s].
            angular: angular velocity about x, y, z [rad/s].
            elbow: speed of the arm angle [rad/s].
            frame: from where they are seen: the robot's base, or the tool.
        """
        values = _position([*linear, *angular, elbow])
        if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
            raise CommandRefused("Jog refused: expected three numbers each for linear and angular.")
        x, y, z, about_x, about_y, about_z, turn = values
        request = wire.JogTool(arm=arm, linear=(x, y, z), angular=(about_x, about_y, about_z), elbow=turn, frame=frame)
        self._ask(request, str)

    def _ask(self, request: Request, result: type[T]) -> T:
        return self._client.ask(request, result, self._on_step, timeout=None)


def _several(arms: Arms) -> tuple[wire.Arm, ...]:
    return (arms,) if isinstance(arms, str) else tuple(arms)


def _position(position: Position) -> wire.Position:
    """As it is sent. JSON has finite numbers only; all else is for the driver, which knows the names of its joints."""
    if isinstance(position, str):
        return position
    try:
        pairs = position.items() if isinstance(position, Mapping) else enumerate(position, 1)
        values = {name: float(value) for name, value in pairs}
    except (TypeError, ValueError) as error:
        raise CommandRefused(f"Goal refused: expected seven angles in radians, got {repr(position)[:100]}.") from error
    for name, value in values.items():
        if not isfinite(value):
            raise CommandRefused(f"Goal refused: position {name} is {value}; a position is a finite number of radians.")
    return {str(name): it for name, it in values.items()} if isinstance(position, Mapping) else tuple(values.values())
