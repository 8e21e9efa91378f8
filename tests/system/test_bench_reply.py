"""The benchmark's load generator against real servers: every reply is checked, none is missed; times are not judged."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from abb_protocols.errors import RobotNotReady
from yumi_evaluation.bench.contenders import (
    ECHO,
    Case,
    Contender,
    Mode,
    Runtime,
    busy_ros_graph,
    control_loop,
    ros_graph,
)
from yumi_evaluation.bench.figures import Run
from yumi_evaluation.bench.run import Workshop, run_case

CYCLES = 200
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.alone,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the benchmark needs Linux"),
]


@pytest.fixture(scope="module")
def workshop() -> Workshop:
    workshop = Workshop(Path("build/bench").absolute())
    workshop.compile_programs()
    return workshop


@pytest.mark.parametrize(
    ("contender", "mode"),
    [
        (ECHO, Mode.PING_PONG),
        (control_loop("blocking"), Mode.PACED),
        pytest.param(ECHO, Mode.PACED, marks=pytest.mark.soak),
        pytest.param(control_loop("blocking"), Mode.PING_PONG, marks=pytest.mark.soak),
    ],
    ids=lambda each: str(getattr(each, "name", each)),
)
def test_every_reply_of_both_arms_is_right(workshop: Workshop, contender: Contender, mode: Mode) -> None:
    check_replies(run_case(workshop, Case(contender, mode, 2), 1, CYCLES))


@pytest.mark.ros
@pytest.mark.parametrize(
    "contender",
    [ros_graph("blocking"), pytest.param(busy_ros_graph("blocking"), marks=pytest.mark.soak)],
    ids=lambda each: each.name,
)
def test_ros_graph_replies_and_its_subscriber_hears_every_topic(workshop: Workshop, contender: Contender) -> None:
    run = run_case(workshop, Case(contender, Mode.PACED, 2), 1, CYCLES)
    check_replies(run)
    assert run.heard
    assert [topic for topic, count in run.heard.items() if not count] == []


def check_replies(run: Run) -> None:
    assert run.count("unparsed") == 0
    assert run.latencies.shape == (2, CYCLES)
    # A machine under other load may let a few go; the replies of a limiter that catches up belong to no certain cycle.
    assert run.count("bad") + run.count("duplicates") <= 0.05 * 2 * CYCLES
    assert (run.latencies > 0).sum() >= 0.95 * 2 * CYCLES


WRONG_AT_TIMES = """
import os, socket, sys
from abb_protocols.egm.egm_pb2 import EgmRobot
server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
server.bind(("127.0.0.1", int(sys.argv[1])))
print("ready", os.getpid(), flush=True)
while True:
    datagram, robot = server.recvfrom(2048)
    answer = EgmRobot.FromString(datagram)
    answer.feedBack.joints.joints[2] += answer.header.seqno % 100 == 99
    server.sendto(answer.SerializeToString(), robot)
"""


def test_bad_reply_is_no_missed_one_too(workshop: Workshop, tmp_path: Path) -> None:
    """Datagrams 99, 199, 299 and 399 are of the robot's motion, the last two of the cycles that are counted."""
    program = tmp_path / "server.py"
    program.write_text(WRONG_AT_TIMES, encoding="utf-8")
    server = Contender("wrong", "wrong at times", f"{sys.executable} {program}", Runtime.OTHER, gain=0.0)
    run = run_case(workshop, Case(server, Mode.PING_PONG, 1), 1, CYCLES)
    assert (run.count("bad"), run.count("missed")) == (4, 0)
    assert (run.latencies == 0).sum() == 2


def test_server_that_does_not_drive_the_robot_is_refused(workshop: Workshop) -> None:
    no_driver = Contender("no_driver", "an echo taken for a server", "echo.c", Runtime.COMPILED, gain=0.1)
    with pytest.raises(RobotNotReady, match="did not answer the robot as it should"):
        run_case(workshop, Case(no_driver, Mode.PACED, 1, lead_in=1.0), 1, CYCLES)
