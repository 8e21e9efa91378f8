// A controller without a driver: its RAPID tasks with the lines around their program pointers, and its log.

const LOG = 100; // lines that are shown
const RUNS = { started: "running", ready: "ready", stopped: "stopped", uninitialized: "no program" };

const at = (id) => document.getElementById(id);
const make = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};

/** One tab for each robot where these are not a YuMi's arms; none where there is one robot alone. */
export function buildTabs(arms) {
  if (arms.includes("right")) return;
  const tabs = arms.map((name, index) => {
    const tab = make("button", { id: `tab-${name}`, textContent: name });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", "arm-panel");
    tab.setAttribute("aria-selected", String(index === 0));
    return tab;
  });
  const list = at("tab-right").parentElement;
  list.replaceChildren(...tabs);
  list.hidden = arms.length < 2;
  at("arm-panel").setAttribute("aria-labelledby", `tab-${arms[0]}`);
}

/** What a new page gets of the controller: its kind, and the log so far. */
export function introduce({ controller, log, is_virtual: isVirtual, why_no_robot: whyNot }) {
  document.body.classList.toggle("views-controller", Boolean(controller));
  document.body.classList.toggle("views-undrawn", Boolean(controller) && !controller.is_drawn);
  at("rapid-panel").hidden = !controller || Boolean(whyNot);
  if (!controller) return;
  document.title = controller.robot || controller.address;
  at("rapid-log-source").textContent = isVirtual ? " and FlexPendant (TPWrite)" : "";
  at("rapid-log").replaceChildren();
  addLog(log);
}

/** The message of a controller in the shape of a driver's state, as far as there is one. */
export function stateOf(message, controller) {
  const names = Object.keys(message.arms);
  const each = (value) => Object.fromEntries(names.map((name) => [name, typeof value === "function" ? value(name) : value]));
  return {
    robot: controller.address, operating_mode: message.operating_mode, motors: message.motors, program: message.program,
    speed_scale: (message.speed_ratio ?? 100) / 100, reason: "", cause: "", stop: "", missing: message.missing,
    arms: each((name) => ({
      mode: "no_egm", position: message.arms[name], resting: null, velocity: null, sent: null, goal: null, problem: "",
      cycles: null, session: 0,
    })),
    grippers: each(null), egm: each("off"), controllers: each(() => []),
  };
}

/** The band: level, what is shown, and what is missing. */
export function verdict(controller, state) {
  const runs = state.program === "running" ? "RAPID runs" : state.program ? "RAPID is stopped" : "RAPID is being read";
  return [state.program === "running" ? "good" : "wait", `View only: ${runs}`, state.missing.join(" ")];
}

const shown = new Map(); // of each task what is drawn of it, as text

/** Draw the tasks; one whose lines have not changed stays as it is, with what is selected and scrolled in it. */
export function show({ tasks }) {
  const list = at("rapid-tasks");
  const names = tasks.map((task) => task.name);
  if ([...list.children].map((box) => box.dataset.task).join() !== names.join()) {
    shown.clear();
    list.replaceChildren(
      ...names.map((name) => {
        const box = make("div", { className: "task" });
        box.dataset.task = name;
        return box;
      }),
    );
  }
  tasks.forEach((task, index) => {
    const now = JSON.stringify(task);
    if (shown.get(task.name) === now) return;
    shown.set(task.name, now);
    const box = list.children[index];
    const scrolled = box.querySelector(".code")?.scrollLeft ?? 0;
    box.replaceChildren(headOf(task), ...(task.pointer?.text.length ? [codeOf(task.pointer)] : []));
    const code = box.querySelector(".code");
    if (code) code.scrollLeft = scrolled;
  });
}

function headOf({ name, execution, is_active: isActive, pointer }) {
  const runs = make("em", { textContent: isActive ? (RUNS[execution] ?? execution) : "switched off" });
  runs.dataset.level = execution === "started" ? "good" : "";
  const where = pointer ? `${pointer.module}/${pointer.routine}, line ${pointer.line}` : "";
  return make("div", { className: "task-head" }, make("strong", { textContent: name }), runs, make("span", { textContent: where }));
}

function codeOf({ line, first_line: first, text }) {
  const code = make("div", { className: "code", tabIndex: 0 });
  code.setAttribute("role", "group");
  code.setAttribute("aria-label", "Lines around the program pointer");
  text.forEach((each, index) => {
    const isHere = first + index === line;
    const row = make("div", { className: isHere ? "at" : "" }, make("i", { textContent: isHere ? "➜" : "" }), make("b", { textContent: String(first + index) }), each);
    if (isHere) row.setAttribute("aria-current", "step");
    code.append(row);
  });
  return code;
}

/** Lines of the event log and of programs, oldest first. */
export function addLog(lines) {
  const list = at("rapid-log");
  for (const { source, text, level, clock, task, code, detail } of lines) {
    const head = source === "TPWrite" ? make("b", { textContent: `[${task}] ` }) : make("time", { textContent: [clock, code].filter(Boolean).join("  ") + " " });
    const item = make("li", { title: detail }, head, text);
    item.dataset.level = level;
    list.prepend(item);
  }
  while (list.childElementCount > LOG) list.lastChild.remove();
}
