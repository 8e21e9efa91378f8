"""Many service calls at once: each is answered, and the arms go on meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from controller_manager_msgs.srv import ListControllers
from diagnostic_msgs.msg import DiagnosticStatus
from process_sizes import settled_sizes
from rclpy.qos import QoSProfile
from ros_bench import Client
from std_srvs.srv import Trigger

from abb_runtime.process.command_process import CommandProcess

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

CALLS = 500
GROWTH_KB = 8192
"""What the driver's memory may grow by: the calls themselves wait there."""


@pytest.fixture
def callers(egm_running: Client) -> Iterator[list[Any]]:
    """Clients that wait for as many answers as there are calls; the default of 10 would lose answers at this end."""
    node, depth = egm_running.node, QoSProfile(depth=CALLS)
    callers = [
        node.create_client(Trigger, "yumi_robot_manager/get_state", qos_profile=depth),
        node.create_client(ListControllers, "r/controller_manager/list_controllers", qos_profile=depth),
    ]
    for caller in callers:
        egm_running.until(caller.service_is_ready)
    yield callers
    for caller in callers:
        node.destroy_client(caller)


def test_500_calls_at_once_are_all_answered_while_egm_goes_on_and_leave_nothing_behind(
    egm_running: Client, driver: CommandProcess, callers: list[Any]
) -> None:
    statuses: list[dict[str, str]] = []

    def take(status: DiagnosticStatus) -> None:
        statuses.append({value.key: value.value for value in status.values})

    egm_running.node.create_subscription(DiagnosticStatus, "r/egm_state", take, 1)
    egm_running.until(lambda: bool(statuses), what="the state of EGM")
    before, first = settled_sizes(driver.pid), statuses[-1]

    answers = [callers[number % 2].call_async(callers[number % 2].srv_type.Request()) for number in range(CALLS)]
    egm_running.until(lambda: all(answer.done() for answer in answers), what=f"{CALLS} answers")
    assert all(answer.result().success for answer in answers[::2])
    assert all(answer.result().controller for answer in answers[1::2])

    seen = len(statuses)
    egm_running.until(lambda: len(statuses) > seen, what="the state of EGM")
    last = statuses[-1]
    assert last["session"] == first["session"]
    assert int(last["cycles"]) > int(first["cycles"])
    after = settled_sizes(driver.pid)
    assert after.counts == before.counts
    assert after.memory_kb - before.memory_kb <= GROWTH_KB
