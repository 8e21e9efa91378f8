"""A process that plans at the lowest priority, beside other work; it loads the planner alone."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache, partial

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import JointLimits, Joints, Side
from yumi.core.collision import CollisionPart, Obstacle
from yumi.planning.planner import Goal, Plan, Planner

_LOWEST_PRIORITY = 19


class PlanningProcess:
    """Plans in a process of its own, at the lowest priority; it is started with the first plan.

    A search takes all of a processor for seconds, which other threads would have to wait for.
    """

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._worker = 0  # its number

    async def plan(
        self,
        start: Mapping[Side, Joints],
        goal: Mapping[Side, Goal],
        *,
        timeout: float,
        speed_scale: float,
        grippers: Mapping[Side, GripperModules],
        tools: Mapping[Side, tuple[CollisionPart, ...]],
        obstacles: tuple[Obstacle, ...],
        limits: JointLimits,
    ) -> Plan:
        """As :meth:`Planner.plan` of a :class:`Planner` of these shapes and limits; the last one is kept."""
        loop = asyncio.get_running_loop()
        try:
            if self._pool is None:
                context = multiprocessing.get_context("spawn")  # a fork would have copies of this process's sockets
                self._pool = ProcessPoolExecutor(1, context, _begin_worker)
                self._worker = await loop.run_in_executor(self._pool, os.getpid)
            shapes = tuple(grippers.items()), tuple(tools.items()), obstacles, limits
            work = partial(_plan_in_worker, shapes, dict(start), dict(goal), timeout=timeout, speed_scale=speed_scale)
            return await loop.run_in_executor(self._pool, work)
        except BrokenProcessPool as error:
            self._pool = None
            raise CommandRefused(message("planning_process_ended")) from error

    def close(self) -> None:
        """End it, without waiting for a plan that is being made."""
        if self._pool is not None:
            for process in multiprocessing.active_children():
                if process.pid == self._worker:
                    process.terminate()
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None


_Shapes = tuple[
    tuple[tuple[Side, GripperModules], ...],
    tuple[tuple[Side, tuple[CollisionPart, ...]], ...],
    tuple[Obstacle, ...],
    JointLimits,
]
"""What a planner is made of, to be compared with that of the last one: grippers, tools, obstacles, limits."""


def _begin_worker() -> None:
    os.nice(_LOWEST_PRIORITY)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that has started this one


@lru_cache(maxsize=1)  # reading the shapes takes a while
def _planner(shapes: _Shapes) -> Planner:
    grippers, tools, obstacles, limits = shapes
    return Planner(dict(grippers), tools=dict(tools), obstacles=obstacles, limits=limits)


def _plan_in_worker(
    shapes: _Shapes,
    start: Mapping[Side, Joints],
    goal: Mapping[Side, Goal],
    *,
    timeout: float,
    speed_scale: float,
) -> Plan:
    return _planner(shapes).plan(start, goal, timeout=timeout, speed_scale=speed_scale)
