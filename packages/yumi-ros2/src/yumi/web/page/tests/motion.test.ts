import assert from "node:assert/strict";
import { test } from "node:test";

import { gripperWords } from "../src/arm_panel";
import { outcomeOf } from "../src/connection";
import { explanation, faultGroups, GROUPS } from "../src/faults";
import { shortened, rotate, seenFrom } from "../src/frames";
import { ofGoal, ofHandle } from "../src/goals";
import { atRest, toolJog } from "../src/jogging";
import { fixed, indexAt } from "../src/numbers";
import { pointOf } from "../src/plan";
import { page } from "./page";

const QUARTER: [number, number, number, number] = [0, 0, Math.SQRT1_2, Math.SQRT1_2]; // about z
const near = (one: readonly number[], other: readonly number[]) => one.forEach((value, index) => assert.ok(Math.abs(value - other[index]!) < 1e-9, `${one}`));

test("vector is turned into a frame and back", () => {
  near(rotate(QUARTER, [1, 0, 0]), [0, 1, 0]);
  near(rotate(QUARTER, rotate(QUARTER, [1, 2, 3]), true), [1, 2, 3]);
  near(seenFrom({ position: [1, 1, 0], quaternion: QUARTER }, [1, 2, 0]), [1, 0, 0]);
  near(shortened([3, 4, 0], 1), [0.6, 0.8, 0]);
  near(shortened([0.3, 0, 0], 1), [0.3, 0, 0]);
});

test("tool is jogged in the frame that is chosen, at a share of the speed", () => {
  const half = { ...page(), jogSpeed: 0.5 };
  assert.deepEqual(toolJog(half, { linear: [0.1, 0, 0] }), { type: "jog_tool", arm: "right", frame: "base", linear: [0.05, 0, 0] });
  assert.deepEqual(toolJog({ ...half, frame: "tool" }, { elbow: 0.5 }), { type: "jog_tool", arm: "right", frame: "tool", elbow: 0.25 });
  assert.equal(toolJog({ ...half, frame: "work object" }, { linear: [0.1, 0, 0] }), null);
  const workObject = { position: [0, 0, 0] as [number, number, number], quaternion: QUARTER };
  const jog = toolJog({ ...half, frame: "work object", workObject }, { linear: [0.1, 0, 0] });
  assert.ok(jog?.type === "jog_tool");
  near(jog.linear!, [0, 0.05, 0]);
});

test("jog ends with the same message without motion", () => {
  assert.deepEqual(atRest({ type: "jog_joints", arm: "left", speeds: [1, 0, 0, 0, 0, 0, 0] }), { type: "jog_joints", arm: "left", speeds: [0, 0, 0, 0, 0, 0, 0] });
  assert.deepEqual(atRest({ type: "jog_tool", arm: "left", frame: "tool", elbow: 1 }), { type: "jog_tool", arm: "left", frame: "tool" });
});

test("goal of the handle and handle of the goal are chosen together", () => {
  assert.equal(ofGoal(page(), "the handle").handle, "goal translate");
  assert.equal(ofGoal({ ...page(), handle: "goal rotate" }, "the handle").handle, "goal rotate");
  assert.equal(ofGoal({ ...page(), handle: "goal rotate" }, "ready").handle, "none");
  assert.equal(ofGoal({ ...page(), handle: "jog rotate" }, "ready").handle, "jog rotate");
  assert.equal(ofGoal({ ...page(), isForBoth: true }, "joint positions").isForBoth, false);
  assert.equal(ofHandle(page(), "goal rotate").goal, "the handle");
  assert.equal(ofHandle({ ...page(), goal: "the handle" }, "jog translate").goal, "home");
});

test("plan is shown between two of its points, and not beyond its ends", () => {
  const points: [number, number[]][] = [[0, [0]], [1, [2]], [3, [4]]];
  assert.deepEqual([-1, 0.5, 2, 9].map((time) => pointOf(points, time)[0]), [0, 1, 3, 4]);
});

test("time of a recording has the last sample before it", () => {
  assert.deepEqual([-1, 0, 0.5, 2, 9].map((time) => indexAt([0, 1, 2], time)), [-1, 0, 0, 2, 2]);
});

test("zero has no sign", () => {
  assert.deepEqual([fixed(-0.001, 2), fixed(-0.01, 2), fixed(0, 1)], ["0.00", "-0.01", "0.0"]);
});

test("faults stand in groups, those without words in one of their own", () => {
  const fault = (name: string) => ({ name, meaning: "something", has_side: false, has_duration: false, default_duration: null, unit: "", default: null });
  const groups = faultGroups(["rws-busy", "new-fault", "egm-loss"].map(fault));
  assert.deepEqual(groups.map(({ label, faults }) => [label, faults[0]?.label]), [
    ["EGM", "Datagrams are lost"], ["Web services (RWS)", "Busy: 503 to everything"], ["Others", "something"],
  ]);
  const words = Object.values(GROUPS).flatMap((group) => Object.values(group));
  assert.equal(new Set(words).size, words.length);
});

test("arm that a fault is for is named beside the sentence that says what the fault does", () => {
  const fault = { name: "x", meaning: "datagrams are lost", has_side: true, has_duration: false, default_duration: null, unit: "", default: null };
  assert.equal(explanation(fault, "left"), "Datagrams are lost. Chosen: the left arm.");
  assert.equal(explanation({ ...fault, has_side: false }, "left"), "Datagrams are lost.");
  assert.match(explanation({ ...fault, has_duration: true }, "left"), /does not end by itself/);
});

test("gripper and what it came to are read in words", () => {
  const gripper = { state: "open", is_calibrated: true, is_holding: false, width: 0.05, force: 10, error: 0 };
  assert.equal(gripperWords(gripper), "open, 50.0 mm");
  assert.equal(gripperWords({ ...gripper, is_holding: true, width: 0.02 }), "20.0 mm, holding with 10 N");
  assert.equal(gripperWords({ ...gripper, is_calibrated: false, error: 3 }), "open, 50.0 mm, not calibrated, error 3");
  assert.equal(gripperWords(null), "unknown");
  assert.equal(outcomeOf({ outcome: "holding", width: 0.02 }), "The gripper holds something 20.0 mm wide.");
  assert.equal(outcomeOf(null), "");
});
