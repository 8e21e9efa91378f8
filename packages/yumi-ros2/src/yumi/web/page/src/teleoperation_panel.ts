/** The tab Teleoperate: the device, how the arms take its clutches, and the link. */

import { at, choice, input, make, text } from "abb-view/dom";
import { capitalised, SIDES, type TeleoperatedArm } from "./messages";
import { hasControl, type DeviceName, type Page } from "./store";

const HELP: Record<DeviceName, string> = {
  keyboard: "Hold Space, the clutch, and: W S away and back, A D to the sides, R F up and down; arrows, Q E turn the tool; "
    + "Z X turn the elbow; C closes the gripper, V opens it.",
  gamepad: "Hold a bumper, the clutch of the arm on that side. Left stick and triggers move the tool, right stick and cross turn it, "
    + "the cross up and down turns the elbow; the lower button closes the gripper, the right one opens it.",
  spacemouse: "Hold the left button, the clutch. The tool moves and turns as the cap does; the right button closes and opens the gripper.",
  headset: "Squeeze the grip, the clutch of the arm on that side: the tool follows the hand. The trigger is the gripper, the thumbstick "
    + "to the sides turns the elbow. A telephone is the hand while a finger is on it.",
};

const CLUTCH: Record<TeleoperatedArm["clutch"], string> = {
  released: "clutch released: moves nothing", engaging: "being taken over", engaged: "follows",
  inert: "moves nothing: release the clutch, press it again",
};

/** @param name of the device; empty where none is connected. @param isImmersive whether a headset shows the scene. */
export function showTeleoperation(page: Page, name: string, isImmersive: boolean): void {
  const { device, teleoperated } = page;
  if (choice("device").value !== device) choice("device").value = device;
  at("keys").hidden = device !== "keyboard";
  at("connect-spacemouse").hidden = device !== "spacemouse";
  for (const id of ["enter-vr", "enter-ar"]) at(id).hidden = device !== "headset";
  text(at("device-help"), HELP[device]);
  text(at("device-name"), deviceWords(device, name, isImmersive));
  text(at("scale-value"), `${Math.round(page.scale * 100)} %`);
  if (document.activeElement !== at("scale")) input("scale").value = `${Math.round(page.scale * 100)}`;
  const rows = SIDES.map((side) => {
    const arm = teleoperated?.arms[side];
    const row = make("li", {}, make("b", { textContent: `${capitalised(side)} arm` }), make("span", { textContent: armWords(arm) }));
    row.dataset.clutch = arm?.limited && arm.clutch !== "inert" ? "limited" : (arm?.clutch ?? "released");
    return row;
  });
  const list = at("teleop-arms-list");
  if (list.innerHTML !== rows.map((row) => row.outerHTML).join("")) list.replaceChildren(...rows);
  text(at("teleop-link"), linkWords(page));
}

function deviceWords(device: DeviceName, name: string, isImmersive: boolean): string {
  if (device === "gamepad") return name ? `${name}` : "No gamepad of the standard layout: connect one and press a button of it.";
  if (device === "spacemouse") return name ? `${name}` : "Not connected.";
  if (device !== "headset") return "";
  if (!window.isSecureContext) return "A headset needs HTTPS (yumi view --https) or this machine itself.";
  return isImmersive ? "The headset shows the robot." : (navigator as { xr?: unknown }).xr ? "" : "This browser has no WebXR.";
}

export function armWords(arm: TeleoperatedArm | undefined): string {
  if (!arm) return "–";
  return [
    arm.clutch === "inert" && arm.why ? arm.why.sentence : CLUTCH[arm.clutch],
    ...(arm.limited ? [`kept apart: ${arm.limited.part} – ${arm.limited.other}`] : []),
    ...(arm.gripper ? [arm.gripper.sentence] : []),
  ].join(" · ");
}

function linkWords(page: Page): string {
  const { teleoperated } = page;
  const who = hasControl(page) ? "This page operates" : page.view.control === "elsewhere" ? "Another page operates" : "No page operates";
  if (!teleoperated) return `${who}; no frame was answered yet.`;
  if (teleoperated.error) return `${who}; the driver refuses: ${teleoperated.error.sentence}`;
  const dropped = teleoperated.dropped ? `, ${teleoperated.dropped} frames came too late` : "";
  return `${who}; link ${(1000 * teleoperated.delay).toFixed(1)} ms to the driver and back${dropped}.`;
}
