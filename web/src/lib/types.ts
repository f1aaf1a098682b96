// What the service answers; the names are those of its OpenAPI description.

export interface Experiment {
  experiment: string;
  title: string;
  information: string;
  camera: string;
  projector: boolean;
  light: "texture" | "projector";
  calibrated: boolean;
  captures: number;
  results: number;
  changed: string;
}

export interface Camera {
  state: "closed" | "opening" | "ready" | "capturing" | "failed";
  experiment: string | null;
  name: string | null;
  width_px: number | null;
  height_px: number | null;
  bits: number | null;
  frame_rate_hz: number | null;
  exposure_s: number | null;
  gain: number | null;
  reason: string;
}

export interface Projector {
  state: "closed" | "standby" | "warming" | "on" | "cooling" | "fault" | "silent" | "lost";
  experiment: string | null;
  name: string | null;
  source: string | null;
  muted: boolean | null;
  frozen: boolean | null;
  lamp_hours: number | null;
  lamp_on_s: number | null;
  for_s: number | null;
  errors: string[];
  capabilities: string[];
  reason: string;
}

export interface WireLine {
  at_s: number;
  direction: string;
  text: string;
}

export interface Screen {
  state: "empty" | "waiting" | "showing" | "refused" | "away";
  width_px: number | null;
  height_px: number | null;
  reason: string;
}

export interface Desk {
  state: "idle" | "running" | "finished" | "aborted" | "incomplete" | "failed";
  experiment: string | null;
  capture: string | null;
  role: string | null;
  done: number;
  total: number;
  refused: number;
  level: number;
  reason: string;
}

export interface Verdict {
  name: string;
  good: boolean;
  value: number;
  expected: string;
  advice: string;
}

export interface Capture {
  capture: string;
  state: "finished" | "incomplete" | "interrupted";
  role: string | null;
  created: string | null;
  frames: number | null;
  width_px: number | null;
  height_px: number | null;
  verdicts: Verdict[];
  settings: { name: string; asked: number | null; granted: number }[];
  notes: string;
}

export type JobState =
  "queued" | "running" | "pausing" | "cancelling" | "paused" | "lost" | "done" | "failed" | "cancelled";

export interface Job {
  job: string;
  kind: string;
  experiment: string | null;
  title: string;
  settings: Record<string, unknown>;
  state: JobState;
  attempt: number;
  step: number;
  steps: number;
  progress: number;
  reason: string;
  submitted_s: number;
  started_s: number | null;
  finished_s: number | null;
}

export interface Curves {
  step: number[];
  values: Record<string, (number | null)[]>;
}

export interface ResultLine {
  result: string;
  state: string;
  created: string | null;
  preset: string | null;
  outcome: string | null;
}

export interface Field {
  name: string;
  unit: string;
  label: string;
  kind: "found" | "uncertainty" | "truth" | "error";
  minimum: number;
  maximum: number;
  mean: number;
}

export interface Result {
  result: string;
  x_m: number[];
  y_m: number[];
  z_m: number[];
  fields: Field[];
  outcome: string;
  advice: string;
  solver_s: number;
  notes: string[];
  manifest: Record<string, unknown>;
}

export interface Comparison {
  scores: { name: string; value: number; unit: string }[];
  readings: { name: string; unit: string; position_m: number[]; measured: number; std: number; found: number }[];
}

export interface LiveNumbers {
  number: number;
  timestamp_s: number;
  rows: number;
  cols: number;
  mean: number;
  saturated: number;
  dark: number;
  sharpness_nd: number;
  histogram: number[];
}

export interface ServiceEvent {
  id: number;
  job: string | null;
  kind: string;
  at_s: number;
  body: Record<string, unknown>;
}
