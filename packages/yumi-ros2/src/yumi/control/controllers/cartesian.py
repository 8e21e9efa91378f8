"""The Cartesian controller: straight lines of the tool, and streams of its poses or velocities.

Lines are planned before they begin (:mod:`yumi.planning.tool_path`) and arrive as trajectories: this controller follows
them as the joint trajectory controllers do. Streams are followed in every cycle
(:class:`yumi.control.controllers.tool_stream.ToolStream`).
"""

from __future__ import annotations

from math import inf, sqrt

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import JOINT_COUNT, YUMI_LIMITS, ArmCommand, ArmState, JointLimits, Joints, Side, joints
from abb_runtime.parameters import Parameter, Values, number
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.controllers.tool_stream import QUIET_TOOL_STREAM, SHARE_OF_SPEED, ToolStream
from yumi.control.goals import Buffer, GoalKind, MessageInbox
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.place import Place
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.tool_goal import ToolGoal
from yumi.control.tool_limits import ToolLimited, ToolLimits
from yumi.control.trajectory_commands import CancelTrajectory, ResultCode, TrajectoryOutcome

_RADIANS_PER_METRE = 6.0  # accelerations and jerks of the orientation beside those of the tool
_PARAMETERS = (
    Parameter("tool.speed", 0.5, 0.001, 1.5, "m/s", "Of the tool while it follows a stream, at most."),
    Parameter("tool.turning", 2.0, 0.01, 6.3, "rad/s", "Of its orientation and of the elbow, at most."),
    Parameter("tool.acceleration", 4.0, 0.1, 20.0, "m/s²", "Of the tool, at most."),
    Parameter("tool.jerk", 80.0, 1.0, 1000.0, "m/s³", "Of the tool, at most."),
    Parameter("twist.timeout", 0.1, 0.01, 2.0, "s", "Without a new velocity for so long, the tool stops."),
    Parameter(
        "tracking.delay", RESPONSE_DELAY, 0.0, 0.2, "s", "From a command to the motion it makes; how far to predict."
    ),
    Parameter("tracking.memory", 0.030, 0.005, 0.5, "s", "How long a pose counts; more against noise."),
    Parameter("tracking.stiffness", 30.0, 5.0, 100.0, "1/s", "How closely it is followed; less against noise."),
    Parameter("tracking.silence", 0.030, 0.010, 0.5, "s", "Without a pose for so long, the stream has ended."),
    Parameter("line.speed", 0.25, 0.001, 1.5, "m/s", "Of the tool on lines that name no speed."),
    Parameter("line.turning", 1.5, 0.01, 6.3, "rad/s", "Of its orientation on lines that name none."),
    Parameter("line.acceleration", 1.0, 0.01, 1.0, "", "Share of the accelerations and jerks on lines."),
)


class CartesianController(JointTrajectoryController):
    """Follows lines that were planned, and streams of poses and velocities of the tool.

    Args:
        side: its arm.
        goals: where messages of streams arrive.
        feedback: where others see how it follows a line.
        limits: what the joints may do.
        speed: the factor on the arm's speed.
        within: what the tool keeps on streams; lines are planned within it.
    """

    kind = "yumi_controllers/CartesianController"
    goal_kind = GoalKind.TOOL

    def __init__(
        self,
        side: Side,
        goals: Buffer[ToolGoal],
        feedback: Buffer[TrajectoryFeedback],
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
        within: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
    ) -> None:
        super().__init__(side, feedback, limits, speed)
        self._within = within
        self._held_by, self._held_at = "", -inf
        self._caps = (inf, inf)  # of the stream's speeds, as its messages have them
        self._inbox = MessageInbox(goals)
        self._is_ended = False  # its stream, until it is activated anew
        self._values: Values = {each.name: each.default for each in _PARAMETERS}

    @classmethod
    def make(cls, place: Place) -> CartesianController:
        return cls(
            place.side, place.buffers.tool_goals, place.buffers.tool_path, place.limits, place.speed, place.tool_limits
        )

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (*_PARAMETERS, *super().parameters(joint_names))

    def configure(self, values: Values) -> None:
        super().configure(values)
        self._values = values

    def activate(self, state: ArmState) -> None:
        super().activate(state)
        self._inbox.forget()
        self._is_ended = False

    def update(self, state: ArmState) -> ArmCommand | None:
        if self._standstill is None and not self._is_ended:
            goal = self._inbox.take_newest(state.session)
            if goal is not None:
                self._take(goal, state)
        stream = self._source
        if not isinstance(stream, ToolStream):
            return super().update(state)
        self._state = state
        values = self._values
        self._position, self._velocity = command = stream.step(
            state, number(values, "tracking.delay"), number(values, "twist.timeout"), self._speed.value
        )
        self._is_judged = False
        if stream.wall:
            if stream.wall != self._held_by or state.time - self._held_at > QUIET_TOOL_STREAM:
                self._reports.append(ToolLimited(stream.wall))
            self._held_by, self._held_at = stream.wall, state.time
        is_over = stream.is_over(state.time)
        if (is_over or stream.is_stopping) and self._is_held_back(state):
            self._hold(state)
            return None
        if is_over:
            self._rest_at(self._position)
        return command

    def end_stream(self, state: ArmState) -> bool:
        self._is_ended = True
        self.receive(CancelTrajectory(), state)
        return True

    def note_withheld(self, position: Joints) -> None:
        if not isinstance(self._source, ToolStream):
            super().note_withheld(position)

    def is_idle(self, now: float) -> bool:
        return super().is_idle(now) and not isinstance(self._source, ToolStream)

    def _take(self, goal: ToolGoal, state: ArmState) -> None:
        stream, values = self._source, self._values
        caps = min(inf, goal.speed), min(inf, goal.turning)  # of two with a NaN, min takes the first
        if not isinstance(stream, ToolStream) or (stream.tool, self._caps) != (goal.tool, caps):
            self._caps = caps
            start = self._source.setpoint(self._time)
            # Speeds change from cycle to cycle: by the mean acceleration of the last one.
            middle = self._source.setpoint(max(0.0, self._time - 0.5 * state.dt))
            start = start._replace(acceleration=middle.acceleration)
            if self._goal is not None:
                start = start.scaled(self._pace)
            self._end(TrajectoryOutcome.ABORTED, ResultCode.INVALID_GOAL, message("motion_replaced_by_stream"))
            within = ToolLimits(min(self._within.speed, caps[0] / SHARE_OF_SPEED), self._within.walls, caps[1])
            speed, turning = number(values, "tool.speed"), min(number(values, "tool.turning"), caps[1])
            # Poses are followed in each direction alone.
            directions = 1.0 if goal.is_twist else sqrt(3.0)
            speed = min(speed, SHARE_OF_SPEED * within.speed / directions)
            strength, jerk = number(values, "tool.acceleration"), number(values, "tool.jerk")
            hard, harder = _RADIANS_PER_METRE * strength, _RADIANS_PER_METRE * jerk
            far = (1e6,) * JOINT_COUNT
            tool_limits = JointLimits(
                joints([-each for each in far]),
                joints(far),
                (speed, speed, speed, turning, turning, turning, turning),
                (strength, strength, strength, hard, hard, hard, hard),
                (jerk, jerk, jerk, harder, harder, harder, harder),
            )
            stream = ToolStream(
                self._side,
                goal.tool,
                start,
                self._limits,
                tool_limits,
                number(values, "tracking.stiffness"),
                within,
            )
            stream.predictor.memory = number(values, "tracking.memory")
            stream.silence = number(values, "tracking.silence")
            self._source, self._time = stream, 0.0
        stream.take(goal, state.time)

    def receive(self, command: object, state: ArmState | None) -> None:
        super().receive(command, state)
        if isinstance(command, CancelTrajectory):
            self._inbox.forget()  # a message that was not taken yet, as while the arm is held, would begin a new stream
            if isinstance(self._source, ToolStream):
                self._brake()
