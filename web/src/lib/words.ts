// Names of fields, curves, results and times as people say them.
import type { FieldResource, PresetLine, ResultLine } from "./schema";

const CURVES: Record<string, string> = {
  loss: "misfit",
  loss_after: "misfit after the step",
  change: "change in one iteration",
  inlet_log_flow: "flow of supply",
  inlet_temperature_k: "temperature of supply [K]",
  heater_power_w: "power of heater [W]",
  learning_rate: "step size",
  share: "share done",
  draw: "samples drawn",
  moved: "parameters moved",
  of: "parameters to move",
  model_s: "time in the room [s]",
  residual: "imbalance",
  seconds: "time [s]",
  memory_bytes: "memory [bytes]",
};
const UNITS: Record<string, string> = { k: "K", s: "s", px: "px", w: "W", m: "m", pa: "Pa", nd: "1", rad: "rad" };

/** `inlet_log_flow[0]` -> "flow of supply 1"; a name that is not known is spelled out, its unit last. */
export function curveName(name: string): string {
  const [, stem = name, index] = /^(.*?)(?:\[(\d+)\])?$/.exec(name) ?? [];
  const number = index === undefined ? "" : ` ${Number(index) + 1}`;
  const known = CURVES[stem];
  if (known) return known.replace(/( \[.*\])?$/, `${number}$1`);
  const parts = stem.split("_");
  const unit = parts.length > 1 ? UNITS[parts.at(-1) ?? ""] : undefined;
  const words = (unit ? parts.slice(0, -1) : parts).join(" ").replace(/\blog\b/, "logarithm of");
  return `${words}${number}${unit ? ` [${unit}]` : ""}`;
}

/** "standard, 19:39:05"; with its day where that is not today, and its uncertainty where that was read. */
export function resultName(one: ResultLine, spread_k?: number): string {
  const made = one.created ? new Date(one.created) : null;
  const today = made?.toDateString() === new Date().toDateString();
  const time = made ? `${momentOf(one.created).slice(today ? 11 : 0)}:${two(made.getSeconds())}` : "";
  const spread = spread_k === undefined ? "" : `± ${spread_k.toPrecision(2)} K`;
  return [one.preset ?? "result", time, spread].filter(Boolean).join(", ");
}

const two = (part: number) => String(part).padStart(2, "0");

/** "2026-11-23 14:05", in the reader's own time; nothing for no time. */
export function momentOf(created: string | null | undefined): string {
  const made = created ? new Date(created) : null;
  if (!made || Number.isNaN(made.getTime())) return "";
  const day = `${made.getFullYear()}-${two(made.getMonth() + 1)}-${two(made.getDate())}`;
  return `${day} ${two(made.getHours())}:${two(made.getMinutes())}`;
}

const FIELDS: Record<string, string> = {
  T: "temperature",
  p: "pressure",
  u: "velocity along x",
  v: "velocity along y",
  w: "velocity upwards",
  speed: "speed",
  draught_rate: "people bothered by draught",
  pmv: "warmth vote (PMV)",
  ppd: "people dissatisfied (PPD)",
  age: "age of the air",
  informed: "share known from measurement",
  T_burst: "temperature of a moment",
  T_departure: "departure of a moment from the mean",
  T_rms: "fluctuation of the temperature",
};
const PARTS: Record<string, (name: string) => string> = {
  std: (name) => `${name}: standard deviation`,
  truth: (name) => `true ${name}`,
  error: (name) => `${name}: found minus true`,
  low: (name) => `${name}: lower end, 95 %`,
  high: (name) => `${name}: upper end, 95 %`,
};

/** `T_truth` -> "True temperature"; a name that is not known stays. */
export function fieldName(name: string): string {
  const [, stem = name, part] = /^(.*?)(?:\.\d+)?(?:_(std|truth|error|low|high))?$/.exec(name) ?? [];
  const words = FIELDS[stem] ?? stem;
  const told = part ? PARTS[part]!(words) : words;
  return told.charAt(0).toUpperCase() + told.slice(1);
}

const KNOWN: Record<string, string> = {
  surveyed: "surveyed: the openings, and each wall's temperature or that it is insulated",
  operator: "operator: the openings; nothing of the walls",
  paper: "paper: temperature, pressure and velocity on one plane",
};

/** What a level of information means. */
export const informationWords = (level: string) => KNOWN[level] ?? (level || "nothing noted");

const SETTINGS: Record<string, string> = {
  "scene.solve.grid": "cells of the solver's grid",
  "solve.cells": "cells along the room",
  "scene.solve.window_px": "window [px]",
  "scene.solve.data_term": "what is compared with the images",
  created: "made at",
  preset: "preset",
  solver_s: "solver's time [s]",
  wall_s: "whole time [s]",
  "captures.reference": "reference capture",
  "captures.flow": "flow capture",
};

/** `settings.scene.air.pressure_pa` -> "air: pressure [Pa]". */
export function settingName(path: string): string {
  const inner = path.replace(/^settings\./, "");
  const known = SETTINGS[inner];
  if (known) return known;
  const parts = inner.replace(/^scene\./, "").split(".");
  return parts.map((part) => (/^\d+$/.test(part) ? `${Number(part) + 1}` : curveName(part))).join(": ");
}

const ZERO_C_K = 273.15;

/** A value of a field with its unit; temperatures of the air in °C where that is asked for. */
export function reading(field: Pick<FieldResource, "name" | "unit">, value: number, celsius: boolean): string {
  if (celsius && isAbsolute(field)) return `${(value - ZERO_C_K).toFixed(2)} °C`;
  return `${value.toFixed(3)} ${unitOf(field, false)}`.trim();
}

/** True for temperatures of the air; differences and deviations are in kelvin whatever the scale. */
export const isAbsolute = (field: Pick<FieldResource, "name">) => /^T(_truth|_burst(\.\d+)?)?$/.test(field.name);

export function unitOf(field: Pick<FieldResource, "name" | "unit">, celsius: boolean): string {
  if (celsius && isAbsolute(field)) return "°C";
  return { "m s-1": "m/s", "m2 s-2": "m²/s²", "1": "" }[field.unit] ?? field.unit;
}

/** A value for a colour bar or an axis: three or four figures. */
export function short(value: number, celsius = false): string {
  const shown = celsius ? value - ZERO_C_K : value;
  if (shown === 0) return "0";
  const size = Math.abs(shown);
  return size >= 100 ? shown.toFixed(1) : size >= 0.001 ? String(Number(shown.toPrecision(3))) : shown.toExponential(1);
}

/** "12 s", "4 min", "1.5 h". */
export function duration(seconds: number): string {
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return seconds < 172_800 ? `${(seconds / 3600).toFixed(1)} h` : `${Math.round(seconds / 86_400)} days`;
}

/** The whole time that a preset is promised to take, and that it compiles where it does; empty where not known. */
export function expectedTime(one: PresetLine): string {
  if (one.wall_s === null || one.wall_s === undefined) return "";
  return `${duration(one.wall_s)}${one.compiled ? "" : " with compiling"}`;
}
