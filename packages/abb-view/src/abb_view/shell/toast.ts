/** A short message over the picture: what a request came to, or why it was refused. */

import { at } from "./dom";

const SHOWN_FOR = { error: 20_000, info: 4000 }; // [ms]
let timer: ReturnType<typeof setTimeout> | undefined;

export function toast(message: string, level: keyof typeof SHOWN_FOR = "error"): void {
  const box = at("toast");
  box.textContent = message;
  box.dataset.level = level;
  box.hidden = false;
  clearTimeout(timer);
  timer = setTimeout(closeToast, SHOWN_FOR[level]);
}

export function closeToast(): void {
  at("toast").hidden = true;
}
