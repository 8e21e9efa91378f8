/** The player of a recording: the slider moves through its time, its events are marks and buttons that go there. */

import { withToken } from "abb-view/connection";
import { at, input, make, press, text } from "abb-view/dom";
import type { Recording } from "./messages";
import { ofTime, recordedArmName } from "./recording";
import type { Page, Store } from "./store";

export class Player {
  private isPlaying = false;

  constructor(private readonly store: Store, private readonly recording: Recording) {
    document.title = `Recording ${recording.name}`;
    input("time").max = String(recording.duration);
    at("player").hidden = false;
    for (const event of recording.events) this.addEvent(event);
    input("time").addEventListener("input", () => this.show(input("time").valueAsNumber));
    press("play", () => this.setPlaying(!this.isPlaying));
    store.show((page) => showEvents(page));
    store.change({ recording, arm: recordedArmName(recording), ...ofTime(recording, 0) });
    this.show(0);
  }

  static async open(store: Store): Promise<Player> {
    return new Player(store, (await (await fetch(withToken("/recording.json"))).json()) as Recording);
  }

  private addEvent({ time, sentence, is_fault: isFault }: Recording["events"][number]): void {
    const mark = make("i", { title: sentence });
    mark.style.left = `${(100 * time) / (this.recording.duration || 1)}%`;
    const seek = make("button", { className: "link", textContent: `${time.toFixed(2)} s` });
    seek.addEventListener("click", () => this.show(time));
    const item = make("li", {}, seek, ` ${sentence}`);
    item.dataset.time = String(time);
    for (const each of [mark, item]) each.dataset.level = isFault ? "error" : "info";
    at("marks").append(mark);
    at("events").append(item);
  }

  private show(time: number): void {
    input("time").value = String(time);
    text(at("clock"), `${time.toFixed(2)} s`);
    this.store.change(ofTime(this.recording, time));
  }

  private setPlaying(isPlaying: boolean): void {
    this.isPlaying = isPlaying;
    at("play").setAttribute("aria-pressed", String(isPlaying));
    text(at("play"), isPlaying ? "Pause" : "Play");
    if (!isPlaying) return;
    if (input("time").valueAsNumber >= this.recording.duration) this.show(0);
    let last = performance.now();
    const frame = (now: number): void => {
      if (!this.isPlaying) return;
      const time = input("time").valueAsNumber + Math.min(0.2, Math.max(0, (now - last) / 1000));
      last = now;
      this.show(Math.min(time, this.recording.duration));
      if (time >= this.recording.duration) this.setPlaying(false);
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }
}

/** What has happened until the time that is shown, and what was the last of it. */
function showEvents({ stateTime }: Page): void {
  const items = [...at("events").children] as HTMLElement[];
  const past = items.filter((item) => Number(item.dataset.time) <= stateTime + 1e-6);
  for (const item of items) {
    item.classList.toggle("past", past.includes(item));
    item.classList.toggle("current", item === past.at(-1));
  }
}
