// SPDX-License-Identifier: Apache-2.0
// details.ts: a session with a task is for a person who does not read plots, and who may not know what
// renders the force: figures, plots and the name of the controller wait behind one button.
const kKey = "details";

export class Details {
  private has_task: boolean | null = null; // null: not known yet
  private is_open = false; // with a task; without, everything is shown

  /** @param page  gets the class is-plain while the details are closed */
  constructor(private readonly button: HTMLElement, private readonly page: HTMLElement, private readonly changed: () => void) {
    try {
      this.is_open = localStorage.getItem(kKey) === "open";
    } catch { /* storage is blocked: the choice lasts as long as the page */ }
    button.addEventListener("click", () => {
      this.is_open = !this.is_open;
      try {
        localStorage.setItem(kKey, this.is_open ? "open" : "closed");
      } catch { /* as above */ }
      this.write();
    });
  }

  /** Also until it is known whether there is a task. */
  get are_closed(): boolean {
    return this.has_task !== false && !this.is_open;
  }

  take(has_task: boolean): void {
    if (has_task === this.has_task) return;
    this.has_task = has_task;
    this.write();
  }

  private write(): void {
    this.button.hidden = !this.has_task;
    this.button.setAttribute("aria-expanded", String(this.is_open));
    this.page.classList.toggle("is-plain", this.has_task === true && !this.is_open);
    this.changed();
  }
}
