/** A controller: its RAPID tasks with the lines around their program pointers, and its log. */

import type { ControllerPage } from "./controller";
import { at, make, text } from "abb-view/dom";
import type { LogLine, Pointer, RapidTask } from "./messages";
import type { Store } from "abb-view/store";

const RUNS: Record<string, string> = { started: "running", ready: "ready", stopped: "stopped", uninitialized: "no program" };

export function bindRapid(store: Store<ControllerPage>): void {
  const drawn = new Map<string, string>(); // of each task what is drawn of it, as text
  let shown: readonly LogLine[] = [];
  store.show((page) => {
    showKind(page);
    showTasks(page.state?.tasks ?? [], drawn);
    if (page.log === shown) return;
    shown = page.log;
    at("rapid-log").replaceChildren(...page.log.map(item));
  });
}

function showKind({ view: { controller, is_virtual: isVirtual, why_no_robot: whyNot } }: ControllerPage): void {
  document.body.classList.toggle("views-undrawn", controller !== null && !controller.is_drawn);
  at("rapid-panel").hidden = !controller || Boolean(whyNot);
  if (!controller) return;
  const title = controller.robot || controller.address;
  if (document.title !== title) document.title = title;
  text(at("rapid-log-source"), isVirtual ? " and FlexPendant (TPWrite)" : "");
}

/** Draw the tasks; one whose lines have not changed stays as it is, with what is selected and scrolled in it. */
function showTasks(tasks: readonly RapidTask[], drawn: Map<string, string>): void {
  const names = tasks.map(({ name }) => name);
  if ([...drawn.keys()].join() !== names.join()) {
    drawn.clear();
    for (const name of names) drawn.set(name, "");
    at("rapid-tasks").replaceChildren(...names.map(() => make("div", { className: "task" })));
  }
  tasks.forEach((task, index) => {
    const now = JSON.stringify(task);
    if (drawn.get(task.name) === now) return;
    drawn.set(task.name, now);
    const box = at("rapid-tasks").children[index]!;
    const scrolled = box.querySelector(".code")?.scrollLeft ?? 0;
    box.replaceChildren(headOf(task), ...(task.pointer?.text.length ? [codeOf(task.pointer)] : []));
    const code = box.querySelector(".code");
    if (code) code.scrollLeft = scrolled;
  });
}

function headOf({ name, execution, is_active: isActive, pointer }: RapidTask): HTMLElement {
  const runs = make("em", { textContent: isActive ? (RUNS[execution] ?? execution) : "switched off" });
  runs.dataset.level = execution === "started" ? "good" : "";
  const where = pointer ? `${pointer.module}/${pointer.routine}, line ${pointer.line}` : "";
  return make("div", { className: "task-head" }, make("strong", { textContent: name }), runs, make("span", { textContent: where }));
}

function codeOf({ line, first_line: first, text: lines }: Pointer): HTMLElement {
  const code = make("div", { className: "code", tabIndex: 0, role: "group", ariaLabel: "Lines around the program pointer" });
  lines.forEach((each, index) => {
    const isHere = first + index === line;
    const row = make("div", { className: isHere ? "at" : "" }, make("i", { textContent: isHere ? "➜" : "" }),
      make("b", { textContent: String(first + index) }), each);
    if (isHere) row.setAttribute("aria-current", "step");
    code.append(row);
  });
  return code;
}

function item({ source, text: line, level, clock, task, code, detail }: LogLine): HTMLElement {
  const head = source === "TPWrite"
    ? make("b", { textContent: `[${task}] ` })
    : make("time", { textContent: `${[clock, code].filter(Boolean).join("  ")} ` });
  const made = make("li", { title: detail }, head, line);
  made.dataset.level = level;
  return made;
}
