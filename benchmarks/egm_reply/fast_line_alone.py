"""Our fast line with nothing beside it."""

from __future__ import annotations

from guided_line import GuidedLine, read_arguments, read_plan
from parent import end_with_parent

if __name__ == "__main__":  # the fast-line process imports this module again
    end_with_parent()
    arguments = read_arguments()
    settings, plan = read_plan(arguments)
    line = GuidedLine(settings, plan, arguments.goal)
    line.start()
    line.run()
