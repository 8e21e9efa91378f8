import assert from "node:assert/strict";
import { test } from "node:test";

import { permissions } from "../src/permissions";
import { ofTime } from "../src/recording";
import { inTheWay, remedyButton, verdict } from "../src/verdict";
import type { Said, ViewMessage } from "../src/messages";
import { CONNECTING, ofLoss } from "../src/store";
import { arm, driverState, FAULT, off, page, reason } from "./page";

const PRESSED = reason("The emergency stop is pressed.", "release_stop");
const MANUAL = reason("The controller is in MANR.", "turn_to_auto");
const CONFIRM = reason("A person must confirm the stop.", "confirm_stop");

test("band is green while controllers command both arms", () => {
  const { level, head, lines } = verdict(page());
  assert.deepEqual([level, head, lines], ["good", "Ready: EGM holds both arms", []]);
  assert.equal(remedyButton(page()), "");
});

test("band is yellow while no controller commands an arm that EGM holds", () => {
  const controllers = { right: [{ name: "joint_goal_controller", commands: true }], left: [{ name: "joint_goal_controller", commands: false }] };
  const idle = page({ state: driverState({ controllers }) });
  const { level, head, lines } = verdict(idle);
  assert.equal(remedyButton(idle), "start");
  assert.equal(level, "warn");
  assert.equal(head, "EGM holds both arms, but no controller commands the left arm");
  assert.match(lines.join(" "), /“Start EGM”/);
});

test("cause comes first, then what is in the way, once", () => {
  const stopped = page({ causes: [reason("Emergency stop.")], reasons: [PRESSED, CONFIRM], stop: "10013-1" });
  const { level, head, lines } = verdict(stopped);
  assert.deepEqual([level, head, lines], ["error", "Stopped: Emergency stop.", [PRESSED.sentence, CONFIRM.sentence]]);
});

test("robot that nothing has stopped is not called stopped, and its reason stands there once", () => {
  const off = [reason("The motors are off.", "motors_on")];
  const { level, head, lines } = verdict(page({ reasons: off, causes: off }));
  assert.deepEqual([level, head, lines], ["warn", "Cannot move: The motors are off.", []]);
});

test("recover is offered when nothing is left that only a person can end", () => {
  const pressed = page({ reasons: [PRESSED, CONFIRM], stop: "10013-1" });
  assert.deepEqual(inTheWay(pressed), [PRESSED]);
  assert.equal(remedyButton(pressed), "");
  assert.equal(permissions(pressed).recover, PRESSED.sentence);
  assert.equal(permissions(pressed).start, PRESSED.sentence);
  const released = page({ reasons: [CONFIRM], stop: "10013-1" });
  assert.equal(remedyButton(released), "recover");
  assert.equal(permissions(released).recover, "");
  assert.match(permissions(released).start, /“Recover…”/);
});

test("virtual robot has the buttons that a FlexPendant has", () => {
  const offered = (said: Said, isVirtual = true, faults = [FAULT]) =>
    remedyButton(page({ view: { is_virtual: isVirtual, faults: isVirtual ? faults : [] }, reasons: [said, CONFIRM], stop: "10013-1" }));
  assert.deepEqual([offered(PRESSED), offered(MANUAL), offered(reason("The guard is open."))], ["release-stop", "key", ""]);
  assert.deepEqual([offered(PRESSED, false), offered(MANUAL, false)], ["", ""]);
  assert.deepEqual([offered(PRESSED, true, []), offered(MANUAL, true, [])], ["", ""]); // to a page on another machine
  assert.equal(permissions(page({ view: { is_virtual: true }, reasons: [PRESSED, CONFIRM] })).recover, PRESSED.sentence);
});

test("what a message says that a person can do is the button that does it", () => {
  const offered = (action: string) => remedyButton(page({ reasons: [reason("Something.", action)] }));
  const buttons = ["recover", "confirm_stop", "motors_on", "start_egm", "stop_egm", "restart_egm", "calibrate"].map(offered);
  assert.deepEqual(buttons, ["recover", "recover", "recover", "start", "stop", "stop", "calibrate"]);
  assert.deepEqual(["retreat", "switch", "give_radians"].map(offered), ["", "", ""]);
});

test("page without control is told to take it first, and has no button for the remedy", () => {
  const looking = page({ view: { control: "none" }, state: driverState({ egm: off() }) });
  assert.deepEqual(verdict(looking).lines, ["Take control first.", "Press “Start EGM”."]);
  assert.equal(remedyButton(looking), "");
  const real = page({ view: { control: "none", why_not_operated: "No." }, state: driverState({ egm: off() }) });
  assert.deepEqual(verdict(real).lines, []);
});

test("EGM whose datagrams do not arrive is named after a second", () => {
  const silent = driverState({ egm: { right: "streaming", left: "running" } });
  const begun = page({ state: silent, reasons: [reason("Not idle.", "recover")] });
  assert.match(verdict(begun).head, /Not idle/);
  assert.match(verdict({ ...begun, stateTime: 11.5 }).head, /runs EGM on the right arm, but its datagrams do not arrive/);
  assert.match(verdict({ ...begun, stateTime: 11.5 }).lines.join(" "), /firewall/);
  const check = (view: Partial<ViewMessage>) => verdict({ ...begun, view: { ...begun.view, is_virtual: true, ...view }, stateTime: 11.5 }).lines[0];
  assert.match(check({ faults: [FAULT] })!, /inject “All EGM faults end”/);
  assert.equal(check({ why_no_faults: "Only from its own machine." }), "Only from its own machine.");
});

test("arms that move, hold for a problem, or are kept apart are named", () => {
  const moving = driverState({ arms: { right: arm({ mode: "moving" }), left: arm({ mode: "moving" }) } });
  assert.equal(verdict(page({ state: moving })).head, "The right and the left arm move");
  const held = page({ problems: { right: reason("Right arm: the replies are lost.") }, state: driverState({ egm: { right: "running", left: "off" } }) });
  assert.equal(verdict(held).head, "Right arm: the replies are lost.");
  assert.equal(remedyButton(held), "start");
  assert.equal(remedyButton({ ...held, problems: { right: reason("It waits.", "recover") } }), "recover");
  const limited = { right: { part: "right gripper", other: "body" } };
  assert.equal(verdict(page({ limited })).head, "The right arm is kept apart: right gripper – body");
});

test("buttons that cannot work have the reason", () => {
  assert.equal(permissions(page()).start, "EGM runs on both arms.");
  assert.match(permissions(page()).calibrate, /EGM must not run/);
  assert.match(permissions(page()).recover, /Nothing is stopped/);
  assert.equal(permissions(page()).move, "");
  const ended = page({ state: driverState({ egm: off(), arms: { right: arm({ mode: "no_egm" }), left: arm() } }) });
  assert.match(permissions(ended).move, /The right arm follows no commands/);
  assert.equal(permissions(ended).start, "");
  assert.equal(permissions({ ...ended, arm: "left" }).move, "");
  const uncommanded = page({ state: driverState({ controllers: { right: [], left: [] } }) });
  assert.equal(permissions(uncommanded).start, "");
});

test("band of a recording says what was so at its time, and asks for nothing", () => {
  const cycles = (running: boolean) => ({
    time: [0, 1], position: [[0], [1]], velocity: [[0], [0.5]], sent: [[0], [1]], reference: [[0], [1]], is_running: [running, running],
  });
  const recording = {
    name: "x.mcap", duration: 3, grippers: { right: [], left: [] }, arms: { right: cycles(true), left: cycles(false) },
    states: [{ time: 0, egm: { r: "running", l: "off" } }], events: [{ time: 2.5, sentence: "Feedback was lost.", is_fault: true }],
  };
  const at = (time: number) => verdict({ ...page({ view: { is_recording: true, control: "none" } }), recording, ...ofTime(recording, time) });
  assert.deepEqual(at(0), { level: "good", kind: "Recording x.mcap at 0.00 s", head: "EGM held the right arm", lines: [] });
  assert.equal(at(1).head, "The right arm moved");
  assert.deepEqual([at(2.6).level, at(2.6).head], ["error", "Stopped: Feedback was lost."]);
  const stopped = { ...recording, states: [{ time: 0, reasons: [CONFIRM.sentence], causes: ["Emergency stop."] }] };
  const { head, lines } = verdict({ ...page(), recording: stopped, ...ofTime(stopped, 0) });
  assert.deepEqual([head, lines], ["Stopped: Emergency stop.", [CONFIRM.sentence]]);
  const motorsOff = { ...recording, states: [{ time: 0, reasons: ["The motors are off."], causes: ["The motors are off."] }] };
  const begun = verdict({ ...page(), recording: motorsOff, ...ofTime(motorsOff, 0) });
  assert.deepEqual([begun.level, begun.head, begun.lines], ["warn", "The arms could not move: The motors are off.", []]);
});

test("band of a page that connects, or whose connection is lost, says nothing of the robot", () => {
  const { level, head } = verdict({ ...page({ view: { why_no_robot: CONNECTING } }), state: null });
  assert.deepEqual([level, head], ["wait", CONNECTING]);
  const lost = { ...page(), ...ofLoss(page(), "It ended.") }; // the state is the one last seen
  assert.deepEqual([verdict(lost).head, verdict(lost).lines], ["No connection", ["It ended."]]);
});
