// What the service answers; the names are those of its OpenAPI description.

export interface Experiment {
  experiment: string;
  title: string;
  information: string;
  camera: string;
  projector: boolean;
  light: "texture" | "projector";
  calibrated: boolean;
  uncalibrated: string[];
  planned: boolean;
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

export interface Preset {
  preset: string;
  about: string;
}

export interface PlannedPreset {
  preset: string;
  fits: boolean;
  solver_s: number | null;
  memory_mb: number | null;
  temperature_error_k: number | null;
  velocity_error: number | null;
  pressure_error: number | null;
  reason: string;
}

export interface Plan {
  expected: string;
  expected_contrast_k: number;
  expected_departure_k: number;
  views: PlannedView[];
  seen: { modes: number; modes_seen: number; images: number; boundary: number; both: number };
  choices: { name: string; value: boolean | number | string; reason: string }[];
  presets: PlannedPreset[];
  machine: string;
  verdicts: string[];
}

export interface PlannedView {
  name: string;
  light: string;
  window_px: number;
  noise_px: number | null;
  shift_median_px: number;
  shift_p99_px: number;
  signal_to_noise: number;
  picture_signal_to_noise: number;
  smallest_visible_k: number | null;
  frames: number;
  frames_needed: number | null;
  other_light: string;
  other_light_shift_p99_px: number;
  map: { columns_px: number[]; rows_px: number[]; shift_mpx: (number | null)[][] };
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
  low: number;
  high: number;
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

export interface Standing {
  name: string;
  role: "camera" | "projector";
  position_m: number[];
  corners_m: number[][];
}

export interface Board {
  kind: "chessboard" | "charuco" | "circles" | "asymmetric-circles";
  columns: number;
  rows: number;
  square_m: number;
  marker_m: number | null;
  dictionary: string;
}

export interface ExperimentWhole extends Experiment {
  settings: { rig: { board?: Board | null } };
}

export interface Calibration {
  state: "calibrated" | "incomplete";
  date: string | null;
  items: { name: string; state: "measured" | "given" | "missing"; value: string; advice: string }[];
  room_m: number[][];
  rig: Standing[];
}

export interface Wanted {
  kind: "board" | "place" | "wall" | "level" | "dark" | "light";
  text: string;
  column: number | null;
  row: number | null;
  span: number | null;
  nearer: "" | "left" | "right" | "upper" | "lower";
  tilt_deg: number;
  roll_deg: number;
}

export interface Guide {
  state: "idle" | "running" | "failed";
  busy: boolean;
  step: string;
  reason: string;
  wanted: Wanted | null;
  done: number;
  total: number;
  issues: string[];
  complete: boolean;
  views: { name: string; points: number; rms_px: number | null; issues: string[] }[];
  width_px: number | null;
  height_px: number | null;
  coverage: boolean[][];
  covered: number;
  rms_px: number | null;
  residuals_px: number[][];
  advice: string[];
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
