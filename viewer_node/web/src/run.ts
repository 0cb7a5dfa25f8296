// SPDX-License-Identifier: Apache-2.0
// run.ts: what a page may ask of the run: markers, a recording, and control of a replay.
import { make, write } from "./card";
import { TaskKind, type Health, type ReplayState, type RunRequest } from "./wire";

const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 5];
const kSeekKey_s = 1;

/** Whether a mark of the person says something in such a task. */
export function has_marks(kind: TaskKind): boolean {
  return kind === TaskKind.palpation || kind === TaskKind.needle;
}

/** "1:03", "1:02:03". */
export function clock_words(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  const two = (value: number) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  return hours > 0 ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

export class RunControl {
  can_publish = false;
  private health: Health | null = null;
  private readonly record: HTMLButtonElement;
  private readonly marker: HTMLButtonElement;
  private readonly play = make("button", "button icon");
  private readonly scrubber = make("input");
  private readonly ticks = make("div", "ticks");
  private readonly time = make("output");
  private readonly speed = make("select");
  private readonly file = make("span", "name");
  private is_dragged = false;
  private shown_markers = "";
  private marked_ns = 0n;

  /** @param text  of the next marker; empty: the server numbers it */
  constructor(
    tools: HTMLElement, private readonly bar: HTMLElement, private readonly text: HTMLInputElement,
    private readonly publish: (request: RunRequest) => boolean) {
    const button = (label: string, title: string) => {
      const made = make("button", "button", label);
      made.type = "button";
      made.title = title;
      made.hidden = true;
      return made;
    };
    this.record = button("Record", "Begin a recording");
    this.record.id = "record";
    this.record.addEventListener("click", () => this.publish({ isRecording: !this.health?.recorder?.isRecording }));
    this.marker = button("Marker", "Mark this moment (M)");
    this.marker.id = "marker";
    this.marker.addEventListener("click", () => this.mark());
    tools.prepend(this.record, this.marker);
    text.addEventListener("keydown", ({ key }) => { if (key === "Enter") this.mark(); });

    this.play.type = "button";
    this.play.id = "play";
    this.play.title = "Play or pause the replay (P)";
    this.play.addEventListener("click", () => this.toggle());
    this.scrubber.type = "range";
    this.scrubber.min = "0";
    this.scrubber.step = "0.01";
    this.scrubber.setAttribute("aria-label", "Position in the recording");
    this.scrubber.addEventListener("input", () => {
      this.is_dragged = true;
      this.tell_time(this.scrubber.valueAsNumber);
    });
    this.scrubber.addEventListener("change", () => {
      this.is_dragged = false;
      this.publish({ seekS: this.scrubber.valueAsNumber });
    });
    this.speed.setAttribute("aria-label", "Speed");
    this.speed.addEventListener("change", () => this.publish({ speedRatio: Number(this.speed.value) }));
    const track = make("div", "track");
    track.append(this.scrubber, this.ticks);
    bar.append(make("b", "badge", "Replay"), this.play, this.time, track, this.speed, this.file);
  }

  get replay(): ReplayState | undefined {
    return this.health?.replay;
  }

  mark(): void {
    if (this.marker.hidden) return;
    if (this.publish({ marker: this.text.value.trim() })) this.text.value = "";
  }
  toggle(): void {
    if (this.replay) this.publish({ isPaused: !this.replay.isPaused });
  }
  /** True if the key was for the replay. */
  key(key: string): boolean {
    const { replay } = this;
    if (!replay) return false;
    const step_s = { ",": -kSeekKey_s, ".": kSeekKey_s }[key];
    if (key === "p") this.toggle();
    else if (step_s) this.publish({ seekS: Math.min(Math.max(0, replay.positionS + step_s), replay.lengthS) });
    else return false;
    return true;
  }

  /** @return the text of a marker that was set since the last message; "" if none was */
  take(health: Health): string {
    const newest = health.markers.at(-1);
    const is_new = this.health !== null && !health.replay && newest !== undefined && newest.atNs > this.marked_ns;
    if (newest) this.marked_ns = newest.atNs;
    this.health = health;
    const { recorder, replay } = health;
    this.record.hidden = !this.can_publish || !recorder?.isPossible || replay !== undefined;
    this.marker.hidden = !this.can_publish || replay !== undefined || (health.task !== undefined && has_marks(health.task.kind)); // its marks have their own button
    this.text.hidden = this.marker.hidden;
    const is_recording = recorder?.isRecording ?? false;
    this.record.setAttribute("aria-pressed", String(is_recording));
    write(this.record, is_recording ? `Stop recording ${clock_words(recorder!.lengthS)}` : "Record");
    this.record.title = is_recording ? `Recording into ${recorder!.file}`
      : recorder?.file ? `Begin a recording; the last one is ${recorder.file}` : "Begin a recording";
    this.bar.hidden = replay === undefined;
    if (replay) this.tell(replay, health);
    return is_new ? newest!.text : "";
  }

  private tell(replay: ReplayState, { markers }: Health): void {
    this.play.setAttribute("aria-label", replay.isPaused ? "Play" : "Pause the replay");
    write(this.play, replay.isPaused ? "▶" : "❚❚");
    if (this.scrubber.max !== String(replay.lengthS)) this.scrubber.max = String(replay.lengthS);
    if (!this.is_dragged) {
      this.scrubber.value = String(replay.positionS);
      this.tell_time(replay.positionS);
    }
    write(this.file, replay.file.slice(replay.file.lastIndexOf("/") + 1));
    this.file.title = replay.file;
    if (!kSpeeds.includes(replay.speedRatio)) kSpeeds.push(replay.speedRatio);
    if (this.speed.childElementCount !== kSpeeds.length) {
      this.speed.replaceChildren(...kSpeeds.sort((a, b) => a - b).map((ratio) => {
        const option = make("option", "", `${ratio} ×`);
        option.value = String(ratio);
        return option;
      }));
    }
    if (document.activeElement !== this.speed) this.speed.value = String(replay.speedRatio);
    const shown = markers.map(({ atNs, text }) => `${atNs} ${text}`).join();
    if (shown === this.shown_markers || replay.beginNs === 0n) return;
    this.shown_markers = shown;
    this.ticks.replaceChildren(...markers.map(({ atNs, text }) => {
      const at_s = 1e-9 * Number(atNs - replay.beginNs);
      const tick = make("button");
      tick.type = "button";
      tick.setAttribute("aria-label", `Marker at ${clock_words(at_s)}: ${text}`);
      tick.style.left = `${(100 * Math.min(Math.max(at_s / replay.lengthS, 0), 1)).toFixed(2)}%`;
      tick.title = `${clock_words(at_s)} ${text}`;
      tick.addEventListener("click", () => this.publish({ seekS: Math.max(0, at_s) }));
      return tick;
    }));
  }

  private tell_time(position_s: number): void {
    write(this.time, `${clock_words(position_s)} / ${clock_words(this.replay?.lengthS ?? 0)}`);
  }
}
