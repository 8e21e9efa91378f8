"""Controllers that ``yumi view`` can only show, since no driver can run for them."""

from __future__ import annotations

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady, YumiError
from abb_runtime.rws.client import RwsClient
from abb_view.controller_reader import ControllerReader, open_reader
from yumi.driver.launch_checks import LaunchChecks, other_robot
from yumi.driver.settings import RobotSettings


def open_controller(robot: RobotSettings) -> ControllerReader | None:
    """A reader of the controller, where no driver of this package can run for it; None where one can.

    The reader is to be closed.

    Args:
        robot: where the controller is, and who logs in.

    Raises:
        YumiError: nothing answers there, or it is not a controller of RobotWare 6, or it does not let us in.
    """
    client = robot.client()
    client.connect()
    try:
        why = _why_no_driver(client)
    except YumiError:
        client.close()
        raise
    if why is None:
        client.close()
        return None
    reader = open_reader(client)
    reader.why_view_only = why_view_only(reader, why)
    return reader


def reopen_controller(robot: RobotSettings) -> ControllerReader:
    """As :func:`open_controller`, after another controller may have come.

    Raises:
        YumiError: it cannot be shown, as there; or a driver can run for it now.
    """
    reader = open_controller(robot)
    if reader is None:
        raise RobotNotReady(message("driver_can_run_now", address=robot.host_and_port))
    return reader


def why_view_only(reader: ControllerReader, why: Message) -> Message:
    """Why a controller is only shown: what a YuMi lacks for the driver, or that the robot is another one."""
    return why if reader.is_yumi else message("no_driver_for_robot", robot=other_robot(reader.robot, reader.kind.units))


def _why_no_driver(client: RwsClient) -> Message | None:
    """Why no driver of this package can run for a controller; None where one can."""
    try:
        LaunchChecks(client).run()
    except RobotNotReady as error:
        return error.said
    return None
