"""Our control loop with nothing beside it."""

from __future__ import annotations

from driven_loop import DrivenLoop, read_arguments, read_plan
from parent import end_with_parent

if __name__ == "__main__":  # the control process imports this module again
    end_with_parent()
    arguments = read_arguments()
    settings, plan = read_plan(arguments)
    line = DrivenLoop(settings, plan, arguments.goal)
    line.start()
    line.run()
