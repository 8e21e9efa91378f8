"""Robot Web Services of a six-axis robot and of the arm of a YuMi alone: they answer as themselves."""

from __future__ import annotations

import json
import re
from math import degrees, radians

import numpy as np
import pytest

from abb_protocols.robot.irb120 import irb120
from abb_protocols.robot.joints import Side
from rws_examples import _TOOL, EXAMPLES, Example, Session, content_type
from rws_examples_2 import EXAMPLES_2, Session2
from virtual_irc5.controller.installed_system import ROBOTS, factory_system
from virtual_irc5.world import World, WorldSettings

UNIT = "/rw/motionsystem/mechunits/ROB_1"
OF_YUMI = re.compile(
    r"yumi|IRB 14000|ROB_[RL]|both arms|(?:left|right) arm|SmartGripper|StateMachine|hand_", re.IGNORECASE
)


def session_of(robot: str, kind: type[Session] = Session) -> Session:
    return kind(World(WorldSettings(system=factory_system(ROBOTS[robot]))))


def own(text: str) -> str:
    """An example's text with the names of a robot with one arm."""
    return re.sub(r"ROB_[RL]", "ROB_1", re.sub(r"T_ROB_[RL]", "T_ROB1", text))


def fields(session: Session, method: str, target: str, form: str = "", index: int = 0) -> dict[str, str]:
    mark = "&" if "?" in target else "?"
    reply = session.ask(method, f"{target}{mark}json=1", form)
    assert reply.status == 200, reply.body
    found = json.loads(reply.body)["_embedded"]["_state"][index]
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize(("kind", "examples"), [(Session, EXAMPLES), (Session2, EXAMPLES_2)], ids=["1.0", "2.0"])
@pytest.mark.parametrize("robot", ["irb120", "irb14050"])
def test_resources_of_another_robot_do_not_name_a_yumi(
    robot: str, kind: type[Session], examples: tuple[Example, ...]
) -> None:
    session = session_of(robot, kind)
    session.controller.set_motors(True)
    count = 0
    for example in examples:
        if example.method != "GET" or "{" in example.target or example.target == "/logout":
            continue
        target = own(example.target)
        reply = session.ask("GET", target)
        if reply.status != 200 or "YuMi" in target:  # a file, or the name of the system itself
            continue
        assert OF_YUMI.findall(reply.body.decode()) == [], target
        count += 1
    assert count > 70


@pytest.mark.parametrize(("robot", "title"), [("irb120", "IRB 120-3/0.6"), ("irb14050", "IRB 14050-0.5/0.5")])
def test_robot_type_and_name_are_those_of_the_robot(robot: str, title: str) -> None:
    session = session_of(robot)
    assert fields(session, "GET", "/rw/system/robottype")["robot-type"] == title
    name = title.partition("-")[0].replace(" ", "_")
    assert (fields(session, "GET", "/rw/system")["name"], fields(session, "GET", "/ctrl/identity")["ctrl-name"]) == (
        name,
        name,
    )


def test_name_that_the_user_gives_is_shown() -> None:
    session = Session(World(WorldSettings(robot_name="cell 7", system=factory_system(ROBOTS["irb120"]))))
    assert fields(session, "GET", "/rw/system")["name"] == "cell 7"


@pytest.mark.parametrize("robot", ["irb120", "irb14050"])
def test_robot_is_jogged_about_its_own_axes(robot: str) -> None:
    session = session_of(robot)
    before = fields(session, "GET", f"{UNIT}/jointtarget")
    session.prepare("motors")
    session.prepare("hold motion")
    axes = "&".join(f"axis{number}={1000 if number == 3 else 0}" for number in range(1, 7))
    ccount = fields(session, "GET", "/rw/motionsystem?resource=change-count")["change-count"]
    assert session.ask("POST", "/rw/motionsystem?action=jog", f"{axes}&ccount={ccount}").status == 204
    for _ in range(500):
        session.world.cycle({})
    after = fields(session, "GET", f"{UNIT}/jointtarget")
    moved = {name: float(after[name]) - float(before[name]) for name in before if name.startswith("rax")}
    assert moved["rax_3"] == pytest.approx(2.0, abs=1e-3)
    assert [moved[f"rax_{n}"] for n in (1, 2, 4, 5, 6)] == pytest.approx([0.0] * 5, abs=1e-4)
    assert before["eax_a"] == after["eax_a"]


def test_poses_and_joints_of_six_axes_are_calculated_with_their_kinematics() -> None:
    session = session_of("irb120")
    joints = tuple(map(radians, (20.0, 30.0, 10.0, 60.0, 40.0, 50.0)))
    zeros = "[0,0,0,0,0,0]"
    text = ",".join(f"{each:.9f}" for each in joints)
    pose = fields(
        session,
        "POST",
        f"{UNIT}?action=CalcPoseFromJoints",
        f"rob_joints=[{text}]&ext_joints={zeros}&{_TOOL}&elog_at_error=FALSE",
    )
    expected = irb120().tool0(joints)  # type: ignore[arg-type]
    position = [float(pose[f"position-{axis}"]) for axis in "xyz"]
    orientation = [float(pose[f"robtargetorientation-u{number}"]) for number in range(4)]
    assert position == pytest.approx(expected.position, abs=1e-6)
    assert np.abs(np.dot(orientation, expected.orientation)) == pytest.approx(1.0)
    assert (pose["quarter-rev-j4"], pose["extjoint-1"]) == ("0", "0")

    wanted = f"curr_position={position}&curr_orientation={orientation}&curr_ext_joints={zeros}".replace(" ", "")
    wanted += f"&robot_configuration=[0,0,0,0]&{_TOOL}"
    old = ",".join(f"{each + 0.1:.6f}" for each in joints)
    inverse = fields(
        session,
        "POST",
        f"{UNIT}?action=CalcJointsFromPose",
        f"{wanted}&old_rob_joints=[{old}]&old_ext_joints={zeros}&elog_at_error=FALSE",
    )
    assert [float(inverse[f"robotjoint-{n}"]) for n in range(1, 7)] == pytest.approx(joints, abs=1e-5)
    reply = session.ask("POST", f"{UNIT}?action=AllJointSolutions&json=1", wanted)
    found = [
        [degrees(float(each[f"robotjoint-{n}"])) for n in range(1, 7)]
        for each in json.loads(reply.body)["_embedded"]["_state"]
    ]
    assert any(each == pytest.approx([20, 30, 10, 60, 40, 50], abs=1e-3) for each in found)
    assert len(found) > 1


def test_last_axis_of_six_is_where_the_flange_is() -> None:
    session = session_of("irb120")
    arm = session.world.arms[Side.RIGHT]
    found = fields(session, "GET", f"{UNIT}/axes/6?resource=axis-pose")
    point = [float(found[axis]) for axis in "xyz"]
    assert point == pytest.approx([1e3 * each for each in arm.kinematics.tool0(arm.position).position], abs=1e-3)


def test_pose_out_of_reach_of_six_axes_is_refused() -> None:
    session = session_of("irb120")
    session.prepare("motors")
    session.prepare("hold motion")
    target = "pos-x=2000&pos-y=0&pos-z=300&orient-q1=0&orient-q2=0&orient-q3=1&orient-q4=0"
    target += "&config-j1=0&config-j4=0&config-j6=0&config-jx=0&extjoint-1=9E9"
    reply = session.ask("POST", "/rw/motionsystem?action=positiontarget", target)
    assert (reply.status, b"the robot does not reach the pose" in reply.body) == (400, True), reply.body


@pytest.mark.parametrize(("robot", "status"), [("irb120", 400), ("irb14050", 200), ("yumi", 200)])
def test_lead_through_needs_its_option(robot: str, status: int) -> None:
    session = session_of(robot)
    unit = UNIT if robot != "yumi" else "/rw/motionsystem/mechunits/ROB_L"
    reply = session.ask("GET", f"{unit}?resource=lead-through")
    assert reply.status == status
    assert (b"-1073435901" in reply.body) is (status == 400)
    assert session.ask("POST", f"{unit}?action=set-lead-through", "status=active").status == (204, 400)[status == 400]
    assert content_type(reply) == "application/xhtml+xml"
