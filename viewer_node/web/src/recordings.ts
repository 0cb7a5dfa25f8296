// SPDX-License-Identifier: Apache-2.0
// recordings.ts: the recordings that pages of this session have made, to be downloaded.
import { make, write } from "./card";
import type { RecorderState } from "./wire";

interface Listed {
  name: string;
  bytes: number;
  modified_s: number;
}

/** "1.2 MB" */
export function size_words(bytes: number): string {
  if (bytes < 1e3) return `${bytes} bytes`;
  const [scale, unit] = bytes < 1e6 ? [1e3, "kB"] : bytes < 1e9 ? [1e6, "MB"] : [1e9, "GB"];
  return `${(bytes / (scale as number)).toPrecision(3)} ${unit}`;
}

export class RecordingList {
  private readonly list = make("ul");
  private readonly words = make("p", "none");
  private known = ""; // state of the recorder at the last question

  /** @param search  of the page's address, with the token */
  constructor(private readonly element: HTMLDetailsElement, private readonly search: string) {
    this.words.setAttribute("role", "status");
    element.append(make("summary", "", "Recordings"), this.words, this.list);
    element.addEventListener("toggle", () => { if (element.open) void this.ask(); });
  }

  /** Asks again when a recording has begun or ended. */
  take(recorder: RecorderState | undefined): void {
    this.element.hidden = !recorder?.isPossible;
    const known = `${recorder?.isRecording} ${recorder?.file}`;
    if (known === this.known) return;
    this.known = known;
    if (this.element.open) void this.ask();
  }

  private async ask(): Promise<void> {
    try {
      const answer = await fetch(`recordings${this.search}`);
      if (!answer.ok) throw new Error(await answer.text());
      this.show((await answer.json()) as Listed[]);
    } catch (error) {
      this.list.replaceChildren();
      write(this.words, `The recordings are not known: ${(error as Error).message.trim()}`);
    }
  }

  private show(listed: Listed[]): void {
    write(this.words, listed.length === 0 ? "None yet, or none may be seen before the task has ended." : "");
    this.list.replaceChildren(...listed.map(({ name, bytes, modified_s }) => {
      const link = make("a", "", name);
      link.href = `recordings/${encodeURIComponent(name)}${this.search}`;
      link.download = name;
      const line = make("li");
      line.append(link, make("span", "", ` ${size_words(bytes)}, ${new Date(1000 * modified_s).toLocaleString()}`));
      return line;
    }));
  }
}
