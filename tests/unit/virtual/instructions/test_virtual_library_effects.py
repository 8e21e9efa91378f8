"""What RAPID's instructions do that need the whole controller: the programs of `effects.txt`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "rapid"))

from test_rapid_library_effects import Effect, effects

from virtual_irc5.rapid.states import Execution
from virtual_irc5.world import World

MODULE = "MODULE Program\n{declarations}\nPROC main()\n{body}\nENDPROC\nENDMODULE\n"
MOST_CYCLES = 1000
OTHER = MODULE.format(declarations="PERS num theirs:=5;\nVAR num variable:=6;", body="WaitTime 100;")


@pytest.mark.parametrize("effect", effects(Path(__file__).with_name("effects.txt")), ids=lambda each: each.names[0])
def test_effect(effect: Effect) -> None:
    world = World()
    controller = world.controller
    text = MODULE.format(declarations="\n".join(effect.declarations), body="\n".join(effect.body))
    for name, module in (("T_ROB_R", text), ("T_ROB_L", OTHER)):
        task = controller.tasks[name]
        task.lose_pp()
        for old in task.modules:
            task.unload(old.name)
        task.load(module, "program.mod")
    controller.execution.move_pp_to_main()
    controller.set_motors(True)
    controller.start_rapid("once")
    for _ in range(MOST_CYCLES):
        if controller.tasks["T_ROB_R"].execution is not Execution.STARTED:
            break
        world.cycle({})
    if effect.lines == ["(restarts)"]:
        assert (controller.is_restarting, controller.screens["T_ROB_R"]) == (True, ())
    else:
        assert list(controller.screens["T_ROB_R"]) == effect.lines, controller.events.entries()[:3]
