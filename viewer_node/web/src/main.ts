// SPDX-License-Identifier: Apache-2.0
// main.ts: connects the stream to the 3-D view, the plots and the texts.
import "uplot/dist/uPlot.min.css";
import "./style.css";
import { AcknowledgeControl, type ShownDevice } from "./acknowledge";
import { make, write, type Palette, type View } from "./card";
import { refusal_words } from "./connection";
import { TissueControl } from "./control";
import { Details } from "./task/details";
import { Timeline, type SessionEvent } from "./events";
import { FoxgloveClient, type Handler } from "./foxglove";
import { HandControl, type Led } from "./hand";
import { Hints } from "./hints";
import {
  announcement, banner_lines, by_id, Counters, lost_lines, Measure, NodeChips, segments, telemetry_lost, write_banners, write_hand, write_scale,
  write_session, write_state, write_tissues, type Banner,
} from "./panels";
import { Plots, type ForceAxis } from "./plots";
import { RecordingList } from "./recordings";
import { RunControl } from "./run";
import { SceneView } from "./scene/scene_view";
import { Sides } from "./sides";
import { forces_of, kNoForce, state_words, verdict_of, type Verdict } from "./state";
import { floats_of, scene_signature, Surface, type ColourMode } from "./scene/surface";
import { kNodes, norm, Telemetry, type NodeName } from "./telemetry";
import { TaskPanel } from "./task/task";
import { TimelineCard } from "./timeline";
import { MarkerKind } from "./wire";
import type { DeviceTelemetry, Health, Lesion, Log, MeshFrame, MeshSteps, MofcTelemetry, PhysicsTelemetry, SceneState, TaskMap, Vector3 } from "./wire";

// About the time in which a curve moves by a pixel.
const kPlotPeriod_s = (window_s: number) => Math.min(Math.max(window_s / 300, 1 / 15), 1 / 5);
const kWordsPeriod_s = 1 / 8;
const kTimelinePeriod_s = 1;
const kStatusShown_s = 6;
const kMarkerShown_s = 2;
const kTurning_s = 0.5;
const kSoftwarePause_ms = 50;
const kMostEarly = 256; // frames
const kServerSilence_s = 1.5; // /health comes five times a second

const seconds = () => 1e-3 * performance.now();

/** By side: the last word on a run, shown when its server has gone. */
const verdicts = new Map<string, Verdict>();

let telemetry = new Telemetry(); // of the side on display
const sides = new Sides(by_id("sides"), by_id("picture"), () => show_side());
const canvas = by_id<HTMLCanvasElement>("canvas");
const view = new SceneView(canvas);
by_id("no-webgl").hidden = view.can_draw;
const force_axis = make("div", "segments");
force_axis.setAttribute("role", "radiogroup");
force_axis.setAttribute("aria-label", "Component of the force");
const plots = new Plots(by_id("plots"), force_axis);
const timeline = new Timeline();
const timeline_card = new TimelineCard(by_id("plots"), timeline);
const control = new TissueControl(by_id("plots"),
  (change) => client.publish("/tissue_change", "palpate.v1.TissueChange", { ...change }));
const acknowledge = new AcknowledgeControl(by_id("acknowledge"),
  (seen) => client.publish("/acknowledgement", "palpate.v1.Acknowledgement", { ...seen }));
const run = new RunControl(by_id("tools"), by_id("replay"), timeline_card.marker_text,
  (request) => client.publish("/run_request", "palpate.v1.RunRequest", { ...request }));
const task = new TaskPanel(by_id("task"),
  (request) => {
    // who starts it is about to touch: arrow keys lead the hand then
    if (request.markerKind === MarkerKind.task_start && hand.status.is_allowed) touch(true);
    return client.publish("/run_request", "palpate.v1.RunRequest", { ...request });
  });
const details = new Details(by_id("details"), document.body, () => {
  if (scene) write_session(scene, details.are_closed);
  say(seconds(), shown(seconds())); // not a picture later: what is for experts goes at once
  plots_due_s = 0;
});
const recordings = new RecordingList(by_id<HTMLDetailsElement>("recordings"), location.search);
const counters = new Counters(by_id("plots"));
const chips = new NodeChips(by_id("nodes"));
const measure = new Measure(by_id<SVGSVGElement>("triad"));

let scene: SceneState | null = null;
let is_scene_current = false; // false after a new connection: the motion since is unknown
let scene_builds = 0;
let surfaces: Surface[] = [];
let early: MeshFrame[] = []; // the newest frames whose scene has not arrived yet
let early_steps: MeshSteps | null = null; // likewise; each is complete
let mode: ColourMode = "material";
let window_s = 10;
let is_paused = false;
let paused_s = NaN; // device's clock
let paused_physics_s = NaN; // physics' clock
let is_open = false;
const begun_s = seconds();
let has_been_connected = false;
let refusal = ""; // why the last attempt to connect failed, if that is known
let status: Banner & { until_s: number } = { text: "", tone: "calm", until_s: -Infinity };
let map: { places: Float32Array; is_searched: Uint8Array; lesions: Lesion[] } | null = null; // of a task: its area, or what was searched
let mesh_frames = 0;
let mesh_cost_s = 0;
let plot_draws = 0;

// ---- the stream

const handlers: Record<string, Handler> = {
  "/scene_state": (message: SceneState) => take_scene(message),
  "/mesh": (message: MeshFrame) => take_mesh(message),
  "/mesh_steps": (message: MeshSteps) => take_mesh_steps(message),
  "/task_map": (message: TaskMap) => {
    map = { places: floats_of(message.placesM), is_searched: message.isSearched.slice(), lesions: message.lesions };
    if (map.is_searched.length > 0) task.trace = message;
    show_map();
  },
  "/log": (message: Log) => {
    const event = timeline.take(message);
    if (event) {
      control.take(event);
      mark(event);
    }
    const verdict = verdict_of(message.message);
    if (verdict) verdicts.set(verdict.side, verdict);
  },
  "/health": (message: Health) => {
    take_sides(message);
    telemetry.take_health(message, seconds(), sides.shown);
    hand.review();
    task.take(message, hand.status.is_mine);
    details.take(message.task !== undefined);
    view.set_goal(message.task?.goal ?? null);
    recordings.take(message.recorder);
    if (map && (map.is_searched.length > 0 ? !task.has_ended : !message.task)) { // a replay that has gone back, or another session
      map = null;
      show_map();
    }
    const marker = run.take(message);
    if (marker && !task.says(marker)) status = { text: `Marked: ${marker}`, tone: "calm", until_s: seconds() + kMarkerShown_s };
  },
};

function show_map(): void {
  view.set_map(map);
  const places = map === null || map.places.length === 0 ? "none" : map.is_searched.length > 0 ? "searched" : "area";
  task.show_keys(places, map?.lesions.map(({ isFound }) => isFound) ?? []);
}

/** "/device", or "/left/device" of a side. */
const kOfSide = /^(?:\/([\w-]+))?\/(device|mofc|physics)$/;

/** Of the sides only the one on display is subscribed to. */
function handler_of(topic: string): Handler | undefined {
  const [, side = "", kind] = kOfSide.exec(topic) ?? [];
  if (kind === undefined) return handlers[topic];
  if (side !== sides.shown) return undefined;
  if (kind === "device") return (message: DeviceTelemetry, wall_s: number) => telemetry.take_device(message, seconds(), wall_s);
  if (kind === "mofc") return (message: MofcTelemetry) => telemetry.take_mofc(message, seconds());
  return (message: PhysicsTelemetry) => telemetry.take_physics(message, seconds());
}

/** Shows an event in the plots; what ended or returned needs no line. */
function mark(event: SessionEvent): void {
  if (event.tone !== "calm" || event.lane === "changes") telemetry.mark(event.at_s, event.tone, event.text);
}

/** Another side is on display: its figures begin now. */
function show_side(): void {
  hand.release();
  touch(false);
  telemetry = new Telemetry();
  for (const event of timeline.events) mark(event);
  view.shown_side = sides.are_many ? 0 : sides.index;
  allow_hand();
  if (is_paused) pause(false);
  client.review();
  plots_due_s = words_due_s = 0;
}

/** The topics on which this page may publish. */
let accepted: string[] = [];
function allow_hand(): void {
  hand.can_publish = accepted.includes(hand_topic());
  hand.review();
}
const hand_topic = () => (sides.shown ? `/${sides.shown}/hand_target` : "/hand_target");

const client = new FoxgloveClient(
  `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/${location.search}`,
  handler_of,
  {
    advertised(topics) {
      sides.set_names([...new Set(topics.flatMap((topic) => kOfSide.exec(topic)?.slice(1, 2).map((side) => side ?? "") ?? []))]);
      allow_hand();
    },
    opened() {
      is_open = has_been_connected = true;
      refusal = "";
      verdicts.clear();
      is_scene_current = false;
    },
    closed() {
      is_open = false;
      hand.forget();
      if (verdicts.size > 0) return;
      void refusal_words(location.search, location.host).then((words) => { if (!is_open) refusal = words; });
    },
    server_info({ metadata }) {
      accepted = (metadata.client_topics ?? "").split(" ");
      control.can_publish = accepted.includes("/tissue_change");
      acknowledge.can_publish = accepted.includes("/acknowledgement");
      run.can_publish = task.can_publish = accepted.includes("/run_request");
      hand.client_id = BigInt(metadata.client_id ?? 0);
    },
    status({ level, id, message }) {
      if (level < 1 || /(^|\.)hand$/.test(id ?? "")) return; // the hand's panel shows the holder
      const text = id === "send_buffer" ? "This page reads too slowly: messages are dropped." : `Server: ${message}`;
      status = { text, tone: "alarm", until_s: seconds() + kStatusShown_s };
    },
  });

/** The hand of the side on display. */
function led(): Led {
  const { state } = sides; // undefined: there is one device
  const { health, hand_m, tool_m } = telemetry;
  return {
    pointer: state ? state.pointer : scene?.pointer,
    workspace_scale_ratio: state ? state.workspaceScaleRatio : scene?.workspaceScaleRatio ?? NaN,
    holder: (state ? state.handHolder : health?.handHolder) ?? 0n,
    is_replay: health?.replay !== undefined, hand_m, tool_m,
  };
}
const hand = new HandControl(canvas, view, led, (fields) => client.publish(hand_topic(), "palpate.v1.HandTarget", fields));
new Hints(document.body);

// An open socket to a stalled server does not count as a connection.
const server_silence_s = () => seconds() - Math.max(begun_s, 1e-3 * client.heard_ms);
const is_connected = () => is_open && server_silence_s() < kServerSilence_s;

function take_scene(message: SceneState): void {
  const is_known = is_scene_current && scene?.header.sessionId === message.header.sessionId && scene.revision === message.revision;
  if (is_known) return;
  const taken = message.tissues.map((tissue) => new Surface(tissue)); // all or nothing
  scene = message;
  is_scene_current = true;
  scene_builds += 1;
  surfaces = taken;
  view.set_surfaces(surfaces, scene, scene.peakForceNewton);
  show_reach();
  hand.review();
  control.set_scene(scene);
  write_hand(hand.status, hand.is_touching);
  write_session(scene, details.are_closed);
  write_tissues(surfaces, mode);
  write_scale(view, mode);
  measure.write(view);
  const waiting = early;
  early = [];
  for (const frame of waiting) take_mesh(frame);
  const steps = early_steps;
  early_steps = null;
  if (steps) take_mesh_steps(steps);
}

function take_mesh_steps(message: MeshSteps): void {
  if (!scene || message.sceneRevision !== scene.revision || message.sessionId !== scene.header.sessionId) {
    early_steps = message;
    return;
  }
  const begin = performance.now();
  surfaces.forEach((surface, index) => {
    const steps = message.tissues.find(({ tissue }) => tissue === index);
    const was_deformed = surface.max_displacement_m > 0;
    if (!surface.take_steps(steps, message.stepM)) throw new Error(`mesh steps do not fit tissue ${index}`);
    if (!is_paused) view.update(index, was_deformed || surface.max_displacement_m > 0);
  });
  mesh_frames += 1;
  mesh_cost_s = 1e-3 * (performance.now() - begin);
}

function take_mesh(frame: MeshFrame): void {
  if (!scene || frame.sceneRevision !== scene.revision || frame.header.sessionId !== scene.header.sessionId) {
    early = [...early.slice(1 - kMostEarly), frame];
    return;
  }
  const begin = performance.now();
  if (!surfaces[frame.tissue]?.take(frame)) throw new Error(`mesh frame does not fit tissue ${frame.tissue}`);
  if (surfaces[frame.tissue].strain) strain_choice.hidden = false;
  if (!is_paused) view.update(frame.tissue, frame.verticesM.length > 0);
  mesh_frames += 1;
  mesh_cost_s = 1e-3 * (performance.now() - begin);
}

// ---- controls

segments<number>(by_id("windows"), [[2, "2 s"], [10, "10 s"], [30, "30 s"], [60, "60 s"]], window_s, (value) => {
  window_s = value;
  plots_due_s = 0;
});
segments<ForceAxis>(force_axis, [["norm", "|F|"], ["x", "x"], ["y", "y"], ["z", "z"]], "norm", (axis) => {
  plots.set_force_axis(axis);
  plots_due_s = 0;
});
segments<ColourMode>(by_id("colours"), [["material", "Material"], ["stiffness", "Stiffness"], ["displacement", "Displacement"], ["strain", "Strain"]], mode, (value) => {
  mode = value;
  view.colour(mode);
  write_tissues(surfaces, mode);
  write_scale(view, mode);
});
const strain_choice = by_id("colours").querySelector<HTMLButtonElement>("[data-value=strain]")!;
strain_choice.hidden = true; // until an elastic body reports it

/** As arrows; what is requested is one of the details. */
function shown_forces({ requested, applied }: { requested: Vector3 | null; applied: Vector3 | null }): { requested: Vector3; applied: Vector3 } {
  return { requested: (!details.are_closed && requested) || kNoForce, applied: applied ?? kNoForce };
}
function set_tools(): void {
  const { requested, applied } = shown_forces(forces_of(telemetry, is_connected(), seconds()));
  view.set_tool(telemetry.tool_m, telemetry.tool_orientation, requested, applied, view.shown_side);
  if (sides.are_many) return; // see take_sides()
  sides.states.forEach((side, index) => {
    const { toolPositionWorldM: tool_m, toolOrientationWorld: turned } = side;
    if (index === sides.index || !tool_m || !turned) return;
    const is_known = is_connected() && sides.is_heard(side.name);
    const { requested, applied } = shown_forces({
      requested: (is_known && side.requestedForceOnHandNewton) || null, applied: (is_known && side.forceOnHandNewton) || null,
    });
    view.set_tool(tool_m, turned, requested, applied, index);
  });
}
/** Of many sides those that are not on display are drawn as often as /health comes. */
function take_sides(message: Health): void {
  sides.take(message);
  if (!sides.are_many || is_paused) return;
  are_labels_due = true;
  view.set_others(sides.states.flatMap(({ toolPositionWorldM }, index) => (index !== sides.index && toolPositionWorldM ? [toolPositionWorldM] : [])));
}
let are_labels_due = true; // of the other tools, where there are many
function label_tools(): void {
  if (sides.names.length < 2) return;
  const is_shown_only = sides.are_many && !are_labels_due;
  are_labels_due = false;
  sides.states.forEach((side, index) => {
    if (is_shown_only && index !== sides.index) return;
    const tool_m = index === sides.index ? telemetry.tool_m : side.toolPositionWorldM;
    sides.label(index, tool_m && Number.isFinite(tool_m.x) ? view.project(tool_m) : null);
  });
}

function pause(does: boolean): void {
  if (does) { // freeze all displays at the same instant
    set_tools();
    write_state(telemetry, is_connected(), verdicts.size > 0, details.are_closed, seconds());
  }
  is_paused = does;
  paused_s = telemetry.now_s;
  paused_physics_s = telemetry.physics.newest_s;
  by_id("pause").setAttribute("aria-pressed", String(does));
  by_id("pause").querySelector("span")!.textContent = does ? "Resume" : "Pause";
  by_id("scene").classList.toggle("is-paused", does);
  if (!does) surfaces.forEach((_, index) => view.update(index));
  plots_due_s = 0;
}
by_id("pause").addEventListener("click", () => pause(!is_paused));

by_id("inside").addEventListener("click", (event) => {
  const button = event.currentTarget as HTMLElement;
  const does = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", String(does));
  view.see_inside(does);
});
/** The box that the tool reaches, where the scene tells it and the user wants it. */
function show_reach(): void {
  by_id("reach").hidden = !scene?.reach;
  view.show_reach(by_id("reach").getAttribute("aria-pressed") === "true" ? scene?.reach ?? null : null);
}
by_id("reach").addEventListener("click", (event) => {
  const button = event.currentTarget as HTMLElement;
  button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
  show_reach();
});
by_id("reset-view").addEventListener("click", () => view.frame());
by_id("to-tool").addEventListener("click", () => view.orbit_tool());

function touch(does: boolean): void {
  hand.is_touching = does;
  if (!does) hand.release();
  write_hand(hand.status, hand.is_touching);
}
by_id("touch-toggle").addEventListener("click", () => {
  touch(!hand.is_touching);
  if (hand.is_touching) canvas.focus();
});

let kept_theme: string | null = null;
try {
  kept_theme = localStorage.getItem("theme");
} catch { /* storage is blocked: the theme lasts as long as the page */ }
const prefers_dark = matchMedia("(prefers-color-scheme: dark)");
function dress(): void {
  const chosen = kept_theme;
  const root = document.documentElement;
  root.dataset.theme = chosen ?? (prefers_dark.matches ? "dark" : "light");
  const styles = getComputedStyle(root);
  const of = (name: string) => styles.getPropertyValue(name).trim();
  const palette: Palette = { ink: of("--ink"), faint: of("--faint"), line: of("--line"), of };
  view.set_theme({
    background: of("--scene"), grid: of("--grid"), ink: of("--ink"), tool: of("--tool"),
    requested: of("--requested"), applied: of("--applied"), target: of("--accent"),
    searched: of("--searched"), missed: of("--missed"), area: of("--area"),
  });
  show_map();
  for (const plot of plots.all) plot.build(palette);
  plots_due_s = 0;
}
by_id("theme").addEventListener("click", () => {
  const now = document.documentElement.dataset.theme;
  kept_theme = now === "dark" ? "light" : "dark";
  try {
    localStorage.setItem("theme", kept_theme);
  } catch { /* as above */ }
  dress();
});
prefers_dark.addEventListener("change", dress);

const kTurn_rad = 0.09;
canvas.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const turns: Record<string, [number, number, number]> = {
    ArrowLeft: [-kTurn_rad, 0, 1], ArrowRight: [kTurn_rad, 0, 1], ArrowUp: [0, -kTurn_rad, 1], ArrowDown: [0, kTurn_rad, 1],
    "+": [0, 0, 0.9], "=": [0, 0, 0.9], "-": [0, 0, 1.1],
  };
  if (hand.key(event.key)) { /* the hand's */ }
  else if (event.key in turns) view.orbit(...turns[event.key]);
  else if (event.key === "Home") view.frame();
  else if (event.key === "End") view.orbit_tool();
  else return;
  event.preventDefault();
});
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
  if (run.key(event.key)) return;
  // arrows mean nothing to a button: with the focus on "Mark a find" they lead the hand
  const is_free = event.target === document.body || event.target instanceof HTMLButtonElement;
  if (is_free && hand.is_touching && hand.key(event.key)) event.preventDefault();
  if (event.repeat) return; // a key that is held down says it once
  const letter = event.key.toLowerCase();
  if (letter === "p") pause(!is_paused);
  else if (letter === "m" && !task.mark()) run.mark();
  else if (letter === "t" && hand.status.is_allowed) touch(!hand.is_touching);
});

// ---- the picture

let turned_s = -Infinity;
view.on_camera = () => {
  turned_s = seconds();
  are_labels_due = true;
  measure.write(view);
};
new ResizeObserver(() => {
  view.resize(canvas.clientWidth, canvas.clientHeight);
  for (const plot of plots.all) plot.resize();
}).observe(canvas);
new ResizeObserver(() => {
  for (const plot of plots.all) plot.resize();
  plots_due_s = 0;
}).observe(by_id("plots"));

/** What the displays show. */
function shown(now_s: number): View {
  const is_fresh = (name: NodeName) => is_paused || (is_connected() && telemetry.is_fresh(name, now_s));
  return {
    telemetry, window_s,
    end_s: is_paused ? paused_s : telemetry.now_s,
    physics_end_s: is_paused ? paused_physics_s : telemetry.physics.newest_s,
    is_fresh: { device: is_fresh("device"), mofc: is_fresh("mofc"), physics: is_fresh("physics") },
  };
}

let was_fresh = "";
let plots_due_s = 0;
let words_due_s = 0;
let timeline_due_s = 0;
let frame_s = 1 / 60; // between pictures, smoothed
let picture_s = seconds();
/** Without a GPU only who turns the view or leads the hand gets every picture of the display: the
 *  processor may have a device to serve. */
function await_picture(now_s: number): void {
  if (view.has_gpu || hand.is_touching || now_s - turned_s < kTurning_s) requestAnimationFrame(picture);
  else setTimeout(() => requestAnimationFrame(picture), kSoftwarePause_ms);
}
function picture(): void {
  const now_s = seconds();
  await_picture(now_s);
  frame_s += 0.1 * (Math.min(now_s - picture_s, 1) - frame_s);
  picture_s = now_s;
  if (!is_paused) set_tools();
  if (view.draw()) label_tools();
  const display = shown(now_s);
  const fresh = kNodes.filter((name) => display.is_fresh[name]).join();
  if (fresh !== was_fresh) words_due_s = 0; // withdrawn at once
  was_fresh = fresh;
  if (now_s >= plots_due_s) {
    plots_due_s = now_s + (is_paused ? Infinity : Math.max(kPlotPeriod_s(window_s), 3 * frame_s)); // on a slow machine the 3-D view has priority
    plots.torque.show(telemetry.applied_newton_m !== null);
    if (!details.are_closed) for (const plot of plots.all) plot.draw(display);
    plot_draws += 1;
  }
  if (now_s >= words_due_s) {
    words_due_s = now_s + kWordsPeriod_s;
    say(now_s, display);
  }
  if (now_s >= timeline_due_s) {
    timeline_due_s = now_s + kTimelinePeriod_s;
    timeline_card.write();
  }
}

function say(now_s: number, display: View): void {
  // before the first connection, nothing is reported as lost
  const is_waiting = !has_been_connected && now_s < 2;
  if (!is_waiting && !is_paused) write_state(telemetry, is_connected(), verdicts.size > 0, details.are_closed, now_s);
  for (const plot of plots.timed) plot.tell(display); // of the same tick as the state
  if (!is_paused) plots.loop.tell(display);
  chips.write(telemetry, scene, is_connected(), now_s);
  // a page that was busy has not read yet what has arrived
  const heard_s = Math.min(now_s, 1e-3 * client.heard_ms);
  const problems = sides.problems(telemetry.replay_stands);
  write_banners(by_id("banners"), is_waiting ? [] : banners(problems, now_s, heard_s));
  write(by_id("announcement"), is_waiting ? "" : announcement(telemetry, is_connected(), verdicts.size > 0, hand.status, problems, heard_s));
  write_hand(hand.status, hand.is_touching);
  acknowledge.write(devices(now_s));
  counters.write(telemetry);
  if (mode === "displacement" || mode === "strain") write_scale(view, mode);
}

/** Those whose state is known now. */
function devices(now_s: number): ShownDevice[] {
  if (!is_connected() || telemetry.health?.replay) return [];
  if (sides.states.length > 0) {
    return sides.states.filter(({ name }) => sides.is_heard(name)).map((side) => ({ ...side, side: side.name, session: side.deviceSessionId }));
  }
  const batch = telemetry.device_batch;
  return batch && telemetry.is_fresh("device", now_s) ? [{ ...batch.counters, side: "", session: batch.header.sessionId }] : [];
}

/** Failures of every side, whichever is on display. @param heard_s  from the server */
function banners(problems_of_others: string[], now_s: number, heard_s: number): Banner[] {
  if (!is_connected()) return lost_lines(has_been_connected ? server_silence_s() : NaN, [...verdicts.values()], refusal, details.are_closed);
  const lines = [...banner_lines(telemetry, sides.shown, heard_s), ...problems_of_others.map((text): Banner => ({ text, tone: "alarm" }))];
  return now_s < status.until_s ? [...lines, status] : lines;
}

dress();
picture();

// ---- for tests: the page's state as plain values
Object.defineProperty(window, "__scene_signature", { get: () => scene_signature(surfaces) });
Object.defineProperty(window, "__test", {
  get: () => {
    const now_s = seconds();
    return {
      is_connected: is_connected(),
      state: state_words(telemetry, is_connected(), now_s, verdicts.size > 0),
      nodes: Object.fromEntries(kNodes.map((name) => {
        const node = telemetry.nodes[name];
        return [name, {
          is_alive: node.is_alive(now_s), silence_s: node.silence_s(now_s), restarts: node.restarts,
          batches_lost: node.batches_lost, rate_hz: node.rate_hz,
        }];
      })),
      scene: scene && {
        revision: Number(scene.revision), name: scene.sessionName,
        tissues: surfaces.map((s) => ({
          name: s.name, vertices: s.vertex_count, stiffness_newton_per_m: s.stiffness_newton_per_m, shown_stiffness_newton_per_m: s.shown_stiffness_newton_per_m, displacement_m: s.max_displacement_m, offset_m: { ...s.offset_m },
        })),
        has_pointer: led().pointer !== undefined,
      },
      task_map: map && { places: map.places.length / 3, searched: map.is_searched.reduce((sum, one) => sum + one, 0), lesions: map.lesions.length },
      scene_builds, mesh_frames, mesh_cost_s,
      frames: view.frame_count, frame_cost_s: view.frame_cost_s, plot_draws,
      received: client.frame_count, bytes: client.byte_count, unreadable: client.unreadable_count,
      telemetry_lost: telemetry_lost(telemetry),
      device_phase: telemetry.device_batch?.counters.phase,
      sides: Object.fromEntries(sides.states.map(({ name, toolPositionWorldM, forceOnHandNewton }) =>
        [name, { tool_m: { ...toolPositionWorldM }, applied_newton: norm(forceOnHandNewton ?? kNoForce) }])),
      shown_side: sides.shown,
      now_s: telemetry.now_s, device_ticks: telemetry.device.length, mofc_ticks: telemetry.mofc.length,
      plots: {
        end_s: plots.force.end_s,
        force: plots.force.status, torque: plots.torque.status, energy: plots.energy.status, transparency: plots.transparency.status,
        timing: plots.timing.status, lateness_total: plots.lateness.total,
        loop: { points: plots.loop.points, ...plots.loop.most },
      },
      instants: plots.force.instants.map(({ at_s, tone, text }) => ({ at_s, tone, text })),
      contact: { depth_m: telemetry.depth_m, speed_m_per_s: telemetry.speed_m_per_s, stiffness_newton_per_m: telemetry.stiffness_newton_per_m },
      events: timeline.events.map(({ at_s, lane, node, text }) => ({ at_s, lane, node, text })),
      tool_m: { ...telemetry.tool_m }, tool_px: view.project(telemetry.tool_m), fixed_px: view.project({ x: 0.03, y: 0.03, z: 0 }), target_m: { ...hand.target },
      applied_newton_m: telemetry.applied_newton_m && norm(telemetry.applied_newton_m),
      applied_newton: norm(telemetry.applied_newton), requested_newton: norm(telemetry.requested_newton),
      replay: run.replay && { ...run.replay, beginNs: Number(run.replay.beginNs) }, recorder: telemetry.health?.recorder,
      hand: { ...hand.status, sent: hand.sent_count, client_id: Number(hand.client_id) },
      is_paused, window_s, mode,
      scale: { low: view.scale_low, high: view.scale_high },
    };
  },
});
