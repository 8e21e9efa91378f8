"""Motions that a page plans: in a process of its own, since a search takes all of a processor for seconds."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import msgspec

from yumi.driver.endpoint import Surroundings
from yumi.errors import CommandRefused
from yumi.robot.joints import YUMI_LIMITS, Joints, Pose, Side
from yumi.web.shapes import shapes_of

if TYPE_CHECKING:
    from yumi.planning.planner import Plan, Planner

SPEED_SCALE = 0.5
"""Share of the joints' speeds that a page plans for, before speed_scale."""

_TIMEOUT = 20.0  # [s] for one plan
_LOWEST_PRIORITY = 19


class PlanningProcess:
    """Plans in a process of its own, at the lowest priority; it is started with the first plan."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._worker = 0  # its number

    async def plan(
        self, surroundings: Surroundings, start: Mapping[Side, Joints], goal: Mapping[Side, Joints | Pose]
    ) -> Plan:
        """A motion of the arms in ``goal`` [rad], or tool0 in the body's frame; raises as :meth:`Planner.plan`."""
        loop = asyncio.get_running_loop()
        try:
            if self._pool is None:
                context = multiprocessing.get_context("spawn")  # a fork would have copies of this process's sockets
                self._pool = ProcessPoolExecutor(1, context, _begin)
                self._worker = await loop.run_in_executor(self._pool, os.getpid)
            shapes = msgspec.json.encode(surroundings)
            return await loop.run_in_executor(self._pool, _plan, shapes, dict(start), dict(goal))
        except BrokenProcessPool as error:
            self._pool = None
            raise CommandRefused("The process that plans has ended before its plan was made; plan again.") from error

    def close(self) -> None:
        """End it, without waiting for a plan that is being made."""
        if self._pool is not None:
            for process in multiprocessing.active_children():
                if process.pid == self._worker:
                    process.terminate()
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None


def _begin() -> None:
    os.nice(_LOWEST_PRIORITY)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that has started this one


@lru_cache(maxsize=1)  # reading the shapes takes a while
def _planner(surroundings: bytes) -> Planner:
    from yumi.planning.planner import Planner  # noqa: PLC0415 - an extra; nothing else needs it

    known = msgspec.json.decode(surroundings, type=Surroundings)
    grippers, tools, obstacles = shapes_of(known)
    limits = YUMI_LIMITS if known.velocity is None else replace(YUMI_LIMITS, velocity=known.velocity)
    return Planner(grippers, tools=tools, obstacles=obstacles, limits=limits)


def _plan(surroundings: bytes, start: Mapping[Side, Joints], goal: Mapping[Side, Joints | Pose]) -> Plan:
    return _planner(surroundings).plan(start, goal, timeout=_TIMEOUT, speed_scale=SPEED_SCALE)
