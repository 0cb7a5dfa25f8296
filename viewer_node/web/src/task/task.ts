// SPDX-License-Identifier: Apache-2.0
// task.ts: the task of a session for the person who does it: what is to be done, start, marks, stop,
// score. In plain words; all of it by keyboard, and said to a screen reader.
import { make, write } from "../card";
import { clock_words, has_marks } from "../run";
import { ConfirmedButton, Participation } from "./take_part";
import { MarkerKind, TaskKind, TaskPhase, type Health, type RunRequest, type TaskMap, type TaskState, type Traction } from "../wire";

/** As the server words the markers of a start and of a stop. */
const kMarkersOfTasks = ["task started", "task stopped"];

/** What is said of a change; "" if nothing is. */
export function task_news(before: TaskState | null, now: TaskState): string {
  if (!before || before.phase === now.phase) {
    if (before?.goal && now.goal && now.phase === TaskPhase.running) return traction_news(before.goal, now.goal);
    if (!before || now.phase !== TaskPhase.running || now.marks <= before.marks) return "";
    return now.kind === TaskKind.palpation ? `Mark ${now.marks} set.` : now.kind === TaskKind.needle ? "Loss of resistance marked." : "";
  }
  if (now.phase === TaskPhase.running) return "The task has started.";
  return now.phase === TaskPhase.ended ? `The task has ended. ${now.findings.join(" ")}` : "";
}

const is_done = ({ heldS, holdS }: Traction) => heldS >= holdS;

function traction_news(before: Traction, now: Traction): string {
  if (is_done(now) && !is_done(before)) return "Held for long enough.";
  if (before.isAtTarget !== now.isAtTarget) return now.isAtTarget ? "At the target: hold it." : now.isHolding ? "Away from the target." : "The tissue is not held any more.";
  return before.isHolding === now.isHolding ? "" : now.isHolding ? "The tissue is held." : "The tissue is not held any more.";
}

/** " · at the target: hold it · held for 1.2 of 5 s" */
function traction_words(traction: Traction): string {
  const where = traction.isAtTarget ? "at the target: hold it" : traction.isHolding ? "bring the tissue to the ball" : "take hold of the tissue";
  const held = `held for ${traction.heldS.toFixed(1)} of ${traction.holdS} s`;
  return ` · ${where} · ${held}${is_done(traction) ? ": done" : ""}`;
}

/** " · 2 finds marked"; of a traction how far it is. */
function progress_words({ kind, marks, goal }: TaskState): string {
  if (goal) return traction_words(goal);
  if (kind === TaskKind.palpation) return ` · ${marks} ${marks === 1 ? "find" : "finds"} marked`;
  return kind === TaskKind.needle && marks > 0 ? " · loss of resistance marked" : "";
}

/** "1:12 left", "0:48". */
export function time_words({ elapsedS, timeS }: TaskState): string {
  return timeS > 0 ? `${clock_words(Math.ceil(timeS - elapsedS))} left` : clock_words(elapsedS);
}

const kSvg = "http://www.w3.org/2000/svg";
const kTraceWidth = 600; // units of the drawing, which fills the panel
const kTraceHeight = 80;

/** The force over a whole task, its limit and the marks. */
class ForceTrace {
  readonly element = make("figure", "trace");
  is_known = false;
  private readonly drawing = document.createElementNS(kSvg, "svg");
  private readonly caption = make("figcaption");

  constructor() {
    this.drawing.setAttribute("viewBox", `0 0 ${kTraceWidth} ${kTraceHeight}`);
    this.drawing.setAttribute("preserveAspectRatio", "none");
    this.drawing.setAttribute("role", "img");
    this.element.append(this.drawing, this.caption);
    this.element.hidden = true;
  }

  take({ mostNewton, slotS, marksS, limitNewton }: TaskMap): void {
    this.is_known = true;
    const known = mostNewton.filter(Number.isFinite);
    const most = Math.max(0, ...known);
    const top = Math.max(0.5, 1.1 * limitNewton, most);
    const across = kTraceWidth / Math.max(mostNewton.length, 1);
    const height = (newton: number) => kTraceHeight * (1 - newton / top);
    let path = "";
    mostNewton.forEach((newton, i) => {
      if (!Number.isFinite(newton)) return;
      const is_joined = i > 0 && Number.isFinite(mostNewton[i - 1]);
      path += `${is_joined ? "L" : "M"}${((i + 0.5) * across).toFixed(1)} ${height(newton).toFixed(1)}`;
    });
    const shape = (name: string, attributes: Record<string, string | number>) => {
      const made = document.createElementNS(kSvg, name);
      for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, `${value}`);
      return made;
    };
    const marks = marksS.map((s) => (s / slotS) * across).map((x) => shape("line", { class: "mark", x1: x, x2: x, y1: 0, y2: kTraceHeight }));
    const limit = limitNewton > 0 ? [shape("line", { class: "limit", x1: 0, x2: kTraceWidth, y1: height(limitNewton), y2: height(limitNewton) })] : [];
    this.drawing.replaceChildren(...limit, ...marks, shape("path", { d: path }));
    const words = `Force over the task, 0 to ${top.toFixed(1)} N in ${clock_words(slotS * mostNewton.length)}: at most ${most.toFixed(2)} N`;
    this.drawing.setAttribute("aria-label", `${words}.`);
    write(this.caption, words + (limitNewton > 0 ? `; dashed: the limit of ${limitNewton.toFixed(1)} N` : "") + (marksS.length > 0 ? "; upright: your marks" : ""));
  }
}

export class TaskPanel {
  can_publish = false;
  private state: TaskState | null = null;
  private is_replay = false;
  private readonly title = make("h2");
  private readonly briefing = make("details", "briefing"); // out of the way while the task runs on a phone
  private readonly briefing_text = make("p");
  private readonly progress = make("p", "progress");
  private readonly news = make("p", "heard");
  private readonly start: HTMLButtonElement;
  private readonly find: HTMLButtonElement;
  private readonly join: HTMLButtonElement; // who did not start the task marks and stops it only after this
  private readonly stop: ConfirmedButton;
  private readonly participation = new Participation();
  private readonly findings = make("ul", "findings");
  private readonly map_key = make("p", "map-key"); // of the points on the organ
  private readonly force = new ForceTrace();
  private readonly figures = make("dl", "figures");

  constructor(private readonly element: HTMLElement, private readonly publish: (request: RunRequest) => boolean) {
    const button = (id: string, label: string, strength: string, act: () => void) => {
      const made = make("button", `button ${strength}`, label);
      made.type = "button";
      made.id = id;
      made.hidden = true;
      made.addEventListener("click", act);
      return made;
    };
    this.title.id = "task-title";
    this.news.setAttribute("role", "status");
    this.start = button("task-start", "Start", "strong", () => {
      this.participation.begin();
      this.publish({ marker: "", markerKind: MarkerKind.task_start });
    });
    this.find = button("task-find", "Mark a find (M)", "strong", () => this.mark());
    this.join = button("task-join", "Take part", "", () => {
      this.participation.begin();
      if (this.state) this.write(this.state);
      this.focus();
    });
    this.join.title = "Shows the buttons that mark and stop, which are for whoever does the task";
    this.stop = new ConfirmedButton("task-stop", "Stop", "end the task", (words) => write(this.news, words),
      () => this.publish({ marker: "", markerKind: MarkerKind.task_stop }));
    const buttons = make("div", "buttons");
    buttons.append(this.start, this.find, this.stop.element, this.join);
    this.map_key.hidden = true;
    this.briefing.append(make("summary", "", "What to do"), this.briefing_text);
    element.append(this.title, this.briefing, this.progress, buttons, this.findings, this.map_key, this.force.element, this.figures, this.news);
  }

  /** What the organ shows: what is to be searched, or what was, and the lesions, found or not. */
  show_keys(places: "none" | "area" | "searched", lesions: boolean[]): void {
    const keys: string[][] = { none: [], area: [["area", "search here"]], searched: [["searched", "pressed"], ["not-searched", "not pressed"]] }[places];
    if (lesions.includes(true)) keys.push(["found", "lesion, found"]);
    if (lesions.includes(false)) keys.push(["not-found", "lesion, not found"]);
    this.map_key.hidden = keys.length === 0;
    this.map_key.replaceChildren(...keys.map(([kind, words]) => {
      const swatch = make("i", kind), key = make("span");
      swatch.setAttribute("aria-hidden", "true");
      key.append(swatch, `${words} `);
      return key;
    }));
  }
  /** Force over the time of the task. */
  set trace(map: TaskMap) {
    this.force.take(map);
    this.force.element.hidden = !this.has_ended;
  }
  get has_ended(): boolean {
    return this.state?.phase === TaskPhase.ended;
  }

  /** Whether the panel itself tells of this marker. */
  says(marker: string): boolean {
    if (!this.state) return false;
    return kMarkersOfTasks.includes(marker) || (this.state.phase === TaskPhase.running && has_marks(this.state.kind));
  }

  /** The person has found something, or is through. False: there is nothing to mark now. */
  mark(): boolean {
    if (this.find.hidden) return false;
    this.publish({ marker: "", markerKind: MarkerKind.note });
    return true;
  }

  /** @param has_hand  this page leads the hand */
  take({ task, replay }: Health, has_hand: boolean): void {
    if (has_hand) this.participation.begin();
    this.element.hidden = task === undefined;
    if (!task) {
      this.state = null;
      return;
    }
    this.is_replay = replay !== undefined;
    const news = task_news(this.state, task);
    if (news) write(this.news, news);
    const had_focus = this.element.contains(document.activeElement);
    const has_changed = this.state?.phase !== task.phase;
    this.state = task;
    if (has_changed) this.place_briefing();
    this.write(task);
    if (has_changed && had_focus) this.focus();
  }

  private write(task: TaskState): void {
    const is_running = task.phase === TaskPhase.running;
    const has_ended = task.phase === TaskPhase.ended;
    const may_act = this.can_publish && !this.is_replay;
    this.element.dataset.phase = TaskPhase[task.phase];
    write(this.title, has_ended ? "Score" : is_running ? "Task" : "Your task");
    write(this.briefing_text, task.briefing);
    this.briefing.hidden = has_ended || task.briefing === "";
    write(this.progress, is_running ? time_words(task) + progress_words(task) : task.timeS > 0 ? `You have ${clock_words(task.timeS)}.` : "");
    this.progress.hidden = has_ended || this.progress.textContent === "";
    this.start.hidden = task.phase !== TaskPhase.waiting || !may_act;
    // whoever watches does not end the task of another with a touch
    const is_watched = is_running && task.isStartedByPerson && !this.participation.takes_part;
    this.join.hidden = !may_act || !is_watched;
    this.find.hidden = !is_running || is_watched || !has_marks(task.kind) || !may_act;
    write(this.find, task.kind === TaskKind.needle ? "The resistance is lost (M)" : "Mark a find (M)");
    this.stop.element.hidden = !is_running || is_watched || !may_act;
    if (this.stop.element.hidden) this.stop.reset();
    this.findings.hidden = this.figures.hidden = !has_ended;
    // what scrolls is a stop of Tab, so that its end is reached by keys
    if (this.element.scrollHeight > this.element.clientHeight) this.element.tabIndex = 0;
    else this.element.removeAttribute("tabindex");
    this.force.is_known &&= has_ended;
    this.force.element.hidden = !this.force.is_known;
    if (this.findings.childElementCount !== task.findings.length || this.findings.textContent !== task.findings.join("")) {
      this.findings.replaceChildren(...task.findings.map((finding) => make("li", "", finding)));
    }
    if (this.figures.childElementCount !== task.figures.length) {
      this.figures.replaceChildren(...task.figures.map(({ label, value }) => {
        const line = make("div");
        line.append(make("dt", "", label), make("dd", "", value));
        return line;
      }));
    }
  }

  /** Before the start it is read, then at hand below the buttons. */
  private place_briefing(): void {
    const is_running = this.state?.phase === TaskPhase.running;
    (is_running ? this.findings : this.progress).before(this.briefing);
    this.briefing.open = !is_running || !matchMedia("(max-width: 600px)").matches;
  }

  /** Keeps the keyboard where the button was that has gone. */
  private focus(): void {
    const next = [this.start, this.find, this.stop.element, this.join].find((button) => !button.hidden);
    if (next) next.focus();
    else {
      this.title.tabIndex = -1;
      this.title.focus();
    }
  }
}
