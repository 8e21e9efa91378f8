import assert from "node:assert/strict";
import { test } from "node:test";

import { explanation, faultGroups, GROUPS } from "abb-view/faults";
import { rotate, seenFrom, shortened } from "abb-view/frames";
import { coordinates, fixed, indexAt } from "abb-view/numbers";
import { Store } from "abb-view/store";

const QUARTER: [number, number, number, number] = [0, 0, Math.SQRT1_2, Math.SQRT1_2]; // about z
const near = (one: readonly number[], other: readonly number[]) => one.forEach((value, index) => assert.ok(Math.abs(value - other[index]!) < 1e-9, `${one}`));

test("every view is called with the whole page after a change", () => {
  const store = new Store({ arm: "right", tab: "joints" });
  const seen: string[] = [];
  store.show(({ arm, tab }) => seen.push(`${arm} ${tab}`));
  store.change({ arm: "left" });
  store.change({ tab: "tool" });
  assert.deepEqual(seen, ["left joints", "left tool"]);
});

test("vector is turned into a frame and back", () => {
  near(rotate(QUARTER, [1, 0, 0]), [0, 1, 0]);
  near(rotate(QUARTER, rotate(QUARTER, [1, 2, 3]), true), [1, 2, 3]);
  near(seenFrom({ position: [1, 1, 0], quaternion: QUARTER }, [1, 2, 0]), [1, 0, 0]);
  near(shortened([3, 4, 0], 1), [0.6, 0.8, 0]);
  near(shortened([0.3, 0, 0], 1), [0.3, 0, 0]);
});

test("time of a recording has the last sample before it", () => {
  assert.deepEqual([-1, 0, 0.5, 2, 9].map((time) => indexAt([0, 1, 2], time)), [-1, 0, 0, 2, 2]);
});

test("zero has no sign", () => {
  assert.deepEqual([fixed(-0.001, 2), fixed(-0.01, 2), fixed(0, 1)], ["0.00", "-0.01", "0.0"]);
});

test("point is read in millimetres", () => {
  assert.equal(coordinates([0.1, -0.00001, 1]), "x\u00a0100.0, y\u00a00.0, z\u00a01000.0");
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
  assert.equal(explanation(fault, null), "Datagrams are lost.");
  assert.match(explanation({ ...fault, has_duration: true }, "left"), /does not end by itself/);
});
