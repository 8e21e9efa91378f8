import assert from "node:assert/strict";
import { test } from "node:test";

import { gripperWords } from "../src/arm_panel";
import { outcomeOf } from "../src/connection";
import { ofGoal, ofHandle } from "../src/goals";
import { atRest, toolJog } from "../src/jogging";
import { pointOf } from "../src/plan";
import { page } from "./page";

const QUARTER: [number, number, number, number] = [0, 0, Math.SQRT1_2, Math.SQRT1_2]; // about z
const near = (one: readonly number[], other: readonly number[]) => one.forEach((value, index) => assert.ok(Math.abs(value - other[index]!) < 1e-9, `${one}`));

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

test("gripper and what it came to are read in words", () => {
  const gripper = { state: "open", is_calibrated: true, is_holding: false, width: 0.05, force: 10, error: 0 };
  assert.equal(gripperWords(gripper), "open, 50.0 mm");
  assert.equal(gripperWords({ ...gripper, is_holding: true, width: 0.02 }), "20.0 mm, holding with 10 N");
  assert.equal(gripperWords({ ...gripper, is_calibrated: false, error: 3 }), "open, 50.0 mm, not calibrated, error 3");
  assert.equal(gripperWords(null), "unknown");
  assert.equal(outcomeOf({ outcome: "holding", width: 0.02 }), "The gripper holds something 20.0 mm wide.");
  assert.equal(outcomeOf(null), "");
});
