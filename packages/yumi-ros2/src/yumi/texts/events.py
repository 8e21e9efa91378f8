"""Events of the controller by number, in our own words: what happened, and what to do.

Numbers and meanings: EGM and RobotWare 6 manuals; a controller's own text is added to errors as ``{detail}``.
"""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_BY_NUMBER: Mapping[int, tuple[str, str]] = {
    10010: ("the motors were switched off", "{motors_on}"),
    10012: ("a guard stop switched the motors off", "see that the guard is closed"),
    10013: ("an emergency stop was pressed", "see that its button is released"),
    10014: ("the controller went into system failure", "{recover} when it has been restarted"),
    10015: ("the mode switch was turned to manual", "{recover} when it is in AUTO again"),
    10016: ("AUTO was chosen and waits to be confirmed", "confirm AUTO on the FlexPendant, then {recover}"),
    10045: ("the controller was restarted", "{recover}"),
    10125: ("the RAPID program was stopped, on the FlexPendant or by another client", "{recover}"),
    20192: ("the controller got an EGM reference that is not a number", "restart the controller"),
    20193: ("the controller got an EGM reference that is not a number", "restart the controller"),
    40160: ("a RAPID instruction got an argument it does not know", "load the modules of this version"),
    40228: ("a RAPID error was not handled and stopped the program", "see the event before it"),
    41438: ("the tool's load is undefined", "define mass and centre of gravity of the tool in use"),
    41822: (
        "no EGM answer reached the robot in time",
        "check the network, the firewall and the UDPUC device's remote address",
    ),
    41826: ("EGM was set up for joints and run for poses", "use joints: RobotWare 6 moves a YuMi by them only"),
    41828: (
        "a task holds all of its EGM identities, after stops in the middle of EGM",
        "restart the controller; nothing else frees them",
    ),
    41830: (
        "the robot cannot send its EGM datagrams",
        "check the UDPUC device's remote address and the cable, and restart the controller after a change",
    ),
    50027: ("a joint left its range", "bring the arm back into range, jogging if need be, then {recover}"),
    50056: ("a joint met a resistance, as in a collision", "see what the arm touched, and free the arm"),
    50204: ("an arm has collided, or moves against a force", "see what the arm touched, and free the arm"),
    50375: (
        "the references asked for more torque than an arm has",
        "lower the acceleration, or set the tool's load, then {recover}",
    ),
    50376: ("the references asked for more speed than a joint has", "lower the speed, then {recover}"),
    50446: ("the end of EGM took longer than ordered", ""),
    50452: ("EGM met an error in a motion cycle", "{recover}; if it comes again, see the EGM configuration"),
    50453: ("a move or a jog was ordered while EGM moves the arm", "end EGM first"),
    80001: ("the robot's program reported an error", "read its text, then {recover}"),
    80002: ("the robot's program gave a warning", "read its text"),
    112751: ("a Smart Gripper was in the wrong state for a command", "look at the gripper, then {calibrate}"),
    112752: ("a Smart Gripper has a fault", "switch its supply off and on, then {calibrate}"),
    112753: ("a Smart Gripper did not reach its position", "look at the gripper, then {calibrate}"),
    112754: ("a Smart Gripper could not grip inwards", "look at the gripper, then {calibrate}"),
    112755: ("a Smart Gripper is not calibrated", "{calibrate}"),
    112756: ("a Smart Gripper lost its vacuum", "check suction cup and air supply"),
    112757: ("a Smart Gripper got a value out of range", "give positions of 0 to 25 mm and forces of 0 to 20 N"),
    112758: ("a Smart Gripper could not move to a position", "look at the gripper, then {calibrate}"),
    112759: ("a Smart Gripper could not grip at a position", "look at the gripper, then {calibrate}"),
    112760: ("a Smart Gripper could not grip outwards", "look at the gripper, then {calibrate}"),
}

KNOWN_NUMBERS = frozenset(_BY_NUMBER)
"""Numbers of events that have a text here."""

EVENTS: Mapping[str, Text] = {
    **{
        f"event_{number}": Text(f"{{number}} {{title}}: {what}", remedy)
        for number, (what, remedy) in _BY_NUMBER.items()
    },
    **{
        f"event_{number}_with_detail": Text(f"{{number}} {{title}}: {what} ({{detail}})", remedy)
        for number, (what, remedy) in _BY_NUMBER.items()
    },
    "event": Text("{number} {title}: {detail}"),
}
