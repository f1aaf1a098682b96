// The service's resources as the page uses them. Errors are the service's own words, shown as they are.

export interface Problem {
  code: string;
  title: string;
  detail: string;
  status: number;
  instance?: string;
}

export class ProblemError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail);
  }
}

export type Query = Record<string, string | number>;

export async function ask<T>(method: string, path: string, body?: unknown): Promise<T> {
  const answer = await reach(method, path, body);
  return (answer.status === 204 ? undefined : await answer.json()) as T;
}

export const get = <T>(path: string, query: Query = {}) => ask<T>("GET", path + queryOf(query));
export const post = <T>(path: string, body: unknown = {}) => ask<T>("POST", path, body);

export interface Numbers {
  values: Float32Array;
  shape: number[];
}

/** Reads scaled 16-bit (or plain 32-bit) numbers into floats. */
export async function numbers(path: string, query: Query = {}): Promise<Numbers> {
  const encoding = query["encoding"] ?? "u16";
  const answer = await reach("GET", path + queryOf({ ...query, encoding }));
  const offset = Number(answer.headers.get("X-Offset"));
  const scale = Number(answer.headers.get("X-Scale"));
  const shape = (answer.headers.get("X-Shape") ?? "").split(",").map(Number);
  const raw = await answer.arrayBuffer();
  if (encoding === "f32") return { values: new Float32Array(raw), shape };
  const packed = new Uint16Array(raw);
  const values = new Float32Array(packed.length);
  for (let i = 0; i < packed.length; i++) values[i] = offset + scale * (packed[i] ?? 0);
  return { values, shape };
}

/** Exchanges the token in the address for a cookie that no script can read, and forgets it. */
export async function openSession(): Promise<void> {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (!token) return;
  history.replaceState(null, "", location.pathname);
  await reach("POST", "/session", undefined, { Authorization: `Bearer ${token}` });
}

async function reach(
  method: string,
  path: string,
  body?: unknown,
  headers: Record<string, string> = {},
): Promise<Response> {
  const sent = body === undefined ? {} : { body: JSON.stringify(body) };
  const type: Record<string, string> = body === undefined ? {} : { "Content-Type": "application/json" };
  let answer: Response;
  try {
    answer = await fetch(`/api${path}`, { method, headers: { ...type, ...headers }, ...sent });
  } catch {
    throw new ProblemError(unreachable());
  }
  if (answer.ok) return answer;
  throw new ProblemError(await problemOf(answer));
}

async function problemOf(answer: Response): Promise<Problem> {
  try {
    return (await answer.json()) as Problem;
  } catch {
    return { ...unreachable(), status: answer.status };
  }
}

function unreachable(): Problem {
  return {
    code: "unreachable",
    title: "The service does not answer",
    detail:
      "The service does not answer. It may be restarting: this page goes on by itself as soon as it is back. " +
      "If it stays away, run `airlens serve` again.",
    status: 0,
  };
}

function queryOf(query: Query): string {
  const pairs = Object.entries(query).map(([name, value]) => [name, String(value)]);
  return pairs.length ? `?${new URLSearchParams(pairs)}` : "";
}
