"""This machine's part of the doctor: the way to the robot, EGM's ports, firewall, permissions, ROS environment."""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from ipaddress import IPv4Interface, ip_address
from pathlib import Path

from yumi.driver.bringup import EgmAddress
from yumi.driver.commissioning.findings import Finding, Verdict
from yumi.egm.udp import NetworkCard, UdpServer, network_cards
from yumi.errors import NoConnection
from yumi.robot.joints import Side

_UFW = Path("/etc/ufw/ufw.conf")
_SYSTEM_PATH = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"
_LISTINGS = (["nft", "list", "ruleset"], ["iptables", "-S"])
_UFW_ON = re.compile(r"(?im)^\s*ENABLED\s*=\s*\"?yes")
_CLOSES = re.compile(r"hook input[^}]*policy drop|-P INPUT DROP|\breject\b|-j (?:REJECT|DROP)")
_MTU = 576
"""The smallest one of IPv4; a datagram of EGM has a few hundred bytes, so that it is never cut with this."""

_DISCOVERY = ("LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
_DISCOVERY_REMEDY = "set it to LOCALHOST, or to SUBNET for several machines, or unset it"
_LAST_DOMAIN = 232
_SAFE_DOMAIN = 101
"""Above this, ports of ROS 2 lie where Linux takes those of outgoing connections."""

Run = Callable[[list[str]], "subprocess.CompletedProcess[str]"]
"""Runs a program that only reads; raises OSError or subprocess.TimeoutExpired."""


def examine_machine(
    robot: str,
    addresses: Mapping[Side, EgmAddress],
    run: Run | None = None,
    ufw: Path = _UFW,
    cards: Callable[[], tuple[NetworkCard, ...]] = network_cards,
    environment: Mapping[str, str] = os.environ,
) -> Iterator[Finding]:
    """Look at this machine.

    Args:
        robot: the controller's IP address.
        addresses: where each arm's datagrams are awaited.
        run: runs a program; by default for 5 s at most.
        ufw: its configuration.
        cards: this machine's network cards.
        environment: variables.
    """
    yield from examine_route(robot, addresses, cards())
    ports = [address.port for address in addresses.values()]
    if len({*ports}) < len(ports):
        found = f"both arms' datagrams are awaited at port {ports[0]}"
        yield Finding("UDP ports here", Verdict.PROBLEM, found, "give the arms two ports in the settings (egm)")
    for side, address in addresses.items():
        name = f"UDP port {address.port} here"
        try:
            UdpServer(address.host, address.port).close()
            yield Finding(name, Verdict.OK, f"free for the {side.word} arm")
        except NoConnection as error:
            yield problem(name, error)
    yield _firewall(robot, ports, run or _run, ufw)
    limits = (
        ("real-time priority", resource.RLIMIT_RTPRIO, "more jitter under load", "rtprio 99"),
        ("locked memory", resource.RLIMIT_MEMLOCK, "rare delays when memory is short", "memlock unlimited"),
    )
    for name, limit, loss, line in limits:
        highest = resource.getrlimit(limit)[1]
        is_permitted = (
            os.geteuid() == 0 or highest == resource.RLIM_INFINITY or (highest > 0 and limit == resource.RLIMIT_RTPRIO)
        )
        yield Finding(
            name,
            Verdict.OK if is_permitted else Verdict.NOTE,
            "permitted" if is_permitted else f"not permitted to this user; EGM works, with {loss}",
            "" if is_permitted else f"add '{line}' for the user to /etc/security/limits.d",
        )
    yield from _ros(environment)


def problem(requirement: str, error: Exception) -> Finding:
    """The finding of an error; its message has the remedy after a semicolon."""
    found, _, remedy = str(error).rstrip(".").partition("; ")
    return Finding(requirement, Verdict.PROBLEM, found, remedy)


def examine_route(
    robot: str, addresses: Mapping[Side, EgmAddress], cards: tuple[NetworkCard, ...]
) -> Iterator[Finding]:
    """The card that faces the robot, and others that could be taken for it."""
    if ip_address(robot).is_loopback:
        yield Finding("route", Verdict.OK, "the robot is on this machine")
        return
    for host in dict.fromkeys(address.host for address in addresses.values()):
        card = next((card for card in cards if card.address == host), None)
        if card is None:
            found = f"no network card has the address {host}, where datagrams are awaited"
            yield Finding("route", Verdict.PROBLEM, found, "set egm.listen to auto, or give the card this address")
            continue
        network = IPv4Interface(f"{card.address}/{card.mask}").network
        if ip_address(robot) in network:
            yield Finding("route", Verdict.OK, f"{card.name} ({card.address}) is in the robot's network {network}")
        else:
            found = f"{card.name} ({card.address}) is in {network}, the robot {robot} is not: a router is between them"
            remedy = "connect this machine to the robot's network by a cable, with an address of its own there"
            yield Finding("route", Verdict.NOTE, found, remedy)
        others = [
            each
            for each in cards
            if each.name != card.name and ip_address(robot) in IPv4Interface(f"{each.address}/{each.mask}").network
        ]
        if others:
            names = ", ".join(f"{each.name} ({each.address})" for each in others)
            yield Finding(
                "network card",
                Verdict.PROBLEM,
                f"{names} is in the robot's network, too, beside {card.name} ({card.address})",
                "leave one card in that network: datagrams may leave by the other, and the robot ignores them",
            )
        faults = [
            (card.is_wireless, "a radio link (Wi-Fi)", "use a cable: a radio link delays single datagrams by far"),
            (card.is_tunnel, "a tunnel (VPN)", "connect by a cable"),
            (not card.is_up, "not connected", "plug the cable in"),
            (card.mtu < _MTU, f"set to packets of {card.mtu} bytes", f"sudo ip link set {card.name} mtu 1500"),
        ]
        seen = [(what, remedy) for is_so, what, remedy in faults if is_so]
        for what, remedy in seen:
            yield Finding("network card", Verdict.PROBLEM, f"{card.name} is {what}", remedy)
        if not seen and not others:
            yield Finding("network card", Verdict.OK, f"{card.name}, MTU {card.mtu}")


def _ros(environment: Mapping[str, str]) -> Iterator[Finding]:
    if find_spec("rclpy") is None:
        remedy = "install yumi-ros2[ros] or source your ROS 2 Jazzy, unless you need no ROS"
        yield Finding("ROS 2", Verdict.NOTE, "not installed for this Python", remedy)
    else:
        yield Finding("ROS 2", Verdict.OK, environment.get("ROS_DISTRO", "installed"))
    text = environment.get("ROS_DOMAIN_ID", "0") or "0"
    if not text.isdecimal() or int(text) > _LAST_DOMAIN:
        found = f"ROS_DOMAIN_ID is {text!r}"
        yield Finding("ROS domain", Verdict.PROBLEM, found, f"set it to a number from 0 to {_SAFE_DOMAIN}")
    elif int(text) > _SAFE_DOMAIN:
        found = f"ROS_DOMAIN_ID is {text}: its ports may be taken by outgoing connections"
        yield Finding("ROS domain", Verdict.NOTE, found, f"set it to a number from 0 to {_SAFE_DOMAIN}")
    else:
        yield Finding("ROS domain", Verdict.OK, text)
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if environment.get("ROS_LOCALHOST_ONLY") and reach:
        found = f"ROS_LOCALHOST_ONLY, which is set too, overrules ROS_AUTOMATIC_DISCOVERY_RANGE={reach}"
        yield Finding("ROS discovery", Verdict.NOTE, found, "unset ROS_LOCALHOST_ONLY")
    elif reach.upper() == "OFF":
        yield Finding("ROS discovery", Verdict.NOTE, "OFF: no other program finds the driver", _DISCOVERY_REMEDY)
    elif reach and reach.upper() not in _DISCOVERY:
        found = f"ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}, which means SUBNET: all machines of the network find it"
        yield Finding("ROS discovery", Verdict.PROBLEM, found, _DISCOVERY_REMEDY)
    else:
        yield Finding("ROS discovery", Verdict.OK, reach or "as the driver sets it")


def _firewall(robot: str, ports: list[int], run: Run, ufw: Path) -> Finding:
    """What can be known of it without root; a firewall that drops EGM is the most frequent fault of a new set-up."""
    wanted = f"{min(ports)}:{max(ports)}"
    if ip_address(robot).is_loopback:
        return Finding("firewall", Verdict.OK, "does not matter to this machine's own address")
    if ufw.is_file() and _UFW_ON.search(ufw.read_text(encoding="utf-8", errors="replace")):
        remedy = f"sudo ufw allow from {robot} to any port {wanted} proto udp"
        return Finding("firewall", Verdict.NOTE, "ufw is on, its rules are not readable without root", remedy)
    for name, *arguments in _LISTINGS:
        program = shutil.which(name, path=_SYSTEM_PATH)
        if program is None:
            continue
        try:
            done = run([program, *arguments])
        except (OSError, subprocess.TimeoutExpired):
            done = None
        if done is None or done.returncode != 0:
            remedy = f"see with sudo that UDP ports {wanted} are open to {robot}"
            return Finding("firewall", Verdict.NOTE, f"{name}: not readable without root", remedy)
        if _CLOSES.search(done.stdout) and not all(str(port) in done.stdout for port in ports):
            found = f"{name} closes something, and does not name all of the ports {wanted}"
            return Finding("firewall", Verdict.NOTE, found, f"see that UDP ports {wanted} are open to {robot}")
        return Finding("firewall", Verdict.OK, f"{name} shows nothing that closes UDP ports {wanted}")
    return Finding("firewall", Verdict.OK, "none found (ufw, nft, iptables)")


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=5.0, stdin=subprocess.DEVNULL)
