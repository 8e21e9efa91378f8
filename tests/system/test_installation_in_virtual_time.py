"""A controller from the factory is set up, and made as it was, whatever happens in between."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from commissioning_bench import HERE, Interruption, Site

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, NoConnection, ProtocolError, RobotNotReady, SettingsError
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import GRANTS, ControllerState, Grant, OperatingMode
from abb_runtime.rws.client import RwsClient
from refusals import assert_says, refused
from soak import long, short
from virtual_irc5.controller.installed_system import factory_system
from virtual_irc5.world import WorldSettings
from yumi.driver.commissioning.contents import Contents
from yumi.driver.commissioning.delivery import delivered_modules
from yumi.driver.commissioning.installation import _BACKUP_GRANT, _GRANTS, Installation, InstallationPlan
from yumi.driver.commissioning.installation_record import InstallationRecord
from yumi.driver.commissioning.stream_checks import listen, streaming
from yumi.egm.egm_session import SensorSession
from yumi.egm.joint_codec import JointCodec
from yumi.testing.virtual_yumi import VirtualYumi

FOREIGN = "MODULE Production\n  PROC main()\n    WaitTime 1;\n  ENDPROC\nENDMODULE\n"


def roll_back(site: Site) -> None:
    installation = site.installation()
    installation.undo(installation.plan_roll_back())


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def test_factory_controller_has_nothing_of_this_package(site: Site) -> None:
    assert site.modules() == {"T_ROB_R": ["user"], "T_ROB_L": ["user"]}
    assert "EGM_STOP" not in site.controller.signals
    assert site.controller.configuration.find("SIO", "COM_TRP", "ROB_R") is None
    assert "StateMachine Core" not in site.controller.identity.options


def test_installation_brings_everything_and_is_idempotent(site: Site) -> None:
    plan = site.plan()
    assert plan.refusals == ()
    assert {change.sign for change in plan.changes} == {"+"}
    site.install()
    assert site.modules()["T_ROB_L"] == site.modules()["T_ROB_R"]
    assert "TRobWatchdog" in site.modules()["T_ROB_R"]
    assert site.controller.signals.get("EGM_STOP").access == "All"
    device = site.controller.effective.find("SIO", "COM_TRP", "ROB_L")
    assert device is not None
    assert (device.attributes["RemoteAdress"], device.attributes["RemotePortNumber"]) == ("192.168.125.99", "6511")
    again = site.plan()
    assert again.changes == ()
    before = site.transport.changes
    site.installation().install(again)
    assert site.transport.changes == before


def test_installed_program_starts_and_becomes_idle(site: Site) -> None:
    site.install()
    site.client.set_motors(True)
    site.client.move_pp_to_main()
    site.client.start_rapid()
    for _ in range(50):
        site.wait(0.02)
    assert [site.client.value(side.task, "TRobMain", "current_state") for side in Side] == [0.0, 0.0]
    assert site.controller.signals.get("OUTPUT_STATIONARY_ROB_R").value == 1


def test_roll_back_leaves_cfg_and_home_as_they_were(site: Site) -> None:
    home, cfg, modules = site.home(), site.cfg(), site.modules()
    site.install()
    assert (site.home(), site.cfg()) != (home, cfg)
    roll_back(site)
    assert (site.home(), site.cfg(), site.modules()) == (home, cfg, modules)
    assert "EGM_STOP" not in site.controller.signals


def test_plan_of_a_roll_back_changes_nothing(site: Site) -> None:
    site.install()
    before = site.transport.changes
    plan = site.installation().plan_roll_back()
    assert "- module TRobMain in T_ROB_R" in [str(change) for change in plan.changes]
    assert site.transport.changes == before


def test_program_that_has_run_is_rolled_back(site: Site) -> None:
    home, cfg, modules = site.home(), site.cfg(), site.modules()
    site.install()
    site.client.set_motors(True)
    site.client.move_pp_to_main()
    site.client.start_rapid()
    site.wait(0.1)
    site.client.stop_rapid()
    roll_back(site)
    assert (site.home(), site.cfg(), site.modules()) == (home, cfg, modules)


def test_backup_is_on_the_controller_and_here(site: Site) -> None:
    site.install()
    (name,) = (file.name for file in site.controller.files.entries("BACKUP:"))
    saved = {str(path.relative_to(site.folder)) for path in site.folder.rglob("*.cfg")}
    domains = ("EIO", "MMC", "MOC", "PROC", "SIO", "SYS")
    assert {f"installations/yumi/{name}/SYSPAR/{domain}.cfg" for domain in domains} == saved


def test_other_address_is_the_only_change_of_a_second_installation(site: Site) -> None:
    site.install()
    moved = {side: type(address)("192.168.125.77", address.port) for side, address in HERE.items()}
    plan = site.installation().plan(site.client.connect(), moved)
    assert [str(change) for change in plan.changes] == [
        f"~ SIO COM_TRP ROB_{arm}: RemoteAdress '192.168.125.99' becomes '192.168.125.77'" for arm in "RL"
    ]


def test_program_that_runs_is_left_alone(site: Site) -> None:
    site.install()
    site.client.set_motors(True)
    site.client.move_pp_to_main()
    site.client.start_rapid()
    runs = message("program_runs_on_controller")
    with refused(RobotNotReady, "nothing_changed", reason=runs):
        roll_back(site)
    assert site.plan().refusals[0] == runs


def test_manual_mode_is_refused(site: Site) -> None:
    site.controller.mode = OperatingMode.MANUAL_REDUCED
    plan = site.plan()
    assert plan.refusals == (message("not_in_auto", mode="MANR"),)
    with refused(RobotNotReady, "nothing_changed", reason=message("not_in_auto", mode="MANR")):
        site.installation().install(plan)
    assert site.transport.changes == 0


@pytest.mark.parametrize("domain", ["cfg", "rapid"])
def test_what_another_client_works_on_is_left_alone(site: Site, domain: str) -> None:
    """A restart would end its session, with what it has not saved."""
    other = RwsClient(site.transport, clock=site)
    with other.holding(domain):
        (refusal,) = site.plan().refusals
        assert_says(refusal, "mastership_held", domain=domain)
        with refused(RobotNotReady, "nothing_changed", reason=refusal):
            site.installation().undo(InstallationPlan((), Contents(), Contents()))
        before = site.transport.changes
        with refused(RobotNotReady, "nothing_changed", reason=refusal):
            site.install()
        assert site.transport.changes == before
    site.install()


@pytest.mark.parametrize(
    ("missing", "what"),
    [
        (Grant.FTP_WRITE, "write files"),
        (Grant.CFG_WRITE, "load configuration"),
        (Grant.RAPID_LOADPROGRAM, "load modules"),
        (Grant.RAPID_DEBUG, "ask for write access"),
        (Grant.REMOTE_WARMSTART, "restart"),
        (Grant.BACKUP, "make a backup, or say --no-backup"),
    ],
)
def test_grants_that_are_missing_are_said_before_anything_is_changed(site: Site, missing: Grant, what: str) -> None:
    site.transport.adapter._users.granted = tuple(set(GRANTS) - {missing, Grant.FULL_ACCESS})
    plan = site.plan()
    lacks = message("grants_missing", grants=(f"{missing.value} ({what})",))
    assert plan.refusals == (lacks,)
    with refused(RobotNotReady, "nothing_changed", reason=lacks):
        site.installation().install(plan)
    assert site.transport.changes == 0
    assert bool(site.plan(makes_backup=False).refusals) is (missing is not Grant.BACKUP)


def test_grants_that_are_asked_for_are_enough(site: Site) -> None:
    needed = (*_GRANTS, *_BACKUP_GRANT)
    site.transport.adapter._users.granted = needed
    site.install()
    site.transport.adapter._users.granted = needed
    roll_back(site)


def test_record_that_cannot_be_written_is_said_before_the_controller_makes_a_backup(site: Site) -> None:
    plan = site.plan()
    (site.folder / "installations").write_text("a file where the folder would be")
    with refused(SettingsError, "record_folder_not_writable", reason="Not a directory"):
        site.installation().install(plan)
    assert site.transport.changes == 0


def test_foreign_main_is_explained_and_comes_back_with_a_roll_back(site: Site) -> None:
    site.controller.files["HOME:/production.mod"] = FOREIGN
    site.controller.load_module("T_ROB_L", "HOME:/production.mod", replace=False)
    (refusal,) = site.plan().refusals
    program = message("module_with_main", task="T_ROB_L", module="Production", lines=5)
    assert refusal == message("other_main_in_task", program=program)
    home, cfg, modules = site.home(), site.cfg(), site.modules()
    site.install(replaces_main=True)
    assert "Production" not in site.modules()["T_ROB_L"]
    roll_back(site)
    assert (site.home(), site.cfg(), site.modules()) == (home, cfg, modules)


def configured_main(task: str) -> Message:
    return message("configured_module_with_main", file=f"HOME:/production.mod in {task}")


def test_main_that_the_configuration_loads_at_each_start_is_explained_and_comes_back(site: Site) -> None:
    site.controller.files["HOME:/production.mod"] = FOREIGN
    entry = {"File": "HOME:/production.mod", "ModName": "Production", "Task": "T_ROB_R"}
    site.controller.configuration.put("SYS", "CAB_TASK_MODULES", entry)
    site.client.wait_for_restart()
    assert "Production" in site.modules()["T_ROB_R"]
    loaded, configured = site.plan().refusals
    assert_says(loaded.values["program"], "module_with_main", task="T_ROB_R", module="Production")
    assert configured.values["program"] == configured_main("T_ROB_R")
    home, cfg, modules = site.home(), site.cfg(), site.modules()
    site.install(replaces_main=True)
    assert "Production" not in site.modules()["T_ROB_R"]
    site.client.wait_for_restart()
    assert "Production" not in site.modules()["T_ROB_R"]
    assert site.plan().changes == ()
    roll_back(site)
    assert (site.home(), site.cfg(), site.modules()) == (home, cfg, modules)


def test_lines_that_load_one_file_into_several_tasks_all_go_and_come_back(site: Site) -> None:
    site.controller.files["HOME:/production.mod"] = FOREIGN
    configuration = site.controller.configuration
    for into in ({"Task": "T_ROB_L"}, {"Task": "T_ROB_R", "Hidden": "TRUE"}, {"Task": "T_LOG"}):
        configuration.put("SYS", "CAB_TASK_MODULES", {"File": "HOME:/production.mod", "ModName": "Production", **into})
    site.client.wait_for_restart()
    programs = [each.values["program"] for each in site.plan().refusals]
    configured = [each for each in programs if each.code == "configured_module_with_main"]
    assert configured == [configured_main("T_ROB_L"), configured_main("T_ROB_R")]
    cfg, modules = site.cfg(), site.modules()
    assert "Production" in modules["T_ROB_L"]
    assert "Production" in modules["T_ROB_R"]
    site.install(replaces_main=True)
    site.client.wait_for_restart()
    assert not any("Production" in names for names in site.modules().values())
    left = [each.attributes for each in configuration.instances("SYS", "CAB_TASK_MODULES")]
    assert [each["Task"] for each in left if each["File"] == "HOME:/production.mod"] == ["T_LOG"]
    assert site.plan().changes == ()
    roll_back(site)
    assert site.modules() == modules
    assert {domain: sorted(text.splitlines()) for domain, text in site.cfg().items()} == {
        domain: sorted(text.splitlines()) for domain, text in cfg.items()
    }


def test_roll_back_brings_the_program_that_was_there_last(site: Site) -> None:
    site.controller.files["HOME:/production.mod"] = FOREIGN
    site.controller.load_module("T_ROB_L", "HOME:/production.mod", replace=False)
    site.transport.kill_at = 8  # the first installation ends when it has recorded the program
    with suppress(Interruption):
        site.install(replaces_main=True)
    site.reconnect()
    newer = FOREIGN.replace("WaitTime 1", "WaitTime 2")
    site.controller.files["HOME:/production.mod"] = newer
    site.controller.load_module("T_ROB_L", "HOME:/production.mod", replace=True)
    site.installation().install(site.plan(replaces_main=True), makes_backup=False)
    roll_back(site)
    assert "WaitTime 2" in site.client.module_text("T_ROB_L", "Production")


def test_program_that_starts_during_the_backup_is_left_alone(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    read_tree = site.client.read_tree

    def slow(*arguments: Any) -> dict[str, bytes]:
        site.controller.mode = OperatingMode.MANUAL_REDUCED
        return read_tree(*arguments)

    monkeypatch.setattr(site.client, "read_tree", slow)
    home, cfg = site.home(), site.cfg()
    with refused(RobotNotReady, "nothing_changed", reason=message("not_in_auto", mode="MANR")):
        site.install()
    assert (site.home(), site.cfg()) == (home, cfg)


def test_restart_that_is_due_is_part_of_the_plan(site: Site) -> None:
    site.install()
    record = InstallationRecord.of("yumi", site.folder)
    record.is_restart_due = True
    record.save()
    plan = site.plan()
    assert plan.changes == ()
    assert plan.needs_restart
    assert not plan.is_empty
    assert plan.notes[-1] == message("restart_is_due")
    site.installation().install(plan)
    assert site.plan().is_empty


def test_routines_of_the_user_are_neither_replaced_nor_deleted(site: Site) -> None:
    path, home, cfg, modules = "HOME:/yumi/TRobSystem.sys", site.home(), site.cfg(), site.modules()
    site.install()
    edited = delivered_modules()["TRobSystem"].replace("RETURN FALSE", "RETURN TRUE")
    site.controller.files[path] = edited
    site.client.load_module("T_ROB_L", path)
    site.client.load_module("T_ROB_R", path)
    assert site.plan().is_empty
    roll_back(site)
    assert (site.cfg(), site.modules()) == (cfg, modules)
    assert site.home().keys() - home.keys() == {"HOME:/yumi", path}
    site.installation().install(site.plan(), makes_backup=False)
    assert "RETURN TRUE" in site.client.module_text("T_ROB_R", "TRobSystem")


def test_restart_waits_for_who_works_with_the_robot(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    apply_cfg = Installation._apply_cfg

    def apply(installation: Installation, *contents: Any) -> None:
        apply_cfg(installation, *contents)
        site.controller.mode = OperatingMode.MANUAL_REDUCED

    monkeypatch.setattr(Installation, "_apply_cfg", apply)
    with refused(RobotNotReady, "not_restarted", reason=message("not_in_auto", mode="MANR")):
        site.install()


def test_backup_that_is_none_is_refused_before_anything_is_written(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(site.client, "read_tree", lambda *_: {"SYSPAR/EIO.cfg": b""})
    home = site.home()
    with refused(RobotNotReady, "nothing_changed") as refusal:
        site.install()
    assert_says(refusal.value.said.values["reason"], "no_backup", needed="BACKINFO/")
    assert site.home() == home
    assert not list(site.folder.rglob("*.json"))


def test_backup_without_progress_is_an_error(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = site.transport.handle_request

    def without_location(request: httpx.Request) -> httpx.Response:
        reply = handle(request)
        reply.headers.pop("Location", None)
        return reply

    monkeypatch.setattr(site.transport, "handle_request", without_location)
    with refused(ProtocolError, "job_without_progress", address="memory", what="making the backup monday"):
        site.client.backup("monday")


def test_add_in_keeps_its_modules_and_gets_the_destinations_only(tmp_path: Path) -> None:
    site = Site(tmp_path, WorldSettings())  # its options name the Add-In
    plan = site.plan()
    assert [change.place for change in plan.changes] == ["SIO COM_TRP ROB_R", "SIO COM_TRP ROB_L"]
    assert_says(plan.notes[0], "add_in_keeps_modules")


def test_signal_of_another_with_our_name_is_refused(site: Site) -> None:
    site.controller.configuration.put(
        "EIO", "EIO_SIGNAL", {"Name": "EGM_STOP", "SignalType": "DO", "Device": "D652_10"}
    )
    (kind, device) = site.plan().refusals
    taken = "configured_name_taken"
    assert_says(kind, taken, name="EGM_STOP", attribute="SignalType", value="DO", needed="DI")
    assert_says(device, taken, name="EGM_STOP", attribute="Device", value="D652_10")


def test_controller_without_grippers_gets_no_gripper_module(site: Site) -> None:
    identity = site.controller.identity
    options = tuple(each for each in identity.options if each != "SmartGripper")
    site.controller.identity = type(identity)(options=options)
    site.install()
    assert "TRobSG" not in site.modules()["T_ROB_R"]
    assert "HOME:/yumi/TRobSG.mod" not in site.home()


def test_removal_without_a_record_takes_what_is_ours(site: Site, tmp_path: Path) -> None:
    home, cfg = site.home(), site.cfg()
    site.install()
    site.folder = tmp_path / "another computer"
    installation = site.installation()
    installation.undo(installation.plan_removal(site.client.connect(), HERE))
    assert (site.home(), site.cfg()) == (home, cfg)
    again = site.installation()
    plan = again.plan_removal(site.client.connect(), HERE)
    assert plan.changes == ()
    again.undo(plan)
    assert (site.home(), site.cfg()) == (home, cfg)


def test_interrupted_removal_without_a_record_goes_on_removing(site: Site, tmp_path: Path) -> None:
    home, cfg = site.home(), site.cfg()
    site.install()
    site.folder = tmp_path / "another computer"
    site.transport.kill_at = site.transport.changes + 5
    for _ in range(2):
        with suppress(Interruption):
            installation = site.installation()
            installation.undo(installation.plan_removal(site.client.connect(), HERE))
        site.reconnect()
    assert (site.home(), site.cfg()) == (home, cfg)


def test_removal_without_a_record_keeps_what_is_the_add_ins(tmp_path: Path) -> None:
    site = Site(tmp_path, WorldSettings())  # its options name the Add-In
    installation, modules, cfg = site.installation(), site.modules(), site.cfg()
    plan = installation.plan_removal(site.client.connect(), HERE)
    assert plan.changes == ()
    assert plan.refusals[0] == message("names_are_of_add_in", add_in="StateMachine Core")
    with refused(RobotNotReady, "nothing_changed", reason=plan.refusals[0]):
        installation.undo(plan)
    assert (site.modules(), site.cfg()) == (modules, cfg)


def changes_of_an_installation(folder: Path) -> int:
    """So many requests of an installation change something."""
    site = Site(folder / "counted")
    site.install()
    return site.transport.changes


@pytest.mark.parametrize("how", ["killed", "cut before", "cut after", "restarted"])
@pytest.mark.parametrize("stride", [short(8), long(1, seconds=300)])
def test_installation_that_ends_at_any_step_is_rolled_back_bit_for_bit(tmp_path: Path, how: str, stride: int) -> None:
    steps = changes_of_an_installation(tmp_path)
    assert steps > 20
    for step in range(1 + ["killed", "cut before", "cut after", "restarted"].index(how) % stride, steps + 1, stride):
        site = Site(tmp_path / f"{how} {step}")
        home, cfg, modules = site.home(), site.cfg(), site.modules()
        if how == "killed":
            site.transport.kill_at = step
        elif how == "restarted":
            site.transport.restart_at = step
        else:
            site.transport.cut_at, site.transport.is_carried_out = step, how == "cut after"
        with suppress(Interruption, NoConnection, RobotNotReady):  # a restart at the last step does not disturb it
            site.install()
        for _ in range(2):  # a controller that restarts is there again
            site.wait(30.0)
        site.reconnect()
        with suppress(CommandRefused):  # it ended before anything was changed
            roll_back(site)
        assert (site.home(), site.cfg(), site.modules()) == (home, cfg, modules), (how, step)
        effective = {domain: site.controller.effective.text(domain) for domain in cfg}
        assert effective == cfg, (how, step)
        assert site.controller.controller_state is ControllerState.MOTORS_OFF


def test_roll_back_that_is_killed_itself_goes_on(site: Site) -> None:
    home, cfg = site.home(), site.cfg()
    site.install()
    site.reconnect()
    for step in range(1, 100, 6):
        site.transport.kill_at = step
        try:
            roll_back(site)
            break
        except Interruption:
            for _ in range(2):
                site.wait(30.0)
            site.reconnect()
    assert (site.home(), site.cfg()) == (home, cfg)


def test_factory_robot_moves_both_arms_within_90_seconds_of_its_time(tmp_path: Path) -> None:
    yumi = VirtualYumi(WorldSettings(system=factory_system(), grippers_are_calibrated=True))
    client = yumi.client()
    installation = Installation(client, InstallationRecord.of("yumi", tmp_path))
    installation.install(installation.plan(client.connect(), HERE))
    with streaming(client, yumi):
        streams = listen(yumi.egm, yumi, 0.2)
    assert all(streams[side].is_of(client.joint_target(side.unit)) for side in Side)
    yumi.start_egm()
    start = {side: yumi.world.arms[side].position for side in Side}
    sessions = {side: SensorSession(JointCodec()) for side in Side}
    for _ in range(250):
        yumi.wait(yumi.world.cycle_time)
        for side, session in sessions.items():
            if session.accept(yumi.egm[side].receive(), yumi.now()) is not None:
                goal = start[side][0] + 0.05, *start[side][1:]
                yumi.egm[side].send(JointCodec().encode_joints(session.next_seqno(), goal, None))
    for side in Side:
        assert yumi.world.arms[side].position[0] - start[side][0] == pytest.approx(0.05, abs=0.01)
    assert yumi.now() < 90.0
