"""What a person sees of the demonstration: numbered steps, the joint error shrinking, a final table."""

from __future__ import annotations

import sys
import termios
from collections.abc import Callable, Mapping
from math import degrees
from select import select
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn
from rich.table import Table

from yumi.robot.joints import Side
from yumi.ros.move_and_grab import ArmReport

_GLANCE = 0.1  # [s]


class DemoScreen:
    """Shows progress on the terminal, or as plain lines where there is none."""

    def __init__(self) -> None:
        self._console = Console(highlight=False)
        self._bars = Progress(
            TextColumn("     {task.description}"),
            BarColumn(bar_width=32),
            TextColumn("joint error {task.fields[error]:6.2f}°"),
            console=self._console,
            transient=False,
        )
        self._tasks: dict[Side, TaskID] = {}
        self._told: dict[Side, float] = {}
        self._count = 0

    def __enter__(self) -> DemoScreen:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def step(self, sentence: str) -> None:
        self._count += 1
        self._bars.console.print(f"[bold cyan]{self._count:2d}[/]  {sentence}")

    def note(self, sentence: str) -> None:
        self._bars.console.print(f"    [green]✓[/] {sentence}")

    def error(self, side: Side, error_deg: float, share: float) -> None:
        if side not in self._tasks:
            self._tasks[side] = self._bars.add_task(f"{side.word} arm", total=1.0, error=error_deg)
        self._bars.update(self._tasks[side], completed=min(max(share, 0.0), 1.0), error=error_deg)
        if not self._console.is_terminal:
            self._tell(side, error_deg)

    def confirm(self, sentence: str, check: Callable[[], None]) -> bool:
        """Ask on the terminal whether the robot may go on; False without a terminal.

        Args:
            sentence: what happened, and what to look at.
            check: called while nobody answers; raises when there is no use in waiting any more.
        """
        if not (sys.stdin.isatty() and self._console.is_terminal):
            return False
        was_shown = self._bars.live.is_started
        self._bars.stop()
        try:
            self._console.print(f"[bold yellow]{escape(sentence)}[/]")
            termios.tcflush(sys.stdin, termios.TCIFLUSH)  # an answer to what was not yet on the screen is none
            self._console.print("Type yes when the robot may move, anything else ends the demonstration: ", end="")
            while not select([sys.stdin], [], [], _GLANCE)[0]:  # Ctrl-C must end it, which a plain read would not see
                check()
            return sys.stdin.readline().strip().lower() == "yes"
        finally:
            if was_shown:
                self._bars.start()

    def _tell(self, side: Side, error_deg: float) -> None:
        """Where no bar can move: a line whenever the error has become half as large."""
        if error_deg <= self._told.get(side, 2.0 * error_deg) / 2.0:
            self._told[side] = error_deg
            self._console.print(f"     {side.word} arm: joint error {error_deg:6.2f}°")

    def table(self, reports: Mapping[Side, ArmReport]) -> None:
        """Print what became of each arm."""
        table = Table("arm", "time to goal", "joint error", "missed cycles", "gripper")
        for side, report in reports.items():
            grip = f"{report.grip.word} at {report.grip.position * 1e3:.1f} mm" if report.grip else "-"
            table.add_row(
                side.word,
                f"{report.duration:.2f} s",
                f"{degrees(report.final_error):.3f}°",
                str(report.missed),
                grip,
            )
        self._console.print(table)
