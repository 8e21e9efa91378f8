"""The check of a motion by RAPID: the whole path, with both arms, before the motion starts.

The limiter does not act on motions by RAPID: the controller carries them out without datagrams. So what is not known to
be clear does not start, and what a real robot does for the first time is slow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import ceil, radians
from threading import Lock
from typing import Any, cast

import numpy as np

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, chain_from_abb, joint_names
from abb_runtime.rws.client import RwsClient
from yumi.control.collisions import declared_margins
from yumi.core.collision import CollisionModel
from yumi.driver.controller_panel import ControllerPanel
from yumi.driver.state_machine import MAIN_MODULE, RAPID_MODULE, MachineState, StateMachines

FIRST_RATIO = 10
"""Speed ratio of the first run of a routine on a real robot [%]."""

_UTILITY = "TRobUtility"
_MOVE_NOTHING = frozenset({"runmoduleload", "runmoduleunload"})
_NEVER_KNOWN = frozenset({"runmovej", "runcallbyvar"})  # each run has another goal, or runs another procedure
_STEP = 0.005  # [rad] that all joints together turn between two samples: no part moves by half a margin
_UNUSED = 1e8  # RAPID_MODULE's 9E9, an axis without a value
_WITHIN = 0.1  # [m] parts that are further apart are not compared


class RapidMotionCheck:
    """What the driver knows of motions by RAPID before it starts them.

    Args:
        client: a connected client.
        panel: of the same controller.
        machines: the state machines on it.
        model: the shapes of both arms and of what stands around them; None: nothing keeps them apart.
        margin: no two parts come nearer to each other [m].
        is_real: asks whether a path that is not known has to be named so, and a first run is slow.
    """

    def __init__(
        self,
        client: RwsClient,
        panel: ControllerPanel,
        machines: StateMachines,
        model: CollisionModel | None,
        margin: float,
        *,
        is_real: Callable[[], bool],
    ) -> None:
        self._client, self._panel, self._machines, self._is_real = client, panel, machines, is_real
        self._model = model
        self._margins = None if model is None else declared_margins(model, margin)
        self._lock = Lock()  # the model is not for several threads at once
        self._have_run: dict[Side, set[tuple[int, str]]] = {side: set() for side in Side}  # each in a session

    def check_routine(self, side: Side, routine: str, *, is_unchecked: bool) -> None:
        """See that the path of a routine is clear for both arms.

        Args:
            side: whose task runs it.
            routine: its name.
            is_unchecked: whether it may run though its path is not known.

        Raises:
            CommandRefused: the arms, or what stands around them, would come too near; or the path is not known, as of
                any routine but ``runMoveAbsJ`` and ``runMoveToCalibrationPosition``.
            RobotNotReady: the other arm may move meanwhile.
        """
        if routine.lower() in _MOVE_NOTHING:
            return
        goal = self._goal(side, routine.lower())
        if goal is None:
            if not is_unchecked and self._is_real():
                raise CommandRefused(message("rapid_path_unknown", routine=routine, task=side.task))
            return
        if self._machines.state(side.other) is not MachineState.IDLE:
            raise RobotNotReady(message("rapid_beside_moving_arm", arm=side.other.word, routine=routine))
        starts = {each: self._client.joint_target(each.unit) for each in Side}
        self._check_path(side, routine, starts, goal)

    def check_start(self) -> None:
        """See that the program moves nothing when it is started where its pointers are.

        Raises:
            RobotNotReady: a real robot's program stands in the middle of a routine, whose motion would go on.
        """
        for side in Side if self._is_real() else ():
            pointer, _ = self._client.pointers(side.task)
            if pointer.module.lower() != MAIN_MODULE.lower():
                place = f"{pointer.module}/{pointer.routine}"
                raise RobotNotReady(message("rapid_start_in_routine", task=side.task, place=place))

    @contextmanager
    def slow_first(self, side: Side, routine: str, has_begun: Callable[[], bool]) -> Iterator[None]:
        """Run a routine with :data:`FIRST_RATIO` if a real robot has not run it to the end before.

        Args:
            side: whose task runs the routine.
            routine: its name.
            has_begun: whether the routine may have begun to run.

        Raises:
            RobotNotReady: it is not known that the routine has ended. It may go on, so the ratio stays low.
        """
        name, known = routine.lower(), self._have_run[side]
        if name in _MOVE_NOTHING:
            known.clear()  # routines of the task may be others from now on, whatever becomes of the load
            yield
            return
        ratio = self._client.speed_ratio() if self._is_real() else 0
        run = self._client.login_count, name  # in the next session another controller may answer
        if ratio <= FIRST_RATIO or run in known:
            yield
        else:
            self._panel.set_speed_ratio(FIRST_RATIO)
            try:
                yield
            except YumiError as error:
                if has_begun() and not isinstance(error, CommandRefused):
                    raise RobotNotReady(message("first_run_stays_slow", why=error.said, ratio=FIRST_RATIO)) from error
                self._restore(ratio)
                raise
            self._restore(ratio)
        if name not in _NEVER_KNOWN:
            known.add(run)

    def _restore(self, ratio: int) -> None:
        if self._client.speed_ratio() == FIRST_RATIO:  # a person may have chosen another one meanwhile
            self._panel.set_speed_ratio(ratio)

    def _goal(self, side: Side, routine: str) -> Joints | None:
        """Where a routine goes on a straight way in joints [rad]; None where its way is not known."""
        if routine == "runmoveabsj":
            robax, external = cast(
                "tuple[Any, Any]", self._client.value(side.task, RAPID_MODULE, "move_jointtarget_input")
            )
            return None if external[0] >= _UNUSED else _in_chain((*robax, external[0]))
        if routine == "runmovetocalibrationposition":
            values = cast("tuple[Any, ...]", self._client.value(side.task, _UTILITY, "calibration_values"))
            here = chain_from_abb((0, 1, 2, 3, 4, 5), 6)  # ABB's index of each joint in chain order
            now = self._client.joint_target(side.unit)
            rows = zip(here, now, strict=True)
            first, *rest = (values[2 * int(axis) + 1] if values[2 * int(axis)] else at for axis, at in rows)
            return (first, *rest)
        return None

    def _check_path(self, side: Side, routine: str, starts: Mapping[Side, Joints], goal: Joints) -> None:
        for name, angle, lower, upper in zip(
            joint_names(side), goal, YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True
        ):
            if not lower <= angle <= upper:
                raise CommandRefused(
                    message(
                        "rapid_goal_out_of_range", routine=routine, joint=name, position=angle, lower=lower, upper=upper
                    )
                )
        if self._model is None or self._margins is None:
            return
        start, way = np.array(starts[side]), np.subtract(goal, starts[side])
        count = max(1, ceil(float(np.abs(way).sum()) / _STEP))
        with self._lock:
            for share in np.linspace(0.0, 1.0, count + 1):
                both = np.concatenate([start + share * way if it is side else np.array(starts[it]) for it in Side])
                for alone in (None, side):
                    for near in self._model.contacts(both, _WITHIN, alone):
                        one, other = near["parts"]
                        if near["distance"] < self._margins[one, other]:
                            raise CommandRefused(
                                message(
                                    "rapid_path_too_near",
                                    routine=routine,
                                    part=self._model.names[one],
                                    other=self._model.names[other],
                                    share=100.0 * float(share),
                                )
                            )


def _in_chain(degrees: tuple[float, ...]) -> Joints:
    """Angles of RAPID [deg], the seventh axis last, in chain order [rad]."""
    *robax, seventh = (radians(float(value)) for value in degrees)
    return chain_from_abb(robax, seventh)
