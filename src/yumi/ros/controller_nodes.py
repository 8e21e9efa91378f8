"""One ROS node for each loaded controller, named like it: its parameters, and the topics and actions of its kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import rclpy
from rclpy.executors import Executor

from yumi.control.inventory import ControllerInfo, ParameterInfo
from yumi.control.parameter import Values
from yumi.control.requests import Done, FastLineEnded, ListParameters, Request, SetParameters
from yumi.robot.joints import Side
from yumi.ros.controller_parameters import Presets, declare, declare_common, pass_on_changes


class Line(Protocol):
    """What the nodes of an arm ask."""

    def ask(self, request: Request) -> Done:
        """Have ``request`` served between two cycles."""


class ControllerInterface(Protocol):
    """Topics or actions of one controller."""

    def tell(self, notice: Any) -> None:
        """Something the controller has to tell, see :meth:`yumi.control.controller.Controller.take_notices`."""

    def destroy(self) -> None:
        """End them; before the node is destroyed."""


MakeInterface = Callable[[Any, Side, str], ControllerInterface]
"""Makes what a controller of some kind offers besides parameters, from its node, the arm and its name."""


class ControllerNode:
    """The node of one controller.

    Args:
        side: the arm, whose namespace the node is in.
        info: the controller.
        arguments: ROS arguments of this node alone, e.g. parameter files.
        rate: of the controller manager [Hz].
    """

    def __init__(self, side: Side, info: ControllerInfo, arguments: Sequence[str], rate: int) -> None:
        self._side = side
        self._name = info.name
        self._interface: ControllerInterface | None = None
        self.node: Any = rclpy.create_node(
            info.name,
            namespace=side.value,
            cli_args=["--ros-args", *arguments] if arguments else None,
            use_global_arguments=False,
        )
        self._rate = rate

    def take_parameters(self, line: Line, presets: Presets) -> None:
        """Declare the parameters, give the controller those that its files set, and pass on what is set later.

        Args:
            line: where the controller lives.
            presets: what holds where its own files say nothing.

        Raises:
            CommandRefused: a value in a file is not allowed.
            RobotNotReady: the fast line is gone.
        """
        declare_common(self.node, self._rate)
        infos: tuple[ParameterInfo, ...] = line.ask(ListParameters(self._side, self._name)).parameters

        def change(values: Values) -> None:
            line.ask(SetParameters(self._side, self._name, values))

        changed = declare(self.node, infos, presets)
        if changed:
            change(changed)
        pass_on_changes(self.node, (info.parameter.name for info in infos), change)

    def offer(self, make: MakeInterface) -> None:
        """Add what the controller's kind has besides parameters."""
        self._interface = make(self.node, self._side, self._name)

    def tell(self, notice: object) -> None:
        """Pass a notice of the controller on to what it offers; without that it stands in the log."""
        if self._interface is not None:
            self._interface.tell(notice)
        elif not isinstance(notice, FastLineEnded):
            self.node.get_logger().info(str(notice))

    def destroy(self) -> None:
        if self._interface is not None:
            self._interface.destroy()
        self.node.destroy_node()


class ControllerNodes:
    """The nodes of one arm's controllers; they come with loading and go with unloading.

    Args:
        side: which arm.
        line: where the controllers live.
        executor: what spins the nodes.
        interfaces: what controllers of a kind offer besides parameters.
        rate: of the controller manager [Hz].
    """

    def __init__(
        self, side: Side, line: Line, executor: Executor, interfaces: Mapping[str, MakeInterface], rate: int
    ) -> None:
        self._side = side
        self._line = line
        self._executor = executor
        self._interfaces = interfaces
        self._rate = rate
        self._nodes: dict[str, ControllerNode] = {}

    def add(self, info: ControllerInfo, arguments: Sequence[str] = (), presets: Presets | None = None) -> None:
        """Make the node of a loaded controller.

        Args:
            info: the controller.
            arguments: ROS arguments of its node, e.g. parameter files.
            presets: what ``controllers.yaml`` says of a controller that is not loaded from the start.

        Raises:
            CommandRefused: a value in its parameter files is not allowed; there is no node.
            RobotNotReady: the fast line is gone.
        """
        node = ControllerNode(self._side, info, arguments, self._rate)
        try:
            node.take_parameters(self._line, presets or {})
            if info.kind in self._interfaces:
                node.offer(self._interfaces[info.kind])
        except Exception:
            node.destroy()
            raise
        self._nodes[info.name] = node
        self._executor.add_node(node.node)

    def remove(self, name: str) -> None:
        """Destroy the node of an unloaded controller."""
        node = self._nodes.pop(name, None)
        if node is not None:
            self._executor.remove_node(node.node)
            node.destroy()

    def tell(self, name: str, notice: object) -> None:
        """Pass a controller's notice on; from any thread."""
        node = self._nodes.get(name)
        if node is not None:
            node.tell(notice)

    def tell_all(self, notice: object) -> None:
        """Pass on what concerns all controllers; from any thread."""
        for node in tuple(self._nodes.values()):
            node.tell(notice)

    def destroy(self) -> None:
        """Destroy all; when nothing spins any more."""
        for node in self._nodes.values():
            node.destroy()
        self._nodes.clear()
