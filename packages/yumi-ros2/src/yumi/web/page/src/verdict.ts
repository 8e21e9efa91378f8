/** The verdict of the band: whether the robot moves, else why not and what to do, and the button that does it. */

import type { Level, Verdict } from "abb-view/banner";
import { armsOf, type ArmName, type Said } from "./messages";
import { CONNECTING, silentArms, takesFaults, type Page } from "./store";

const BEGINNING = 1; // [s] EGM that begins may be without datagrams for so long

/** The buttons that ask the driver for what a message says that a person can do. */
const BUTTONS: Record<string, string> = {
  recover: "recover", confirm_stop: "recover", motors_on: "recover", start_egm: "start", stop_egm: "stop", restart_egm: "stop",
  calibrate: "calibrate",
};

/** Those for what is done at a robot itself; a virtual one has no FlexPendant to go to. */
const VIRTUAL_BUTTONS: Record<string, string> = { release_stop: "release-stop", turn_to_auto: "key" };

const both = (names: readonly ArmName[]): string => (names.length > 1 ? "both arms" : `the ${names[0]} arm`);
const running = ({ model, state }: Page): ArmName[] => armsOf(model).filter((name) => state?.egm[name] === "running");
const moving = ({ model, state }: Page): ArmName[] => armsOf(model).filter((name) => state?.arms[name]?.mode === "moving");
const isWhole = (page: Page): boolean => running(page).length === armsOf(page.model).length;
const sentencesOf = (said: readonly Said[]): string[] => said.map(({ sentence }) => sentence);
/** What stopped the robot; where the driver knows no cause, it repeats why the robot cannot move. */
const causesOf = ({ causes, reasons }: Page): string[] => {
  const [stopped, cannot] = [sentencesOf(causes), sentencesOf(reasons)];
  return stopped.join() === cannot.join() ? [] : stopped;
};
const canTakeControl = ({ view }: Page): boolean => view.control === "none" && !view.why_not_operated;

/** The arms that EGM holds and no controller commands. */
export function uncommanded(page: Page): ArmName[] {
  return running(page).filter((name) => !page.state?.controllers[name]?.some((each) => each.commands));
}

/** What nothing that the driver is asked for ends: a person does so at the robot or its controller, before anything else. */
export function inTheWay(page: Page): Said[] {
  return page.reasons.filter(({ action }) => !action || !(action in BUTTONS));
}

/** The id of the button that brings the robot nearer to motion; empty where there is none. */
export function remedyButton(page: Page): string {
  if (page.view.control !== "here" || !page.state || page.view.why_no_robot) return "";
  const [blocking] = inTheWay(page);
  if (blocking) return (takesFaults(page) && VIRTUAL_BUTTONS[blocking.action ?? ""]) || "";
  if (page.stop) return "recover"; // it confirms the stop, and does the rest
  const known = [...page.reasons, ...Object.values(page.problems)].map(({ action }) => BUTTONS[action ?? ""]).find(Boolean);
  return known ?? (isWhole(page) && !uncommanded(page).length ? "" : "start");
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
  if (view.why_no_robot === CONNECTING) return say("wait", CONNECTING);
  if (view.why_no_robot) return say("error", state ? "No connection" : "No robot", view.why_no_robot);
  if (!state) return say("wait", "Waiting for the robot");
  const first = canTakeControl(page) ? ["Take control first."] : [];
  const todo = page.reasons.length ? first : [];
  if (isSilent(page)) {
    const check = view.is_virtual
      ? view.why_no_faults || "End the faults of EGM: inject “All EGM faults end”."
      : "Check the network cable, the UDP ports in this machine's firewall and the address in the controller's UDPUC device.";
    const silent = silentArms(state).join(" and the ");
    return say("error", `Cannot move: the robot runs EGM on the ${silent} arm, but its datagrams do not arrive`,
      check, ...first, "Then press “Recover…”.");
  }
  const sentences = sentencesOf(page.reasons);
  const causes = causesOf(page);
  if (causes.length) return say("error", `Stopped: ${causes.join(" ")}`, ...sentences, ...todo);
  if (page.stop) return say("error", `Stopped: ${sentences[0] ?? page.stop}`, ...sentences.slice(1), ...todo);
  if (sentences.length) return say("warn", `Cannot move: ${sentences[0]}`, ...sentences.slice(1), ...todo);
  const [problem, ...others] = sentencesOf(Object.values(page.problems));
  if (problem) return say("warn", problem, ...others);
  const limited = armsOf(page.model).filter((name) => page.limited[name]);
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
    const activate = page.view.why_not_operated ? [] : [...first, "Press “Start EGM”, jog, or activate a controller under Poses."];
    return say("warn", `EGM holds ${both(arms)}, but no controller commands ${free.length > 1 ? "them" : both(free)}`, ...activate);
  }
  if (isWhole(page)) return say("good", "Ready: EGM holds both arms");
  const other = armsOf(page.model).find((name) => name !== arms[0]);
  return say("good", `Ready: EGM holds ${both(arms)}`, `The ${other} arm follows no commands.`, ...start);
}

/** What was so at a time of a recording. */
function recorded(page: Page): Verdict {
  const say = (level: Level, head: string, ...lines: string[]): Verdict =>
    ({ level, kind: `Recording ${page.recording?.name} at ${page.stateTime.toFixed(2)} s`, head, lines });
  const sentences = sentencesOf(page.reasons);
  const causes = causesOf(page);
  if (causes.length) return say("error", `Stopped: ${causes.join(" ")}`, ...sentences);
  if (sentences.length) return say("warn", `The arms could not move: ${sentences[0]}`, ...sentences.slice(1));
  if (moving(page).length) return say("good", `The ${moving(page).join(" and the ")} arm moved`);
  const arms = running(page);
  return arms.length ? say("good", `EGM held ${both(arms)}`) : say("wait", "EGM was off");
}
