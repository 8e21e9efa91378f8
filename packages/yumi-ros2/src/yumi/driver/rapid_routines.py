"""RAPID routines run by name in the state machines on the robot, and modules loaded for them."""

from __future__ import annotations

import re
from collections.abc import Callable

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, ControllerRefused, RobotNotReady
from abb_protocols.robot.joints import Side
from abb_runtime.clock import Clock, wait_until
from abb_runtime.rws.client import RwsClient
from yumi.driver.controller_panel import RAPID_NAME, ControllerPanel
from yumi.driver.rapid_motion_check import RapidMotionCheck
from yumi.driver.readiness import ConditionalRequest, check_request
from yumi.driver.robot_state import RobotState
from yumi.driver.state_machine import RAPID_MODULE, ROUTINE_NAME_SYMBOL, RUN_RAPID_SIGNAL, MachineState, StateMachines

LONGEST_ROUTINE = 300.0
"""Longest wait for the end of a routine [s]; it goes on, only the wait ends."""
_FILE_NAME = re.compile(r"[A-Za-z]\w{0,31}\.(mod|sys)", re.IGNORECASE)
_MODULE_DECLARATION = re.compile(r"^\s*MODULE\s+([A-Za-z]\w{0,31})", re.IGNORECASE | re.MULTILINE)
_OUR_MODULES = "trob"  # how those of the state machine begin


class RapidRoutines:
    """Runs routines in the tasks of both arms, one at a time: both tasks see the edge that starts one.

    Args:
        client: a connected client.
        panel: of the same controller.
        machines: the state machines.
        clock: for waiting.
        check: of the motions; None: they are not checked.

    Attributes:
        is_running: whether the end of one is awaited.
    """

    def __init__(
        self,
        client: RwsClient,
        panel: ControllerPanel,
        machines: StateMachines,
        clock: Clock,
        check: RapidMotionCheck | None = None,
    ) -> None:
        self._client = client
        self._panel = panel
        self._machines = machines
        self._clock = clock
        self._check = check
        self.is_running = self._has_begun = False

    def run(
        self, side: Side, name: str, *, is_unchecked: bool = False, step: Callable[[str], None] = lambda name: None
    ) -> None:
        """Run a routine in one arm's task and wait for its end. The limiter does not act on motions by RAPID.

        Args:
            side: whose task.
            name: of the state machine's own (``runMoveToCalibrationPosition``, ``runMoveJ``, ``runMoveAbsJ``,
                ``runCallByVar``), of your ``TRobSystem``, or of any procedure without parameters in the task.
            is_unchecked: whether a routine may run whose path is not known, see :class:`.RapidMotionCheck`.
            step: called once all is checked, before the routine starts; raises where it must not start any more.

        Raises:
            CommandRefused: it is not a name of a routine, or its path is not clear or not known; nothing was changed.
            RobotNotReady: the program does not run, the arm is busy, or the routine did not end in time.
        """
        if not RAPID_NAME.fullmatch(name):
            raise CommandRefused(message("no_routine_name", name=name))
        self._check_free(side, ConditionalRequest.RUN_ROUTINE)
        if self._check is None:
            self._run(side, name, step)
            return
        self._check.check_routine(side, name, is_unchecked=is_unchecked)
        with self._check.slow_first(side, name, lambda: self._has_begun):
            self._run(side, name, step)

    def _run(self, side: Side, name: str, step: Callable[[str], None]) -> None:
        def why_not_ended() -> Message:
            code = "routine_not_ended" if self._client.speed_ratio() > 0 else "routine_without_speed"
            return message(code, routine=name, task=side.task, duration=LONGEST_ROUTINE)

        self.is_running, self._has_begun = True, False  # a stop request ends the program from here on
        try:
            step(f"run {name}")
            self._has_begun = True
            self._client.set_value(side.task, RAPID_MODULE, ROUTINE_NAME_SYMBOL, name)
            self._client.set_value(side.other.task, RAPID_MODULE, ROUTINE_NAME_SYMBOL, "")
            self._client.pulse_signal(RUN_RAPID_SIGNAL)
            wait_until(
                self._clock,
                lambda: self._is_over(side),
                LONGEST_ROUTINE,
                why_not_ended,
            )
        finally:
            self.is_running = False
        try:
            is_unknown = self._client.symbol(side.task, RAPID_MODULE, "is_routine_unknown") == "TRUE"
        except ControllerRefused:  # ABB's own state machine does not report it
            is_unknown = False
        if is_unknown:
            raise CommandRefused(message("routine_unknown", task=side.task, routine=name))

    def load_module(self, side: Side, file_name: str, text: str) -> None:
        """Write a RAPID module into the controller's HOME folder and load it into one arm's task.

        A module that was loaded from the same file before is replaced. The state machine loads it, so that the program
        goes on meanwhile.

        Args:
            side: whose task.
            file_name: such as ``Pick.mod``.
            text: the module.

        Raises:
            CommandRefused: name or text is impossible, the text is not RAPID, or the module is there from another file.
            RobotNotReady: the program does not run, or the arm is busy.
        """
        module = _module_in(file_name, text)
        self._check_free(side, ConditionalRequest.LOAD_MODULE)
        path = f"HOME:/{file_name}"
        if self._has_module(side, module):
            self._run_with_file(side, "runModuleUnload", path)
            if self._has_module(side, module):
                raise CommandRefused(message("module_from_other_file", task=side.task, module=module))
        self._client.upload(path, text)
        self._run_with_file(side, "runModuleLoad", path)
        if not self._has_module(side, module):
            raise CommandRefused(message("module_not_loaded", task=side.task, path=path))

    def _run_with_file(self, side: Side, routine: str, path: str) -> None:
        self._client.set_value(side.task, RAPID_MODULE, "module_file_path_input", path)
        self.run(side, routine)

    def _has_module(self, side: Side, name: str) -> bool:
        return any(module.name.lower() == name.lower() for module in self._client.modules(side.task))

    def _check_free(self, side: Side, request: ConditionalRequest) -> None:
        client = self._client
        machines = dict.fromkeys(Side, self._machines.state(side))
        state = RobotState(True, client.operating_mode(), execution=client.execution(), machines=machines)
        check_request(request, state, (side,))

    def _is_over(self, side: Side) -> bool:
        """The name is cleared when the routine has ended, in the same step in which the machine becomes idle."""
        if not self._panel.is_running:
            raise RobotNotReady(message("program_stopped_in_routine", task=side.task))
        if self._client.symbol(side.task, RAPID_MODULE, ROUTINE_NAME_SYMBOL) != '""':
            return False
        return self._machines.state(side) is MachineState.IDLE


def _module_in(file_name: str, text: str) -> str:
    """The name of the module that ``text`` declares."""
    if not _FILE_NAME.fullmatch(file_name):
        raise CommandRefused(message("no_rapid_file_name", name=file_name))
    found = _MODULE_DECLARATION.search(text)
    if found is None:
        raise CommandRefused(message("text_without_module", file=file_name))
    if found[1].lower().startswith(_OUR_MODULES):
        raise CommandRefused(message("module_name_reserved", module=found[1]))
    return found[1]
