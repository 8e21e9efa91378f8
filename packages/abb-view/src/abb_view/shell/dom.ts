/** The elements of index.html, and new ones. */

export function at<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no #${id}`);
  return found as T;
}

export const button = (id: string) => at<HTMLButtonElement>(id);
export const input = (id: string) => at<HTMLInputElement>(id);
export const choice = (id: string) => at<HTMLSelectElement>(id);

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K, properties: Partial<HTMLElementTagNameMap[K]> = {}, ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Set a text only where it is another one: a screen reader would read it again. */
export function text(element: Element, value: string): void {
  if (element.textContent !== value) element.textContent = value;
}

export function press(id: string, action: (pressed: HTMLButtonElement) => unknown): void {
  button(id).addEventListener("click", () => action(button(id)));
}

/** The number in a field; null where it is empty, no number or not allowed: empty does not mean zero. */
export function numberOf(field: HTMLInputElement): number | null {
  return field.checkValidity() && Number.isFinite(field.valueAsNumber) ? field.valueAsNumber : null;
}
