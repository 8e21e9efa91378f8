/** The state of a page, in one place: messages and a person's choices change it, and views show all of it. */

const MOST_LINES = 100; // of a log

/** Why no robot is shown until the first message. */
export const CONNECTING = "The page is connecting.";

/** A log with new lines, the newest first. */
export function newestFirst<T>(known: readonly T[], added: readonly T[]): T[] {
  return [...[...added].reverse(), ...known].slice(0, MOST_LINES);
}

/** The page's state, with the views that show it. */
export class Store<P> {
  private readonly views: ((page: P) => void)[] = [];

  constructor(public page: P) {}

  /** Call a view after each change. */
  show(view: (page: P) => void): void {
    this.views.push(view);
  }

  change(part: Partial<P>): void {
    this.page = { ...this.page, ...part };
    for (const view of this.views) view(this.page);
  }
}
