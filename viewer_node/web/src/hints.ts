// SPDX-License-Identifier: Apache-2.0
// hints.ts: what a mouse shows as a tooltip, shown to a finger that taps the element.
import { make, write } from "./card";

const kShown_ms = 8000;

export class Hints {
  private readonly box = make("p", "hint");
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(body: HTMLElement) {
    this.box.setAttribute("role", "status");
    this.box.hidden = true;
    body.append(this.box);
    body.addEventListener("click", (event) => {
      if ((event as PointerEvent).pointerType !== "touch") return;
      const element = (event.target as Element).closest<HTMLElement>("[title], button, input, select, a, summary");
      this.show(element && !element.matches("button, input, select, a, summary") ? element.title : "");
    });
  }

  private show(text: string): void {
    clearTimeout(this.timer);
    this.box.hidden = text === "";
    write(this.box, text);
    if (text) this.timer = setTimeout(() => { this.box.hidden = true; }, kShown_ms);
  }
}
