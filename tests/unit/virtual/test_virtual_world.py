"""The world: what it is made of, and where its datagrams go."""

import pytest

from abb_protocols.errors import NoConnection
from abb_protocols.robot.joints import CYCLE, Joints, Side, home
from virtual_irc5.mechanics.virtual_gripper import Workpiece
from virtual_irc5.world import World, WorldSettings

BENT: Joints = (0.0, -1.5, -2.0, 0.5, 0.0, 0.7, 0.1)


@pytest.mark.parametrize(("side", "port"), [(Side.LEFT, 6511), (Side.RIGHT, 6512)])
def test_world_sends_to_the_ports_of_the_configuration_on_this_machine(side: Side, port: int) -> None:
    assert World().egm_destination(side) == ("127.0.0.1", port)


def test_world_sends_where_the_settings_say() -> None:
    world = World(WorldSettings(egm_host="10.0.0.2", egm_ports={Side.LEFT: 7001}))
    assert world.egm_destination(Side.LEFT) == ("10.0.0.2", 7001)
    assert world.egm_destination(Side.RIGHT) == ("10.0.0.2", 6512)


@pytest.mark.parametrize(
    ("given", "host"),
    [("127.0.0.1", "127.0.0.1"), ("localhost", "localhost"), ("10.0.0.2", "10.0.0.2"), ("192.0.2.9", "10.0.0.2")],
)
def test_device_that_was_changed_leads_to_this_machine_or_to_the_host_of_the_settings(given: str, host: str) -> None:
    world = World(WorldSettings(egm_host="10.0.0.2"))
    world.controller.effective.change("SIO", "COM_TRP", "ROB_L", {"RemoteAdress": given, "RemotePortNumber": "7000"})
    assert world.egm_destination(Side.LEFT) == (host, 7000)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("RemotePortNumber", port) for port in ("", "0", "-1", "65536", "9" * 5000, "x", "\u0661")),
        *(("RemoteAdress", host) for host in ("", "example.org", "10.0.0", "::g")),
    ],
)
def test_device_without_a_usable_address_has_no_destination(name: str, value: str) -> None:
    world = World()
    world.controller.effective.change("SIO", "COM_TRP", "ROB_L", {name: value})
    with pytest.raises(NoConnection, match="The UDPUC device ROB_L has the"):
        world.egm_destination(Side.LEFT)


def test_world_has_what_the_settings_put_into_it() -> None:
    workpiece = Workpiece(0.02)
    world = World(WorldSettings(workpieces={Side.LEFT: workpiece}, positions={Side.RIGHT: BENT}))
    assert world.arms[Side.RIGHT].position == BENT
    assert world.arms[Side.LEFT].position == home(Side.LEFT)
    assert world.grippers[Side.LEFT].workpiece is workpiece


def test_world_keeps_the_controllers_clock() -> None:
    world = World(WorldSettings(start_time=1000.0))
    for _ in range(10):
        world.cycle({})
    assert world.controller.time == pytest.approx(1000.0 + 10 * CYCLE)


def test_world_shows_the_grippers_in_the_signals() -> None:
    world = World(WorldSettings(grippers_are_calibrated=True))
    world.grippers[Side.LEFT].move_to(0.01)
    for _ in range(200):
        world.cycle({})
    value = {
        name: world.controller.signals.get(name).value for name in ("hand_ActualPosition_L", "hand_ActualPosition_R")
    }
    assert value == {"hand_ActualPosition_L": 100, "hand_ActualPosition_R": 0}


def test_world_ignores_datagrams_while_nobody_listens() -> None:
    world = World()
    assert world.cycle({Side.LEFT: [b"nonsense"]}) == {}
