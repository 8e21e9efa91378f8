"""RAPID's synchronization of tasks: WaitSyncTask, and synchronized movements (application manual MultiMove)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from virtual_irc5.instructions.moves import standing
from virtual_irc5.instructions.robot_data import ROBOT_DATA
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.rapid import Call, Library, RapidRuntimeError, Wait

MULTIMOVE = Library(ROBOT_DATA)


class SyncPoints:
    """Points where RAPID tasks wait for one another: the n-th arrival of one task meets the n-th of each other."""

    def __init__(self) -> None:
        self._arrivals: Counter[tuple[str, str]] = Counter()

    def arrive(self, point: str, task: str) -> int:
        """Count an arrival of a task at a point; its number."""
        self._arrivals[point, task] += 1
        return self._arrivals[point, task]

    def have_met(self, point: str, arrival: int, tasks: Iterable[str]) -> bool:
        """Whether every task has come to the point at least ``arrival`` times."""
        return all(self._arrivals[point, task] >= arrival for task in tasks)

    def leave(self, point: str, task: str) -> None:
        """Take an arrival back: the task waits no longer."""
        self._arrivals[point, task] -= 1


class MultiMoveInstructions:
    """The synchronization of one task."""

    def __init__(self, unit: ArmUnit, sync_points: SyncPoints) -> None:
        self._unit, self._sync_points = unit, sync_points

    @MULTIMOVE.instruction("WaitSyncTask", r"\switch InPos, VAR syncident SyncID, anytype TaskList, \num TimeOut")
    def wait_sync(self, call: Call) -> Wait:
        """Until every task of the list is here, or ERR_WAITSYNCTASK after the time-out."""
        while call.present("InPos") and not self._unit.arm.is_stationary:
            yield None
        tasks = [task.taskname for task in call["TaskList"]]
        yield from self._meet(call, call.reference("SyncID").name.lower(), tasks, "ERR_WAITSYNCTASK")

    def _meet(self, call: Call, point: str, tasks: Sequence[str], error: str) -> Wait:
        """Until every task is at a point; raises the error after the call's time-out."""
        arrival = self._sync_points.arrive(point, call.task.name)
        deadline = call.task.now + call.get("TimeOut", float("inf"))
        try:
            while not self._sync_points.have_met(point, arrival, tasks):
                if call.task.now >= deadline:
                    raise RapidRuntimeError(error, f"The other tasks did not come to {point} in time.")
                yield None
        except (GeneratorExit, RapidRuntimeError):
            self._sync_points.leave(point, call.task.name)
            raise

    # Synchronized movements (application manual MultiMove): moves with the same ID begin together.

    @MULTIMOVE.instruction("SyncMoveOn", r"VAR syncident SyncID, anytype TaskList, \num TimeOut")
    def sync_move_on(self, call: Call) -> Wait:
        """When every task of the list is here and stands, their moves are synchronized."""
        yield from standing(self._unit.arm)
        tasks = tuple(task.taskname for task in call["TaskList"])
        if call.task.name.upper() not in (name.upper() for name in tasks):
            raise RapidRuntimeError("ERR_SYNCMOVEON", f"{call.task.name} is not in the list of {call.name}.")
        yield from self._meet(call, call.reference("SyncID").name.lower(), tasks, "ERR_SYNCMOVEON")
        self._unit.synchronized_tasks = tasks

    @MULTIMOVE.instruction("SyncMoveOff", r"VAR syncident SyncID, \num TimeOut")
    def sync_move_off(self, call: Call) -> Wait:
        """When every synchronized task is here and stands, each moves by itself again."""
        yield from standing(self._unit.arm)
        tasks = self._unit.synchronized_tasks or (call.task.name,)
        yield from self._meet(call, call.reference("SyncID").name.lower(), tasks, "ERR_SYNCMOVEOFF")
        self._unit.synchronized_tasks = ()

    @MULTIMOVE.instruction("SyncMoveUndo")
    def sync_move_undo(self, call: Call) -> None:
        """Moves of this task are not synchronized any more, wherever the others are."""
        self._unit.synchronized_tasks = ()

    @MULTIMOVE.instruction("SyncMoveSuspend")
    def suspend_sync(self, call: Call) -> Wait:
        r"""Until SyncMoveResume each task moves by itself, after StorePath\KeepSync."""
        if not self._unit.synchronized_tasks or self._unit.path_level == 1:
            sentence = f"{call.name} comes after StorePath\\KeepSync of synchronized movements."
            raise RapidRuntimeError("ERR_SYNCMOVEOFF", sentence)
        yield from self._meet(call, "SyncMoveSuspend", self._unit.synchronized_tasks, "ERR_SYNCMOVEOFF")
        self._unit.suspended_tasks, self._unit.synchronized_tasks = self._unit.synchronized_tasks, ()

    @MULTIMOVE.instruction("SyncMoveResume")
    def resume_sync(self, call: Call) -> Wait:
        """The movements are synchronized again."""
        if not self._unit.suspended_tasks:
            raise RapidRuntimeError("ERR_SYNCMOVEON", f"{call.name} comes after SyncMoveSuspend.")
        yield from standing(self._unit.arm)
        yield from self._meet(call, "SyncMoveResume", self._unit.suspended_tasks, "ERR_SYNCMOVEON")
        self._unit.synchronized_tasks, self._unit.suspended_tasks = self._unit.suspended_tasks, ()

    @MULTIMOVE.function("IsSyncMoveOn", "", "bool")
    def is_synchronized(self, call: Call) -> bool:
        return bool(self._unit.synchronized_tasks)

    @MULTIMOVE.function("TasksInSync", "INOUT tasks TaskList{*}", "num")
    def tasks_in_sync(self, call: Call) -> float:
        """Writes the tasks whose moves are synchronized, and how many they are."""
        reference = call.reference("TaskList")
        names = self._unit.synchronized_tasks
        rows = [(name,) for name in names] + [("",)] * len(reference.value)
        call["TaskList"] = reference.type.convert(rows[: len(reference.value)])
        return len(names)

    def synchronized(self, move: Callable[[Call], Wait]) -> Callable[[Call], Wait]:
        """A move that waits for the moves of the same ID where movements are synchronized."""

        def meet_and_move(call: Call) -> Wait:
            tasks = self._unit.synchronized_tasks
            if tasks:
                if not call.present("ID"):
                    sentence = f"{call.name} needs \\ID while movements are synchronized."
                    raise RapidRuntimeError("ERR_ARGVALERR", sentence)
                yield from self._meet(call, f"the move {call['ID']:g}", tasks, "ERR_SYNCMOVEON")
            yield from move(call)

        return meet_and_move
