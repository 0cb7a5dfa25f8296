// SPDX-License-Identifier: Apache-2.0
// take_part.ts: which pages show the buttons of a running task, and a button that asks once more.
import { make, write } from "../card";

const kKey = "takes part";

/** Whether the person at this page does the task. A reload keeps it; another tab has its own. */
export class Participation {
  private is_kept = false;

  constructor() {
    try {
      this.is_kept = sessionStorage.getItem(kKey) === "yes";
    } catch { /* storage is blocked: it lasts as long as the page */ }
  }

  get takes_part(): boolean {
    return this.is_kept;
  }
  begin(): void {
    if (this.is_kept) return;
    this.is_kept = true;
    try {
      sessionStorage.setItem(kKey, "yes");
    } catch { /* as above */ }
  }
}

const kDoubleClick_ms = 400; // the second press of a double click, or of a hand that trembles, confirms nothing
const kPatience_s = 6;

/** Acts at the second press within some seconds. */
export class ConfirmedButton {
  readonly element = make("button", "button");
  private timers: ReturnType<typeof setTimeout>[] = [];

  /** @param say  to a screen reader */
  constructor(id: string, private readonly label: string, private readonly what: string, private readonly say: (words: string) => void, act: () => void) {
    this.element.type = "button";
    this.element.id = id;
    this.element.hidden = true;
    write(this.element, label);
    this.element.addEventListener("click", () => {
      if (this.element.dataset.asks === undefined) this.ask();
      else if (this.element.dataset.asks === "ready") {
        this.reset();
        act();
      }
    });
    // a key that is held down presses once
    this.element.addEventListener("keydown", (event) => { if (event.repeat) event.preventDefault(); });
  }

  /** As before the first press. */
  reset(): void {
    for (const timer of this.timers.splice(0)) clearTimeout(timer);
    if (this.element.dataset.asks === undefined) return;
    delete this.element.dataset.asks;
    write(this.element, this.label);
  }

  private ask(): void {
    this.element.dataset.asks = "";
    write(this.element, `${this.label}: press again`);
    this.say(`Press ${this.label} again within ${kPatience_s} seconds to ${this.what}.`);
    this.timers = [
      setTimeout(() => { this.element.dataset.asks = "ready"; }, kDoubleClick_ms),
      setTimeout(() => {
        this.reset();
        this.say("Not confirmed: the task goes on.");
      }, 1e3 * kPatience_s),
    ];
  }
}
