/** The panel of the whole robot: stop, start, recover, calibrate, speed; and the dialog that confirms a stop. */

import { at, button, input, make, press, text } from "abb-view/dom";
import { closeToast } from "abb-view/toast";
import type { Connection } from "./connection";
import type { Page, Store } from "./store";
import { inTheWay } from "./verdict";

export function bindRobot(store: Store, connection: Connection, endJog: () => void): void {
  press("stop", (pressed) => {
    endJog();
    void connection.request("stop_egm", {}, pressed);
  });
  press("start", (pressed) => connection.request("start_egm", {}, pressed));
  press("recover", async (pressed) => {
    const { stop } = store.page;
    if (stop && !(await confirmStop())) return;
    await connection.request("recover", { confirm: stop }, pressed);
  });
  for (const { method, button: word, title } of store.page.model.commands) {
    at("robot-buttons").append(make("button", { id: method, textContent: word, title }));
    press(method, (pressed) => connection.request(method, {}, pressed));
  }
  const speed = input("speed");
  speed.addEventListener("change", () => connection.request("set_speed_scale", { speed_scale: speed.valueAsNumber / 100 }));
  at("toast").addEventListener("click", closeToast);
  document.addEventListener("keydown", (event) => event.key === "Escape" && closeToast());
  store.show(showSpeed);
  store.show(showDialog);
  store.show(({ view }) => {
    at("no-faults").hidden = !view.why_no_faults;
    text(at("no-faults"), view.why_no_faults);
  });
}

function showSpeed({ state }: Page): void {
  if (!state) return;
  const percent = `${Math.round(state.speed_scale * 100)}`;
  if (document.activeElement !== at("speed")) input("speed").value = percent;
  text(at("speed-value"), `${percent} %`);
}

/** Whether a person has confirmed the stop. */
function confirmStop(): Promise<boolean> {
  const dialog = at<HTMLDialogElement>("confirm");
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true });
    dialog.returnValue = "no";
    dialog.showModal();
  });
}

/** What is still pressed comes first, also where it was pressed while the dialog was open; then nothing is confirmed. */
function showDialog(page: Page): void {
  const open = inTheWay(page);
  const shown = open.length ? open : page.causes.length ? page.causes : page.reasons;
  text(at("confirm-title"), open.length ? "Not yet: first end what stops the robot" : "Confirm the stop");
  text(at("confirm-cause"), shown.map(({ sentence }) => sentence).join(" "));
  at("confirm-question").hidden = open.length > 0;
  button("confirm-yes").hidden = open.length > 0;
  text(at("confirm-no"), open.length ? "Close" : "No, leave it stopped");
}
