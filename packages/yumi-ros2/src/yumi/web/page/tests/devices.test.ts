import assert from "node:assert/strict";
import { test } from "node:test";

import { beyondRest, chosenArms, ClutchGate, Keyboard, Pad, SpaceMouse, STICK_SPEED, STICK_TURNING, type GamepadInputs, type HidDevice } from "../src/devices";
import { operatorPose, placeOf } from "../src/headset";
import type { Hand, Hands } from "../src/messages";
import { armWords } from "../src/teleoperation_panel";

const HELD: Hand = { clutch: true, twist: [0, 0, 0, 0, 0, 0] };
const FREE: Hand = { clutch: false };

const held = (gate: ClutchGate, hands: Hands, isOpen = true) => {
  const { right, left } = gate.pass(hands, isOpen);
  return [right.clutch, left.clutch];
};

test("clutch that was held at first counts when it was released and is pressed again", () => {
  const gate = new ClutchGate();
  assert.deepEqual(held(gate, { right: HELD, left: FREE }), [false, false]);
  assert.deepEqual(held(gate, { right: HELD, left: HELD }), [false, true]);
  assert.deepEqual(held(gate, { right: FREE, left: HELD }), [false, true]);
  assert.deepEqual(held(gate, { right: HELD, left: HELD }), [true, true]);
});

test("clutch that is held while the device may not move the arms must be released first", () => {
  const gate = new ClutchGate();
  gate.pass({ right: FREE, left: FREE }, true);
  assert.deepEqual(held(gate, { right: HELD, left: HELD }), [true, true]);
  assert.deepEqual(held(gate, { right: HELD, left: HELD }, false), [false, false]); // the page was hidden
  assert.deepEqual(held(gate, { right: HELD, left: FREE }), [false, false]);
  assert.deepEqual(gate.isBlocked, { right: true, left: false });
  assert.deepEqual(held(gate, { right: FREE, left: HELD }), [false, true]);
  assert.deepEqual(gate.isBlocked, { right: false, left: false });
});

test("hand that the device does not see any more moves nothing, nor when it is seen again with the clutch held", () => {
  const gate = new ClutchGate();
  gate.pass({ right: FREE, left: FREE }, true);
  assert.deepEqual(held(gate, { right: HELD, left: HELD }), [true, true]);
  assert.deepEqual(held(gate, { left: HELD }), [false, true]);
  assert.deepEqual(held(gate, { right: HELD, left: HELD }), [false, true]);
  assert.deepEqual(held(gate, {}, true), [false, false]); // it was unplugged
  assert.deepEqual(held(gate, { right: HELD, left: HELD }), [false, false]);
});

test("what does not count has neither pose nor gripper", () => {
  assert.deepEqual(new ClutchGate().pass({ right: { ...HELD, gripper: 1 } }, true).right, { clutch: false });
});

test("keyboard moves the tool along the person's axes, by the place of its keys, and both arms alike", () => {
  const keyboard = new Keyboard();
  for (const code of ["Space", "KeyW", "KeyD", "KeyR", "ArrowLeft", "KeyX"]) {
    assert.ok(Keyboard.isKnown(code), code);
    keyboard.press(code);
  }
  assert.ok(!Keyboard.isKnown("KeyP"));
  const hands = keyboard.read(chosenArms("both"));
  assert.deepEqual(hands.right, { clutch: true, twist: [STICK_SPEED, -STICK_SPEED, STICK_SPEED, 0, 0, STICK_TURNING], elbow: STICK_TURNING });
  assert.deepEqual(hands.left, hands.right);
  keyboard.release("KeyW");
  keyboard.release("Space");
  assert.deepEqual([keyboard.read(["left"]).left?.clutch, keyboard.read(["left"]).left?.twist![0]], [false, 0]);
  assert.deepEqual(Object.keys(keyboard.read(["left"])), ["left"]);
});

test("keyboard that loses the focus holds no key", () => {
  const keyboard = new Keyboard();
  keyboard.press("Space");
  keyboard.press("KeyW");
  keyboard.releaseAll();
  assert.deepEqual(keyboard.read(["right"]).right, { clutch: false, twist: [0, 0, 0, 0, 0, 0] });
});

test("gripper keys count while the clutch is held, and are forgotten with it", () => {
  const keyboard = new Keyboard();
  keyboard.press("KeyC");
  assert.equal(keyboard.read(["right"]).right?.gripper, undefined);
  keyboard.press("Space");
  keyboard.press("KeyC");
  assert.equal(keyboard.read(["right"]).right?.gripper, 1);
  keyboard.press("KeyV");
  assert.equal(keyboard.read(["right"]).right?.gripper, 0);
  keyboard.release("Space");
  assert.equal(keyboard.read(["right"]).right?.gripper, undefined);
});

const inputs = (axes: number[], pressed: Record<number, number> = {}): GamepadInputs => ({
  axes, buttons: Array.from({ length: 17 }, (_, index) => ({ pressed: Boolean(pressed[index]), value: pressed[index] ?? 0 })),
});

test("gamepad's bumpers are the clutches of the arms on their sides", () => {
  const pad = new Pad(() => []);
  const clutches = (pressed: Record<number, number>) => Object.entries(pad.handsOf(inputs([0, 0, 0, 0], pressed), chosenArms("both"))).map(([side, hand]) => [side, hand.clutch]);
  assert.deepEqual(clutches({ 5: 1 }), [["right", true], ["left", false]]);
  assert.deepEqual(clutches({ 4: 1 }), [["right", false], ["left", true]]);
  assert.deepEqual(Object.keys(pad.handsOf(inputs([0, 0, 0, 0], { 4: 1 }), ["right"])), ["right"]);
});

test("gamepad's sticks, triggers and cross are velocities in the person's frame", () => {
  const pad = new Pad(() => []);
  const twist = (axes: number[], pressed: Record<number, number> = {}) => pad.handsOf(inputs(axes, pressed), ["right"]).right!;
  const near = (actual: number[] | undefined, expected: number[]) => actual!.forEach((each, axis) => assert.ok(Math.abs(each - expected[axis]!) < 1e-12, String(actual)));
  near(twist([0, -1, 0, 0]).twist, [STICK_SPEED, 0, 0, 0, 0, 0]); // pushed away
  near(twist([1, 0, 0, 0]).twist, [0, -STICK_SPEED, 0, 0, 0, 0]); // to the right
  near(twist([0, 0, 0, 0], { 7: 1 }).twist, [0, 0, STICK_SPEED, 0, 0, 0]); // the right trigger is up
  near(twist([0, 0, 1, 0]).twist, [0, 0, 0, 0, 0, -STICK_TURNING]);
  near(twist([0.1, -0.1, 0.1, 0.05]).twist, [0, 0, 0, 0, 0, 0]); // sticks that rest
  assert.equal(twist([0, 0, 0, 0], { 12: 1 }).elbow, STICK_TURNING);
  assert.deepEqual([twist([0, 0, 0, 0], { 0: 1 }).gripper, twist([0, 0, 0, 0], { 5: 1, 0: 1 }).gripper], [undefined, 1]);
});

test("gamepad is the first of the standard layout, and none where that is unplugged", () => {
  const pads = [null, { connected: true, mapping: "" }, { connected: true, mapping: "standard", id: "pad", ...inputs([0, 0, 0, 0]) }];
  const pad = new Pad(() => pads as unknown as (Gamepad | null)[]);
  assert.equal(pad.pad?.id, "pad");
  (pads[2] as { connected: boolean }).connected = false;
  assert.equal(pad.read(["right"]), null);
});

test("stick begins to move the tool slowly where its rest ends", () => {
  assert.equal(beyondRest(0.12), 0);
  assert.ok(beyondRest(0.13) < 0.02);
  assert.deepEqual([beyondRest(1), beyondRest(-1)], [1, -1]);
});

const report = (...values: number[]): DataView => {
  const view = new DataView(new ArrayBuffer(2 * values.length));
  values.forEach((value, index) => view.setInt16(2 * index, value, true));
  return view;
};

test("SpaceMouse reports translation and turn, apart or together, in axes of its own", () => {
  const mouse = new SpaceMouse();
  mouse.take(3, new DataView(new Uint8Array([1]).buffer));
  mouse.take(1, report(0, -350, 0));
  assert.deepEqual(mouse.hands(["right"]).right?.twist!.slice(0, 3), [STICK_SPEED, -0, -0]);
  mouse.take(1, report(0, 0, -350, 0, 0, -350));
  const { clutch, twist } = mouse.hands(["left"]).left!;
  assert.deepEqual([clutch, twist![2], twist![5]], [true, STICK_SPEED, STICK_TURNING]);
  mouse.take(2, report(350, 0, 0));
  assert.equal(mouse.hands(["left"]).left!.twist![4], -STICK_TURNING);
});

test("SpaceMouse that falls silent away from rest lets everything go, and one at rest does not", () => {
  let now = 1;
  const mouse = new SpaceMouse(() => now);
  const state = (): [boolean, number] => {
    const { clutch, twist } = mouse.hands(["right"]).right!;
    return [clutch, Math.abs(twist![0]!)];
  };
  const press = () => mouse.take(3, new DataView(new Uint8Array([1]).buffer));
  press();
  mouse.take(1, report(0, 0, 0));
  now = 60; // the cap rests
  assert.deepEqual(state(), [true, 0]);
  mouse.take(1, report(0, -350, 0));
  now += 0.19;
  assert.deepEqual(state(), [true, STICK_SPEED]);
  mouse.take(1, report(0, -350, 0)); // a SpaceMouse whose cap is held still reports on
  now += 0.19;
  assert.deepEqual(state(), [true, STICK_SPEED]);
  now += 0.02;
  assert.deepEqual(state(), [false, 0]); // out of range
  mouse.take(1, report(0, -350, 0));
  assert.deepEqual(state(), [false, STICK_SPEED]); // the clutch may have been let go meanwhile
  press();
  assert.deepEqual(state(), [true, STICK_SPEED]);
});

test("SpaceMouse in whose place another one was chosen moves nothing any more", async () => {
  const mouse = new SpaceMouse();
  const chosen = async () => {
    let report = (_: { reportId: number; data: DataView }): void => undefined;
    const device: HidDevice = {
      opened: true, productName: "SpaceMouse", open: async () => undefined, addEventListener: (_, take) => void (report = take),
    };
    await mouse.connect({ requestDevice: async () => [device], addEventListener: () => undefined });
    return (buttons: number) => report({ reportId: 3, data: new DataView(new Uint8Array([buttons]).buffer) });
  };
  const [first, second] = [await chosen(), await chosen()];
  first(1);
  assert.equal(mouse.read(["right"])!.right!.clutch, false);
  second(1);
  assert.equal(mouse.read(["right"])!.right!.clutch, true);
  first(0);
  assert.equal(mouse.read(["right"])!.right!.clutch, true);
});

test("SpaceMouse's right button closes and opens the gripper in turn while the clutch is held", () => {
  const mouse = new SpaceMouse();
  const after = (...buttons: number[]) => {
    for (const each of buttons) mouse.take(3, new DataView(new Uint8Array([each]).buffer));
    return mouse.hands(["right"]).right?.gripper;
  };
  assert.equal(after(2, 0), undefined);
  assert.equal(after(1, 3), 1);
  assert.equal(after(1, 3), 0);
  assert.equal(after(0), undefined);
  assert.equal(mouse.read(["right"]), null); // none is connected
});

const point = (x: number, y: number, z: number, w = 1) => ({ x, y, z, w }) as DOMPointReadOnly;

test("headset's axes are turned into the operator's: x away, y to the left, z up", () => {
  const pose = operatorPose({ position: point(1, 2, 3), orientation: point(0.1, 0.2, 0.3, 0.9) });
  assert.deepEqual(pose, [-3, -1, 2, 0.9, -0.3, -0.1, 0.2]);
});

test("place of a person is upright, where they are and look to", () => {
  const half = Math.SQRT1_2;
  const { position, orientation } = placeOf({ position: point(1, 1.6, 2), orientation: point(0, half, 0, half) }); // to the left
  assert.deepEqual([position.x, position.y, position.z], [1, 1.6, 2]);
  assert.ok(Math.abs(orientation.y! - half) < 1e-12 && Math.abs(orientation.w! - half) < 1e-12);
  const bowed = placeOf({ position: point(0, 1.6, 0), orientation: point(-0.5, 0, 0, Math.sqrt(0.75)) }).orientation; // down to the hands
  assert.ok(Math.abs(bowed.y!) < 1e-12 && Math.abs(bowed.w! - 1) < 1e-12);
});

test("arm says what its clutch does, why it does nothing, and what it is kept apart from", () => {
  const said = { code: "", sentence: "Something else commands the arm.", action: null };
  const arm = { clutch: "engaged" as const, why: null, limited: null, gripper: null };
  assert.equal(armWords(arm), "follows");
  assert.equal(armWords({ ...arm, limited: { part: "right gripper", other: "body" } }), "follows · kept apart: right gripper – body");
  assert.equal(armWords({ ...arm, clutch: "inert", why: said }), "Something else commands the arm.");
  const both = { ...arm, clutch: "inert" as const, why: said, limited: { part: "left forearm", other: "body" } };
  assert.equal(armWords(both), "Something else commands the arm. · kept apart: left forearm – body");
  assert.equal(armWords(undefined), "–");
});
