"""The part of the doctor that looks at this machine: its way to the robot, ports, firewall, permissions, ROS."""

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

from abb_protocols.catalogue import message
from abb_protocols.errors import NoConnection
from abb_protocols.robot.joints import Side
from abb_runtime.udp import NetworkCard, UdpServer, network_cards
from yumi.driver.commissioning.findings import Finding, Verdict, problem
from yumi.driver.launch_checks import EgmAddress

_UFW = Path("/etc/ufw/ufw.conf")
_SYSTEM_PATH = f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin"
_LISTINGS = (["nft", "list", "ruleset"], ["iptables", "-S"])
_UFW_ON = re.compile(r"(?im)^\s*ENABLED\s*=\s*\"?yes")
_CLOSES = re.compile(r"hook input[^}]*policy drop|-P INPUT DROP|\breject\b|-j (?:REJECT|DROP)")
_SMALLEST_MTU = 576
"""The smallest one of IPv4; a datagram of EGM has a few hundred bytes, so that it is never cut with this."""

_DISCOVERY = ("LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
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
        yield Finding("UDP ports here", Verdict.PROBLEM, message("arms_share_port", port=ports[0]))
    for side, address in addresses.items():
        name = f"UDP port {address.port} here"
        try:
            UdpServer(address.host, address.port).close()
            yield Finding(name, Verdict.OK, message("port_free", arm=side.word))
        except NoConnection as error:
            yield problem(name, error)
    yield _firewall(robot, ports, run or _run_program, ufw)
    limits = (
        ("real-time priority", resource.RLIMIT_RTPRIO, message("priority_not_permitted")),
        ("locked memory", resource.RLIMIT_MEMLOCK, message("locked_memory_not_permitted")),
    )
    for name, limit, refused in limits:
        highest = resource.getrlimit(limit)[1]
        is_permitted = (
            os.geteuid() == 0 or highest == resource.RLIM_INFINITY or (highest > 0 and limit == resource.RLIMIT_RTPRIO)
        )
        yield Finding(name, Verdict.OK, message("permitted")) if is_permitted else Finding(name, Verdict.NOTE, refused)
    yield from _ros(environment)


def examine_route(
    robot: str, addresses: Mapping[Side, EgmAddress], cards: tuple[NetworkCard, ...]
) -> Iterator[Finding]:
    """The card that faces the robot, and others that could be taken for it."""
    if ip_address(robot).is_loopback:
        yield Finding("route", Verdict.OK, message("robot_on_this_machine"))
        return
    for host in dict.fromkeys(address.host for address in addresses.values()):
        card = next((card for card in cards if card.address == host), None)
        if card is None:
            yield Finding("route", Verdict.PROBLEM, message("no_card_with_address", host=host))
            continue
        network = IPv4Interface(f"{card.address}/{card.mask}").network
        named = f"{card.name} ({card.address})"
        if ip_address(robot) in network:
            yield Finding("route", Verdict.OK, message("card_in_network", card=named, network=str(network)))
        else:
            found = message("card_in_other_network", card=named, network=str(network), robot=robot)
            yield Finding("route", Verdict.NOTE, found)
        others = [
            each
            for each in cards
            if each.name != card.name and ip_address(robot) in IPv4Interface(f"{each.address}/{each.mask}").network
        ]
        if others:
            names = tuple(f"{each.name} ({each.address})" for each in others)
            yield Finding("network card", Verdict.PROBLEM, message("cards_share_network", others=names, card=named))
        faults = (
            (card.is_wireless, message("card_is_wireless", card=card.name)),
            (card.is_tunnel, message("card_is_tunnel", card=card.name)),
            (not card.is_up, message("card_not_connected", card=card.name)),
            (card.mtu < _SMALLEST_MTU, message("card_with_small_mtu", card=card.name, mtu=card.mtu)),
        )
        seen = [fault for is_so, fault in faults if is_so]
        for fault in seen:
            yield Finding("network card", Verdict.PROBLEM, fault)
        if not seen and not others:
            yield Finding("network card", Verdict.OK, message("card_found", card=card.name, mtu=card.mtu))


def _firewall(robot: str, ports: list[int], run: Run, ufw: Path) -> Finding:
    """What can be known of it without root; a firewall that drops EGM is the most frequent fault of a new set-up."""
    wanted = f"{min(ports)}:{max(ports)}"
    if ip_address(robot).is_loopback:
        return Finding("firewall", Verdict.OK, message("firewall_does_not_matter"))
    if ufw.is_file() and _UFW_ON.search(ufw.read_text(encoding="utf-8", errors="replace")):
        return Finding("firewall", Verdict.NOTE, message("ufw_is_on", robot=robot, ports=wanted))
    for name, *arguments in _LISTINGS:
        program = shutil.which(name, path=_SYSTEM_PATH)
        if program is None:
            continue
        try:
            done = run([program, *arguments])
        except (OSError, subprocess.TimeoutExpired):
            done = None
        if done is None or done.returncode != 0:
            found = message("firewall_unreadable", firewall=name, ports=wanted, robot=robot)
            return Finding("firewall", Verdict.NOTE, found)
        if _CLOSES.search(done.stdout) and not all(str(port) in done.stdout for port in ports):
            found = message("firewall_closes_something", firewall=name, ports=wanted, robot=robot)
            return Finding("firewall", Verdict.NOTE, found)
        return Finding("firewall", Verdict.OK, message("firewall_open", firewall=name, ports=wanted))
    return Finding("firewall", Verdict.OK, message("no_firewall_found"))


def _run_program(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=5.0, stdin=subprocess.DEVNULL)


def _ros(environment: Mapping[str, str]) -> Iterator[Finding]:
    if find_spec("rclpy") is None:
        yield Finding("ROS 2", Verdict.NOTE, message("ros_not_installed"))
    else:
        yield Finding("ROS 2", Verdict.OK, message("as_found", value=environment.get("ROS_DISTRO", "installed")))
    text = environment.get("ROS_DOMAIN_ID", "0") or "0"
    if not text.isdecimal() or int(text) > _LAST_DOMAIN:
        yield Finding("ROS domain", Verdict.PROBLEM, message("ros_domain_invalid", value=text, highest=_SAFE_DOMAIN))
    elif int(text) > _SAFE_DOMAIN:
        yield Finding("ROS domain", Verdict.NOTE, message("ros_domain_high", value=text, highest=_SAFE_DOMAIN))
    else:
        yield Finding("ROS domain", Verdict.OK, message("as_found", value=text))
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if environment.get("ROS_LOCALHOST_ONLY") and reach:
        yield Finding("ROS discovery", Verdict.NOTE, message("ros_discovery_overruled", value=reach))
    elif reach.upper() == "OFF":
        yield Finding("ROS discovery", Verdict.NOTE, message("ros_discovery_off"))
    elif reach and reach.upper() not in _DISCOVERY:
        yield Finding("ROS discovery", Verdict.PROBLEM, message("ros_discovery_invalid", value=reach))
    elif reach:
        yield Finding("ROS discovery", Verdict.OK, message("as_found", value=reach))
    else:
        yield Finding("ROS discovery", Verdict.OK, message("ros_discovery_of_driver"))
