// SPDX-License-Identifier: Apache-2.0
// timeline.ts: the events of the session as a strip of lanes over time, and as a list.
import { make, write } from "./card";
import { kLanes, type Lane, type SessionEvent, type Timeline } from "./events";
import { duration_words } from "./state";

const kMostListed = 60;
const kLeastSpan_s = 10;
const kMostMarkerText = 60; // of at most 200 bytes

export class TimelineCard {
  private readonly lanes: Record<Lane, HTMLElement>;
  private readonly list = make("ol", "events");
  private readonly from = make("span");
  private readonly none = make("p", "none", "No events yet.");
  /** Of the next marker. */
  readonly marker_text = make("input", "marker-text");
  private lane: Lane | null = null; // listed; null: all
  private shown = -1;
  private readonly opened_s = 1e-3 * Date.now();

  constructor(parent: HTMLElement, private readonly timeline: Timeline) {
    const card = make("section", "card wide");
    card.id = "timeline";
    card.setAttribute("aria-label", "Events of the session");
    const head = make("header", "card-head");
    const filter = make("select");
    filter.id = "event-filter";
    filter.setAttribute("aria-label", "Events that are listed");
    filter.append(new Option("all", ""), ...kLanes.map((lane) => new Option(lane, lane)));
    filter.addEventListener("change", () => {
      this.lane = (filter.value || null) as Lane | null;
      this.shown = -1;
      this.write();
    });
    Object.assign(this.marker_text, { id: "marker-text", type: "text", maxLength: kMostMarkerText, placeholder: "Text of the next marker", hidden: true });
    this.marker_text.setAttribute("aria-label", "Text of the next marker; Enter sets it");
    head.append(make("h2", "", "Events"), this.marker_text, filter);
    const strip = make("div", "strip");
    const lane_of = (lane: Lane) => {
      const row = make("div", "lane");
      const marks = make("div", "marks");
      row.append(make("span", "", lane), marks);
      strip.append(row);
      return marks;
    };
    this.lanes = {
      nodes: lane_of("nodes"), faults: lane_of("faults"), clamp: lane_of("clamp"), silence: lane_of("silence"), changes: lane_of("changes"),
    };
    const axis = make("p", "axis");
    axis.append(this.from, make("span", "", "now"));
    this.list.tabIndex = 0;
    this.list.setAttribute("aria-label", "Newest events first");
    card.append(head, strip, axis, this.none, this.list);
    parent.append(card);
  }

  write(): void {
    const { timeline } = this;
    const now_s = Math.max(1e-3 * Date.now(), timeline.events.at(-1)?.at_s ?? 0);
    const begin_s = Math.min(timeline.events[0]?.at_s ?? this.opened_s, now_s - kLeastSpan_s);
    write(this.from, `${duration_words(now_s - begin_s)} ago`);
    const percent = (at_s: number) => (100 * (at_s - begin_s)) / (now_s - begin_s);
    const marks: Record<Lane, HTMLElement[]> = { nodes: [], faults: [], clamp: [], silence: [], changes: [] };
    for (const span of timeline.spans()) {
      const mark = make("i");
      mark.dataset.tone = span.tone;
      mark.title = title_of(span, span.to_s === null ? "" : span.to_s > span.at_s ? `, for ${duration_words(span.to_s - span.at_s)}` : "");
      mark.style.left = `${percent(span.at_s).toFixed(2)}%`;
      mark.style.width = `${(percent(span.to_s ?? now_s) - percent(span.at_s)).toFixed(2)}%`;
      marks[span.lane].push(mark);
    }
    for (const lane of kLanes) this.lanes[lane].replaceChildren(...marks[lane]);
    if (this.shown === timeline.count) return;
    this.shown = timeline.count;
    const listed = timeline.events.filter(({ lane }) => this.lane === null || lane === this.lane);
    write(this.none, this.lane === null ? "No events yet." : `No events of ${this.lane}.`);
    this.none.hidden = listed.length > 0;
    this.list.hidden = listed.length === 0;
    this.list.replaceChildren(...listed.slice(-kMostListed).reverse().map((event) => {
      const item = make("li");
      item.dataset.tone = event.tone;
      item.append(make("time", "", clock(event.at_s)), make("b", "", event.node), make("span", "", event.text));
      item.title = title_of(event, "");
      return item;
    }));
  }
}

function title_of({ at_s, node, text }: SessionEvent, more: string): string {
  return `${clock(at_s)} ${node}: ${text}${more}`;
}
function clock(at_s: number): string {
  return new Date(1e3 * at_s).toLocaleTimeString("en-GB");
}
