/** Permissions of the buttons: which ones cannot work now, with the reason as their title. */

import { armsOf } from "./messages";
import { inTheWay, uncommanded } from "./verdict";
import type { Page } from "./store";

const FOLLOWS = ["holding", "moving"]; // modes of an arm that the robot moves as it is commanded
const NO_STATE = "The state of the robot is not known.";

/** Why each button cannot work, by its id; empty where it can. */
export interface Permissions {
  start: string;
  recover: string;
  calibrate: string;
  grip: string;
  command: string; // any other one of the driver
  move: string; // jogs, plans and motions of the arm that is shown
}

export function permissions(page: Page): Permissions {
  const { state, stop, reasons, arm } = page;
  if (!state) return { start: NO_STATE, recover: NO_STATE, calibrate: NO_STATE, grip: NO_STATE, command: NO_STATE, move: NO_STATE };
  const arms = armsOf(page.model);
  const running = arms.filter((name) => state.egm[name] === "running");
  const [blocked] = inTheWay(page).map(({ sentence }) => sentence);
  const unconfirmed = stop ? "A stop has to be confirmed first: press “Recover…”." : "";
  const isWhole = running.length === arms.length;
  const nothing = isWhole && !reasons.length ? "Nothing is stopped: EGM runs on both arms." : "";
  return {
    start: blocked ?? (unconfirmed || (isWhole && !uncommanded(page).length ? "EGM runs on both arms." : "")),
    recover: blocked ?? (stop ? "" : nothing),
    calibrate: blocked ?? (unconfirmed || (running.length ? "EGM must not run: press “Stop (ends EGM)” first." : "")),
    grip: unconfirmed,
    command: unconfirmed,
    move: FOLLOWS.includes(state.arms[arm]!.mode) ? "" : `The ${arm} arm follows no commands: press “Start EGM”.`,
  };
}
