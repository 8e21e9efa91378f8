/** The band at the top of a page: what the robot does and why not, and its state in short. */

import { at, make, text } from "./dom";

export type Level = "good" | "warn" | "error" | "wait";

export interface Verdict {
  level: Level;
  kind: string; // what is shown, where it is not the robot now
  head: string;
  lines: string[]; // what else is in the way, and what to do
}

const MOTORS: Record<string, string> = {
  motoron: "on", motoroff: "off", emergencystop: "emergency stop", emergencystopreset: "off after emergency stop",
  guardstop: "guard stop", sysfail: "system failure", init: "starting",
};

/** Let the style know how high the band is: beside a picture that stays visible on a telephone, it says where that begins. */
export function measureBand(): void {
  const measure = () => document.documentElement.style.setProperty("--band", `${at("banner").offsetHeight}px`);
  new ResizeObserver(measure).observe(at("banner"));
}

export function showVerdict({ level, kind, head, lines }: Verdict): void {
  at("banner").dataset.level = level;
  text(at("kind"), kind);
  text(at("verdict"), head);
  text(at("remedy"), lines.join(" "));
}

const chips = new Map<string, { box: HTMLElement; value: HTMLElement }>();

export function chip(name: string, value: string, level = ""): void {
  let known = chips.get(name);
  if (!known) {
    const shown = make("b");
    known = { box: make("span", { className: "chip" }, make("em", { textContent: name }), shown), value: shown };
    at("chips").append(known.box);
    chips.set(name, known);
  }
  text(known.value, value);
  if (known.box.dataset.level !== level) known.box.dataset.level = level;
}

/** What the panel of a controller shows. */
export interface PanelState {
  operating_mode: string | null;
  motors: string | null;
  program: string | null;
}

/** The panel of the controller; what is not known is left out with `isKnownOnly`. */
export function panelChips({ operating_mode, motors, program }: PanelState, isKnownOnly = false): void {
  const show = (name: string, value: string | null, good: string): void => {
    if (value !== null || !isKnownOnly) chip(name, value ?? "unknown", value === good ? "good" : "warn");
  };
  show("mode", operating_mode, "AUTO");
  show("motors", motors === null ? null : (MOTORS[motors] ?? motors), "on");
  show("program", program, "running");
}

/** The factor on the speed. */
export function speedChip(factor: number): void {
  chip("speed", `${Math.round(factor * 100)} %`, factor < 1 ? "warn" : "");
}
