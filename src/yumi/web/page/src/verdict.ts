/** The band: whether the robot moves, else why not and what to do, and the button that does it. */

import { ARMS, type ArmName, type Reason } from "./messages";
import { silentArms, type Page } from "./store";

export type Level = "good" | "warn" | "error" | "wait";

export interface Verdict {
  level: Level;
  kind: string; // what is shown, where it is not the robot now
  head: string;
  lines: string[]; // what else is in the way, and what to do
}

const BEGINNING = 1; // [s] EGM that begins may be without datagrams for so long

/** What the page's buttons do, by the action that a reason names. */
const BUTTONS: Record<string, string> = { recover: "recover", start_egm: "start", stop_egm: "stop" };

const both = (names: readonly ArmName[]): string => (names.length > 1 ? "both arms" : `the ${names[0]} arm`);
const running = ({ state }: Page): ArmName[] => ARMS.filter((name) => state?.egm[name] === "running");
const moving = ({ state }: Page): ArmName[] => ARMS.filter((name) => state?.arms[name].mode === "moving");
const canTakeControl = ({ view }: Page): boolean => view.control === "none" && !view.why_not_operated;

/** The arms that EGM holds and no controller commands. */
export function uncommanded(page: Page): ArmName[] {
  return running(page).filter((name) => !page.state?.controllers[name].some((each) => each.commands));
}

const isPressed = ({ state }: Page): boolean => state?.motors === "emergencystop";
const isManual = ({ state }: Page): boolean => Boolean(state?.operating_mode) && state?.operating_mode !== "AUTO";

/** The button of the virtual robot, which has no FlexPendant to go to, that ends what a person would end there. */
function virtualButton(page: Page): string {
  if (!page.view.is_virtual) return "";
  return isPressed(page) ? "release-stop" : isManual(page) ? "key" : "";
}

/** What no button of the page ends: a person does so at the robot or its controller, before anything else. */
export function inTheWay(page: Page): Reason[] {
  return page.reasons.filter(({ action }) => !action || !(action in BUTTONS));
}

/** The id of the button that brings the robot nearer to motion; empty where there is none. */
export function remedyButton(page: Page): string {
  if (page.view.control !== "here" || !page.state || page.view.why_no_robot) return "";
  if (virtualButton(page)) return virtualButton(page);
  if (inTheWay(page).length) return "";
  if (page.stop) return "recover"; // it confirms the stop, and does the rest
  const [first] = page.reasons;
  if (first?.action) return BUTTONS[first.action] ?? "";
  return running(page).length < ARMS.length ? "start" : "";
}

function isSilent(page: Page): boolean {
  return page.stateTime - page.silentSince > BEGINNING && !page.stop && !page.causes.length;
}

export function verdict(page: Page): Verdict {
  return page.recording ? recorded(page) : live(page);
}

function live(page: Page): Verdict {
  const { view, state } = page;
  const say = (level: Level, head: string, ...lines: string[]): Verdict => ({ level, kind: "", head, lines });
  if (view.why_no_robot) return say("error", "No robot", view.why_no_robot);
  if (!state) return say("wait", "Waiting for the robot");
  const first = canTakeControl(page) ? ["Take control first."] : [];
  const todo = page.reasons.length ? first : [];
  if (isSilent(page)) {
    const check = view.is_virtual
      ? "End the faults of EGM: inject “All EGM faults end”."
      : "Check the network cable, the UDP ports in this machine's firewall and the address in the controller's UDPUC device.";
    const silent = silentArms(state).join(" and the ");
    return say("error", `Cannot move: the robot runs EGM on the ${silent} arm, but its datagrams do not arrive`,
      check, ...first, "Then press “Recover…”.");
  }
  const sentences = page.reasons.map(({ sentence }) => sentence);
  if (page.causes.length) {
    return say("error", `Stopped: ${page.causes.map(({ sentence }) => sentence).join(" ")}`, ...sentences, ...todo);
  }
  if (page.stop) return say("error", `Stopped: ${sentences[0] ?? page.stop}`, ...sentences.slice(1), ...todo);
  if (sentences.length) return say("warn", `Cannot move: ${sentences[0]}`, ...sentences.slice(1), ...todo);
  for (const name of ARMS) {
    if (state.arms[name].problem) return say("warn", `The ${name} arm holds: ${state.arms[name].problem}`);
  }
  const limited = ARMS.filter((name) => page.limited[name]);
  if (limited.length) {
    const pairs = limited.map((name) => `The ${name} arm is kept apart: ${page.limited[name]!.part} – ${page.limited[name]!.other}`);
    return say("warn", pairs.join(". "), `Move ${limited.length > 1 ? "them" : "it"} away from there.`);
  }
  if (moving(page).length) return say("good", `The ${moving(page).join(" and the ")} arm ${moving(page).length > 1 ? "move" : "moves"}`);
  return resting(page, say, first);
}

function resting(page: Page, say: (level: Level, head: string, ...lines: string[]) => Verdict, first: string[]): Verdict {
  const start = page.view.why_not_operated ? [] : [...first, "Press “Start EGM”."];
  const arms = running(page);
  if (!arms.length) return say("warn", "Ready: EGM is off, the arms follow no commands", ...start);
  const free = uncommanded(page);
  if (free.length) {
    const activate = page.view.why_not_operated ? [] : [...first, "Choose a controller under Poses and press “Activate”, or jog."];
    return say("warn", `EGM holds ${both(arms)}, but no controller commands ${free.length > 1 ? "them" : both(free)}`, ...activate);
  }
  if (arms.length === ARMS.length) return say("good", "Ready: EGM holds both arms");
  const other = ARMS.find((name) => name !== arms[0]);
  return say("good", `Ready: EGM holds ${both(arms)}`, `The ${other} arm follows no commands.`, ...start);
}

/** What was so at a time of a recording. */
function recorded(page: Page): Verdict {
  const say = (level: Level, head: string, ...lines: string[]): Verdict =>
    ({ level, kind: `Recording ${page.recording?.name} at ${page.stateTime.toFixed(2)} s`, head, lines });
  const sentences = page.reasons.map(({ sentence }) => sentence);
  if (page.causes.length) return say("error", `Stopped: ${page.causes.map(({ sentence }) => sentence).join(" ")}`, ...sentences);
  if (sentences.length) return say("warn", `The arms could not move: ${sentences[0]}`, ...sentences.slice(1));
  if (moving(page).length) return say("good", `The ${moving(page).join(" and the ")} arm moved`);
  const arms = running(page);
  return arms.length ? say("good", `EGM held ${both(arms)}`) : say("wait", "EGM was off");
}
