import assert from "node:assert/strict";
import { test } from "node:test";

import { initialPage, isOther, nameOf, ofLog, ofLoss, ofView, verdict, type ControllerPage } from "../src/controller";
import type { ControllerKind, ControllerMessage, ControllerViewMessage, Model } from "../src/messages";
import { CONNECTING } from "abb-view/store";

const CONTROLLER: ControllerKind = { address: "127.0.0.1:80", robot: "IRB 120", units: ["ROB_1"], is_drawn: true };

const MODEL: Model = {
  program: "virtual-irc5 view", links: {}, joints: [],
  arms: { ROB_1: { joints: [], axes: [1, 2, 3, 4, 5, 6], fingers: [], tip: "tool0", tool0: "tool0", poses: { home: [0, 0, 0, 0, 0, 0] } } },
  limits: { lower: [], upper: [], velocity: [] }, gripper: { travel: 0.025, force: 20 },
};

const FAULT = { name: "emergency-stop", meaning: "it is pressed", has_side: false, has_duration: false, default_duration: null, unit: "", default: null };

function controllerMessage(changes: Partial<ControllerMessage> = {}): ControllerMessage {
  return {
    type: "controller", time: 3, operating_mode: "AUTO", motors: "motoron", program: "running", speed_ratio: 50,
    arms: { ROB_1: [1, 2, 3, 4, 5, 6] }, missing: ["No driver runs for it."],
    tasks: [{ name: "T_ROB1", execution: "started", is_active: true, is_motion_task: true, pointer: null }], ...changes,
  };
}

function viewMessage(changes: Partial<ControllerViewMessage> = {}): ControllerViewMessage {
  return { type: "view", controller: CONTROLLER, is_virtual: false, log: [], why_no_robot: "", faults: [], ...changes };
}

function page(view: Partial<ControllerViewMessage> = {}, state: Partial<ControllerMessage> = {}): ControllerPage {
  return { ...initialPage(MODEL), ...ofView(viewMessage(view)), state: controllerMessage(state) };
}

test("page begins with the first arm of the robot, and connects", () => {
  const begun = initialPage(MODEL);
  assert.equal(begun.arm, "ROB_1");
  assert.deepEqual(verdict(begun), { level: "wait", kind: "", head: CONNECTING, lines: [] });
});

test("controller is named by its robot, or by its address alone", () => {
  assert.equal(nameOf(CONTROLLER), "IRB 120 at 127.0.0.1:80");
  assert.equal(nameOf({ ...CONTROLLER, robot: "" }), "127.0.0.1:80");
});

test("model is of another robot where its name or its units are others", () => {
  const model = { ...MODEL, controller: CONTROLLER };
  assert.equal(isOther(model, { ...CONTROLLER }), false);
  assert.equal(isOther(model, { ...CONTROLLER, robot: "IRB 14000" }), true);
  assert.equal(isOther(model, { ...CONTROLLER, units: ["ROB_L", "ROB_R"] }), true);
  assert.equal(isOther(MODEL, CONTROLLER), false); // it says of no controller that it is its own
});

test("log of a controller is kept newest first, and begins anew with each view", () => {
  const line = (text: string) => ({ source: "TPWrite" as const, text, level: "information", clock: "", task: "T_ROB1", code: 0, detail: "" });
  const begun = ofView(viewMessage({ log: [line("a"), line("b")] })).log!;
  assert.deepEqual(begun.map(({ text }) => text), ["b", "a"]);
  assert.deepEqual(ofLog(begun, [line("c"), line("d")]).log?.map(({ text }) => text), ["d", "c", "b", "a"]);
});

test("band of a controller says whether RAPID runs, and what is not shown", () => {
  assert.deepEqual(verdict(page()), { level: "good", kind: "", head: "View only: RAPID runs", lines: ["No driver runs for it."] });
  const stopped = verdict(page({}, { program: "stopped" }));
  assert.deepEqual([stopped.level, stopped.head], ["wait", "View only: RAPID is stopped"]);
  assert.equal(verdict(page({}, { program: null })).head, "View only: RAPID is being read");
  assert.equal(verdict({ ...page(), state: null }).head, "Waiting for the robot");
});

test("band of a controller that takes faults does not say that it is viewed only", () => {
  assert.equal(verdict(page({ faults: [FAULT] })).head, "RAPID runs");
});

test("band says why there is no state, and that what was last seen may be old", () => {
  const gone = { ...page(), ...ofView(viewMessage({ why_no_robot: "It does not answer." })) };
  assert.deepEqual([verdict(gone).head, verdict(gone).lines], ["No robot", ["It does not answer."]]);
  const lost = { ...page(), ...ofLoss(page(), "It ended.") };
  assert.deepEqual([verdict(lost).head, verdict(lost).lines], ["No connection", ["It ended."]]);
});
