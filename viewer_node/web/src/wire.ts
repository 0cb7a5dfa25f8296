// SPDX-License-Identifier: Apache-2.0
// wire.ts: the messages of proto/palpate/v1 as TypeScript types. The schemas come with the
// channels; units, frames and ranges are documented in the .proto files. Names are
// those of the .proto in camel case; 64-bit integers are bigint.

export interface Vector3 {
  x: number;
  y: number;
  z: number;
}
export interface Quaternion extends Vector3 {
  w: number;
}
export interface Header {
  sessionId: bigint;
  sequence: bigint;
  sampledAtNs: bigint;
}
export interface LinkCounters {
  accepted: bigint;
  skipped: bigint;
  duplicates: bigint;
  outOfOrder: bigint;
  rejected: bigint;
  ahead: bigint;
  sessions: bigint;
}
export interface LoopCounters {
  ticks: bigint;
  skippedTicks: bigint;
  worstLatenessNs: bigint;
}

export interface DeviceTelemetry {
  header: Header;
  counters: {
    loop: LoopCounters;
    forceCommand: LinkCounters;
    answeredTicks: bigint;
    leasedTicks: bigint;
    fallbackTicks: bigint;
    limpTicks: bigint;
    peakLimitedTicks: bigint;
    faultTicks: bigint;
    deviceFaults: bigint;
    lastFault: number;
    phase: number;
    maxForceNewton: number;
    minimumTrueEnergyJoule: number;
    nonFiniteCommands: bigint;
    isMonitorOff: boolean;
    monitorReductions: bigint;
    ledgerExcesses: bigint;
    hasNoMotorWatchdog: boolean;
    acceptsNoMotorWatchdog: boolean;
    deadManTicks: bigint;
  };
  recordsLost: bigint;
  sampledAtNs: bigint[];
  latenessNs: bigint[];
  replyTimeNs: bigint[];
  measuredHandPositionM: number[];
  measuredToolPositionWorldM: number[];
  measuredToolOrientationWorld: number[]; // w, x, y, z of each tick; empty: never turned
  forceOnHandNewton: number[];
  wristTorqueOnHandNewtonM?: number[]; // three joints of each tick; missing or empty: no wrist
  guard: number[];
  flags: number[];
  trueEnergyJoule: number[];
}

export interface MofcTelemetry {
  header: Header;
  counters: {
    deviceState: LinkCounters;
    interaction: LinkCounters;
    ticks: bigint;
    clampedTicks: bigint;
    staleTicks: bigint;
    latePhysicsTicks: bigint;
    ledgerResets: bigint;
    motionsDropped: bigint;
    transparencyIntegralNs: number;
    transparencyTimeNs: bigint;
    tooFastTicks: bigint;
  };
  recordsLost: bigint;
  deviceSessionId: bigint[];
  deviceSampledAtNs: bigint[];
  requestedForceOnHandNewton: number[];
  requestedWristTorqueNewtonM?: number[]; // likewise
  commandedForceOnHandNewton: number[];
  fMaxNewton: number[];
  ledgerEnergyJoule: number[];
  forceAgeNs: bigint[];
  state: number[];
  flags: number[];
}

export interface PhysicsTelemetry {
  header: Header;
  counters: {
    loop: LoopCounters;
    toolMotion: LinkCounters;
    worstComputeTimeNs: bigint;
    elasticSolves: bigint;
    elasticSolvesLate: bigint;
    elasticSolvesFailed: bigint;
    elasticSolvesRepaired: bigint;
    elasticTipsAppeared: bigint;
    elasticErrorNewton?: number; // missing: unknown
    elasticBoundNewton?: number; // likewise
    elasticBoundViolations: bigint;
    elasticBoundsChecked: bigint;
    elasticContactSteps: bigint;
    elasticUnknownBoundSteps: bigint;
  };
  recordsLost: bigint;
  steppedAtNs: bigint[];
  toolPositionWorldM: number[];
  forceOnToolNewton: number[];
  contactCount: number[];
  penetrationM: number[]; // empty: unknown
  stiffnessNewtonPerM: number[]; // likewise
}

/** foxglove.Log, one event of a node: event=NAME key=value … */
export interface Log {
  timestamp?: { seconds: bigint; nanos: number };
  level: number; // 2 information, 3 warning, 4 error
  message: string;
  name: string; // of the node
}

export interface TissueSurface {
  name: string;
  shape: number;
  verticesM: Uint8Array;
  triangles: Uint8Array;
  vertexStiffnessNewtonPerM: Uint8Array;
  stiffnessNewtonPerM: number;
  dampingNewtonSPerM: number;
  isRestorable: boolean;
}
export interface SceneState {
  header: Header;
  revision: bigint;
  sessionName: string;
  sessionText: string;
  controller: string;
  deviceRateHz: number;
  physicsRateHz: number;
  peakForceNewton: number;
  tipRadiusM: number;
  shaftLengthM: number;
  shaftRadiusM: number;
  workspaceScaleRatio: number;
  tissues: TissueSurface[];
  acceptsChanges: boolean;
  reach?: { centerM: Vector3; halfExtentM: Vector3 }; // of the tool, W
  pointer?: PointerHand;
}
export interface MeshFrame {
  header: Header;
  sceneRevision: bigint;
  tissue: number;
  firstVertex: number;
  verticesM: Uint8Array;
  vertexStrain: Uint8Array; // empty: none
  deviceSequence: bigint;
  displacementWorldM?: Vector3;
}

/** For an audience, instead of MeshFrame. */
export interface MeshSteps {
  sessionId: bigint;
  sceneRevision: bigint;
  stepM: number;
  tissues: TissueSteps[];
}
export interface TissueSteps {
  tissue: number;
  runs: number[];
  displacementSteps: number[];
  offsetSteps: number[];
}

export interface Health {
  nodes: {
    name: string;
    isHeard: boolean;
    silenceS: number;
    sessions: bigint;
    batchesLost: bigint;
    recordsLost: bigint;
  }[];
  clients: number;
  messagesDropped: bigint;
  framesRejected: bigint;
  handHolder: bigint;
  version: string;
  recorder?: RecorderState;
  sides: SideState[]; // empty: one device
  markers: { atNs: bigint; text: string; origin: string }[];
  replay?: ReplayState; // absent: a live session
  task?: TaskState; // absent: the session has no task
}
export interface PointerHand {
  centerM: Vector3;
  reachM: number;
  speedMPerS: number;
  holderTimeoutNs: bigint;
}
/** Of the newest tick of a device. */
export interface SideState {
  name: string;
  deviceSessionId: bigint;
  phase: number;
  deviceFaults: bigint;
  lastFault: number;
  guard: number;
  toolPositionWorldM?: Vector3; // absent: no tick yet
  toolOrientationWorld?: Quaternion;
  forceOnHandNewton?: Vector3;
  requestedForceOnHandNewton?: Vector3;
  handHolder: bigint;
  pointer?: PointerHand; // absent: its hand follows no page
  workspaceScaleRatio: number;
}
export interface RecorderState {
  isPossible: boolean;
  isRecording: boolean;
  file: string;
  lengthS: number;
  problem: string;
}
export interface TaskState {
  phase: TaskPhase;
  briefing: string;
  kind: TaskKind;
  elapsedS: number;
  timeS: number; // 0: no limit
  marks: number;
  findings: string[];
  figures: { label: string; value: string }[];
  goal?: Traction; // of a traction
  isStartedByPerson: boolean; // else it began with the run
}
/** Where held tissue is to be brought. */
export interface Traction {
  targetM: Vector3; // of the centre of the tip, W
  toleranceM: number;
  holdS: number;
  heldS: number; // the longest so far without a break
  isHolding: boolean;
  isAtTarget: boolean;
}
/** What a task shows after its end: what was searched, the lesions, and the force over its time. */
export interface TaskMap {
  placesM: Uint8Array; // float32 x, y, z of each place; W
  isSearched: Uint8Array; // of each place, 0 or 1
  lesions: Lesion[];
  slotS: number; // of mostNewton
  mostNewton: number[]; // largest force in each slot; NaN: not received
  marksS: number[]; // since the start
  limitNewton: number; // 0: none
}
export interface Lesion {
  name: string;
  centerM: Vector3; // W
  radiusM: number;
  isFound: boolean;
}
export enum TaskPhase { waiting, running, ended }
export enum TaskKind { free, palpation, needle, traction }
export enum MarkerKind { note, task_start, task_stop }
export interface ReplayState {
  file: string;
  positionS: number;
  lengthS: number;
  speedRatio: number;
  isPaused: boolean;
  beginNs: bigint;
}
/** From the page; fields that are left out change nothing. */
export interface RunRequest {
  marker?: string;
  seekS?: number;
  isPaused?: boolean;
  speedRatio?: number;
  isRecording?: boolean;
  markerKind?: MarkerKind;
}
/** From the page: what it shows of a device that waits for an acknowledgement. */
export interface Acknowledgement {
  deviceSessionId: bigint;
  phase: number;
  deviceFaults: bigint;
}

// common/telemetry/telemetry.h
export enum Guard { limp, answered, leased, fallback, fading, fault }
export enum Phase { unknown, closed, connected, calibrated, enabled, faulted, checking }
export enum Mofc { no_physics, free, contact, fading, clutched }
/** What the jaws of the tool do, a needle or a blade: bits kGripShift … + 2 of the flags of mofc_node. */
export enum Grip { none, holds, slips, torn, slipped, pierced, pierces, cuts }
export const kGripShift = 3;
export const kFaultReasons =
  ["none", "the device gave no reading", "a reading was not finite", "the position jumped",
    "the motors did not take their force", "the device gave no answer in time",
    "the device is gone", "an answer of the device was corrupt", "the device has no supply or no calibration",
    "the machine was suspended", "the readings stood still", "the motors push the wrong way",
    "the motors are too strong", "the motors are not seen to push", "the check of the motors was interrupted",
    "an account of the energy is wrong", "measured forces are not those commanded"];

export const kDeviceAnswered = 1;
export const kDevicePeakLimited = 2;
export const kMofcClamped = 1;
export const kMofcInContact = 2;

/** True if every column holds `rows` entries (vectors three times as many). */
export function columns_agree(rows: number, scalars: ArrayLike<unknown>[], vectors: ArrayLike<unknown>[]): boolean {
  return scalars.every((column) => column.length === rows) &&
    vectors.every((column) => column.length === 3 * rows);
}
