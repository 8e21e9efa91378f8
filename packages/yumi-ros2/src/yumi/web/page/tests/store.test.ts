import assert from "node:assert/strict";
import { test } from "node:test";

import { initialPage, ofEvents, ofLoss, ofState, ofView, frameOf } from "../src/store";
import { driverState, MODEL, page, stateMessage, viewMessage } from "./page";

const PLAN = { plan: 1, duration: 1, planning_time: 1, clearance: 0.1, arms: {}, time: 0 };

test("plan is forgotten with the control and with the connection", () => {
  const planned = { ...page(), plan: PLAN };
  assert.equal(ofView(planned, viewMessage({ control: "elsewhere" })).plan, null);
  assert.ok(!("plan" in ofView(planned, viewMessage())));
  assert.equal(ofLoss(planned, "lost").plan, null);
  assert.equal(ofLoss(planned, "lost").view?.control, "none");
});

test("state is forgotten where there is no robot", () => {
  assert.equal(ofView(page(), viewMessage({ why_no_robot: "No driver runs." })).state, null);
});

test("silence of an arm counts from its beginning, and ends with it", () => {
  const silent = driverState({ egm: { right: "off", left: "running" } });
  const begun = { ...page(), ...ofState(page(), stateMessage({ state: silent, time: 5 })) };
  assert.equal(begun.silentSince, 5);
  assert.equal(ofState(begun, stateMessage({ state: silent, time: 9 })).silentSince, 5);
  assert.equal(ofState(begun, stateMessage({ time: 10 })).silentSince, Infinity);
});

test("events are kept newest first, a hundred of them", () => {
  const event = (time: number) => ({ number: time, time, level: "info", code: "text", sentence: `${time}`, action: null });
  const first = ofEvents([], [event(1), event(2)]).events!;
  assert.deepEqual(first.map(({ time }) => time), [2, 1]);
  const many = ofEvents(first, Array.from({ length: 120 }, (_, index) => event(index + 3))).events!;
  assert.deepEqual([many.length, many[0]?.time], [100, 122]);
});

test("frame of a box is found by its name, and that of a work object where one was set", () => {
  const box = { name: "table", pose: { position: [1, 2, 3] as [number, number, number], orientation: [1, 0, 0, 0] as [number, number, number, number] }, size: [1, 1, 1] as [number, number, number] };
  const seen = page({ view: { surroundings: { boxes: [box] } } });
  assert.deepEqual(frameOf({ ...seen, frame: "box table" }), { position: [1, 2, 3], quaternion: [0, 0, 0, 1] });
  assert.equal(frameOf({ ...seen, frame: "base" }), null);
  assert.equal(frameOf({ ...seen, frame: "work object" }), null);
});

test("page begins with the first arm of the robot, and its first pose", () => {
  assert.deepEqual([initialPage(MODEL, null).arm, initialPage(MODEL, null).goal], ["right", "home"]);
});
