/** Tabs: the arm that is shown, and what it is operated with, so that what is used together is seen together. */

import { at, button } from "abb-view/dom";
import { armsOf } from "./messages";
import { hasControl, TABS, takesFaults, type Page, type Store } from "./store";

function bindTabs<T extends string>(names: readonly T[], idOf: (name: T) => string, choose: (name: T) => void): void {
  for (const name of names) {
    const tab = button(idOf(name));
    tab.addEventListener("click", () => choose(name));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      const shown = names.filter((each) => !button(idOf(each)).hidden);
      const next = shown[(shown.indexOf(name) + step + shown.length) % shown.length]!;
      choose(next);
      button(idOf(next)).focus();
    });
  }
}

export function bindAllTabs(store: Store, endJog: () => void): void {
  const arms = armsOf(store.page.model);
  bindTabs(arms, (name) => `tab-${name}`, (arm) => {
    endJog();
    store.change({ arm, isPreviewed: false });
  });
  bindTabs(TABS, (name) => `tab-${name}`, (tab) => {
    endJog();
    store.change({ tab });
  });
  store.show(showTabs);
}

function showTabs(page: Page): void {
  for (const name of armsOf(page.model)) at(`tab-${name}`).setAttribute("aria-selected", String(name === page.arm));
  at("arm-panel").setAttribute("aria-labelledby", `tab-${page.arm}`);
  at("tab-virtual").hidden = !takesFaults(page);
  const wanted = page.tab === "virtual" && !takesFaults(page) ? "joints" : page.tab;
  const tab = hasControl(page) ? wanted : "joints"; // who only looks sees the joints
  for (const name of TABS) {
    at(`tab-${name}`).setAttribute("aria-selected", String(name === tab));
    at(`${name}-panel`).hidden = name !== tab;
  }
  at("joint-line").hidden = tab === "joints";
  at("jog-speed-row").hidden = tab !== "joints" && tab !== "tool";
  for (const each of document.querySelectorAll<HTMLElement>(".of-virtual")) each.hidden = !takesFaults(page);
}
