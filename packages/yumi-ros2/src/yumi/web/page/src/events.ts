/** The lines of the driver's log, newest first. */

import { at, make } from "abb-view/dom";
import type { LogEvent } from "./messages";
import type { Store } from "./store";

export function bindEvents(store: Store): void {
  let shown: readonly LogEvent[] = [];
  store.show(({ events, view }) => {
    if (events === shown || view.is_recording) return; // a recording has events of its own, in its time
    shown = events;
    at("events").replaceChildren(...events.map(item));
  });
}

function item({ time, level, sentence }: LogEvent): HTMLElement {
  const clock = new Date(time * 1000).toLocaleTimeString([], { hour12: false });
  const made = make("li", {}, make("time", { textContent: clock }), ` ${sentence}`);
  made.dataset.level = level;
  return made;
}
