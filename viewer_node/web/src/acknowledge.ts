// SPDX-License-Identifier: Apache-2.0
// acknowledge.ts: a person acknowledges a device that waits for it, with viewer { control: true }.
import { make, write } from "./card";
import { kFaultReasons, Phase, type Acknowledgement } from "./wire";

/** What a person does before the acknowledgement; null: the device waits for none. */
export function wait_words({ phase, lastFault }: { phase: number; lastFault: number }): string | null {
  switch (phase) {
    case Phase.connected:
      return "The device is not calibrated: do what the log of device_node asks for.";
    case Phase.calibrated:
      return "No force yet: make sure that the handle is free. Its motors may push a little, to and fro.";
    case Phase.faulted:
      return `Fault: ${kFaultReasons[lastFault] ?? "unknown reason"}. Clear the cause, and make sure that the handle is free.`;
    default:
      return null;
  }
}

/** What is shown of a device. */
export interface ShownDevice {
  side: string; // "" where there is one
  session: bigint;
  phase: number;
  deviceFaults: bigint;
  lastFault: number;
}

/** A line with a button for each device that waits. */
export class AcknowledgeControl {
  can_publish = false;
  private readonly lines = new Map<string, { line: HTMLElement; words: HTMLElement; seen: Acknowledgement }>(); // by side

  constructor(private readonly element: HTMLElement, private readonly publish: (seen: Acknowledgement) => boolean) {}

  /** @param devices  whose state is known now */
  write(devices: ShownDevice[]): void {
    const waiting = new Set<string>();
    for (const device of this.can_publish ? devices : []) {
      const { side, session, phase, deviceFaults } = device;
      const words = wait_words(device);
      if (words === null) continue;
      waiting.add(side);
      const shown = this.lines.get(side) ?? this.add(side);
      // what the button sends is what stands beside it
      shown.seen = { deviceSessionId: session, phase, deviceFaults };
      write(shown.words, side ? `${side}: ${words}` : words);
    }
    for (const [side, { line }] of this.lines) {
      if (waiting.has(side)) continue;
      line.remove();
      this.lines.delete(side);
    }
  }

  private add(side: string): { line: HTMLElement; words: HTMLElement; seen: Acknowledgement } {
    const line = make("div");
    const words = make("p");
    const button = make("button", "button strong", "Acknowledge");
    button.type = "button";
    button.title = "The device may go on by one step, as with SIGUSR2";
    const shown = { line, words, seen: { deviceSessionId: 0n, phase: 0, deviceFaults: 0n } };
    button.addEventListener("click", () => this.publish(shown.seen));
    line.append(words, button);
    this.element.append(line);
    this.lines.set(side, shown);
    return shown;
  }
}
