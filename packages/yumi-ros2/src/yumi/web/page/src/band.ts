/** The band at the top: what the robot does and why not, its state in short, and who has control. */

import { chip, measureBand, panelChips, showVerdict, speedChip } from "abb-view/banner";
import { at, button, input, press, text } from "abb-view/dom";
import { armsOf } from "./messages";
import { permissions } from "./permissions";
import { HANDLE_GOAL, hasControl, type Page, type Store } from "./store";
import type { Connection } from "./connection";
import { remedyButton, verdict } from "./verdict";

export function bindBand(store: Store, connection: Connection): void {
  press("take", () => connection.send({ type: hasControl(store.page) ? "give_back" : "take_control" }));
  at("pair").addEventListener("submit", (event) => {
    event.preventDefault();
    void pair(connection);
  });
  press("remedy-button", () => button(remedyButton(store.page)).click());
  store.show(showRemedy);
  store.show(showChips);
  store.show(showControl);
  measureBand();
}

/** Send the code that a person has typed; with the key that comes back this tab operates until it is closed. */
async function pair(connection: Connection): Promise<void> {
  const result = await connection.ask({ type: "pair", code: input("pair-code").value }, button("pair-button"));
  const key = (result as { key?: string } | null)?.key;
  input("pair-code").value = "";
  if (!key) return;
  sessionStorage.setItem("paired", key);
  connection.reconnect();
}

function showRemedy(page: Page): void {
  showVerdict(verdict(page));
  const id = remedyButton(page);
  at("remedy-button").hidden = !id;
  if (id) text(at("remedy-button"), button(id).textContent ?? "");
}

function showChips({ view, state, recording }: Page): void {
  at("chips").hidden = !state || Boolean(view.why_no_robot); // what was last seen may not be so any more
  if (!state || view.why_no_robot) return;
  if (!recording) chip("robot", view.is_virtual ? `${state.robot}, virtual` : state.robot);
  panelChips(state, recording !== null); // a flight record has the cycles alone
  for (const name of armsOf(state)) {
    if (recording && !recording.states.length && !recording.arms[name]!.time.length) continue; // a flight record has one arm
    const leading = state.controllers[name]!.filter((each) => each.commands).map((each) => readable(each.name));
    const isRunning = state.egm[name] === "running";
    const isIdle = isRunning && !leading.length && !recording;
    chip(`EGM ${name}`, isIdle ? "running, no controller" : isRunning && leading.length ? leading.join(", ") : state.egm[name]!,
      isIdle ? "warn" : isRunning ? "good" : "");
  }
  speedChip(state.speed_scale);
}

/** A controller's name as a person reads it. */
export function readable(controller: string): string {
  return controller.replace("_controller", "").replaceAll("_", " ");
}

function showControl(page: Page): void {
  const { view } = page;
  const has = hasControl(page);
  document.body.classList.toggle("operates", has);
  document.body.classList.toggle("records", view.is_recording);
  document.body.classList.toggle("last-seen", Boolean(view.why_no_robot && page.state));
  const isWatched = view.is_recording || Boolean(view.why_not_operated && !has);
  at("take").hidden = isWatched || Boolean(view.why_no_robot && !has);
  text(at("take"), has ? "Give control back" : "Take control");
  at("take").classList.toggle("primary", !has);
  at("pair").hidden = !view.may_pair;
  at("stop").hidden = isWatched && !view.may_stop; // without a connection it says that nothing was sent
  at("robot-panel").hidden = !has;
  const note = view.control === "elsewhere" ? "Another page has control." : view.why_not_operated || "View only.";
  text(at("control-note"), has || view.is_recording || view.why_no_robot ? "" : note);
  showPermissions(page);
}

const OF_PERMISSION = {
  start: ["start"], recover: ["recover"], grip: ["open", "close"], move: ["plan", "execute"],
} as const;

/** Buttons that cannot work are disabled, with the reason as their title. */
function showPermissions(page: Page): void {
  const why = permissions(page);
  const handle = page.goal === HANDLE_GOAL ? "A goal of the handle is reached by a plan." : "";
  for (const [name, ids] of Object.entries(OF_PERMISSION) as [keyof typeof OF_PERMISSION, readonly string[]][]) {
    for (const id of ids) disable(button(id), why[name]);
  }
  for (const { method } of page.model.commands) disable(button(method), method === "calibrate" ? why.calibrate : why.command);
  disable(button("move"), why.move || handle);
  for (const each of document.querySelectorAll<HTMLButtonElement>("button[data-jog]")) disable(each, why.move);
}

function disable(target: HTMLButtonElement, why: string): void {
  target.dataset.title ??= target.title; // what it does
  const title = why || target.dataset.title;
  if (target.title !== title) target.title = title;
  if (target.disabled !== Boolean(why)) target.disabled = Boolean(why);
}
