// The service's resources. A request is written as in its description, "GET /jobs/{job}", and the types of
// what it takes and answers follow from that. Errors are the service's own words, shown as they are.
import type { paths, ProblemDetails as Told } from "./schema";

/** What the page needs of a refusal; what lies beyond the service has no more. */
export type Problem = Pick<Told, "code" | "title" | "detail" | "status"> & {
  /** What happened, without what to do next. */
  cause?: string;
  /** Where somebody else changed it meanwhile: how it stands, and what was sent. */
  current?: Record<string, unknown> | null;
  sent?: Record<string, unknown> | null;
};

export class ProblemError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail);
  }
}

type Verb = "get" | "post" | "put" | "patch" | "delete";
type Named<P> = P extends `/api${infer Rest}` ? Rest : never;
type Offered<P extends keyof paths> = {
  [V in Verb]: paths[P] extends { [K in V]: { responses: unknown } } ? `${Uppercase<V>} ${Named<P>}` : never;
}[Verb];

/** Every request that the service describes. */
export type Request = { [P in keyof paths]: Offered<P> }[keyof paths];

type Operation<R extends Request> = R extends `${infer V} ${infer P}`
  ? `/api${P}` extends keyof paths
    ? Lowercase<V> extends keyof paths[`/api${P}`]
      ? paths[`/api${P}`][Lowercase<V>]
      : never
    : never
  : never;
type Parameters<O> = O extends { parameters: infer Q } ? Q : never;
type InPath<O> = Parameters<O> extends { path: infer Q } ? Q : unknown;
type InQuery<O> = Parameters<O> extends { query: infer Q } | { query?: infer Q } ? Some<NonNullable<Q>> : unknown;
type Some<Q> = [Q] extends [never] ? unknown : Partial<Q>;
type Good<O> = O extends { responses: infer A } ? A[Extract<keyof A, 200 | 201 | 202>] : never;

/** What a request names: the parts of its path and of its query. */
export type Given<R extends Request> = InPath<Operation<R>> & InQuery<Operation<R>>;
/** What a request sends. */
export type Body<R extends Request> =
  Operation<R> extends { requestBody?: { content: { "application/json": infer B } } } ? B : undefined;
/** What the service answers. */
export type Answer<R extends Request> = Content<Good<Operation<R>>>;
type Content<A> = [A] extends [never] ? undefined : A extends { content: { "application/json": infer T } } ? T : never;

/** Sends a request and returns its answer; a change may name the revision it is made to. Throws a ProblemError. */
export async function ask<R extends Request>(
  request: R,
  given: Given<R>,
  body?: Body<R>,
  revision?: string | null,
): Promise<Answer<R>> {
  const headers: Record<string, string> = revision ? { "If-Match": `"${revision}"` } : {};
  const answer = await reach(verbOf(request), address(request, given), body, headers);
  return (answer.status === 204 ? undefined : await answer.json()) as Answer<R>;
}

/** The address of a request, for a picture, a stream or a file. */
export function address<R extends Request>(request: R, given: Given<R>): string {
  const left = new Map(Object.entries(given as Record<string, string | number | null | undefined>));
  const path = request.replace(/^\w+ /, "").replace(/\{(\w+)\}/g, (_, name: string) => {
    const value = left.get(name);
    left.delete(name);
    return encodeURIComponent(String(value));
  });
  const query = [...left].flatMap(([name, value]) =>
    value === undefined || value === null ? [] : [[name, String(value)]],
  );
  return `/api${path}${query.length ? `?${new URLSearchParams(query)}` : ""}`;
}

export interface Numbers {
  values: Float32Array;
  shape: number[];
}

/** Reads scaled 16-bit (or plain 32-bit) numbers into floats; NaN where there is no air. */
export async function numbers<R extends Request>(request: R, given: Given<R>): Promise<Numbers> {
  const answer = await reach("GET", address(request, given));
  const offset = Number(answer.headers.get("X-Offset"));
  const scale = Number(answer.headers.get("X-Scale"));
  const shape = (answer.headers.get("X-Shape") ?? "").split(",").map(Number);
  const raw = await answer.arrayBuffer();
  if (raw.byteLength === 4 * shape.reduce((n, m) => n * m, 1)) return { values: new Float32Array(raw), shape };
  const packed = new Uint16Array(raw);
  const missing = Number(answer.headers.get("X-Missing") ?? NaN);
  const values = new Float32Array(packed.length);
  for (let i = 0; i < packed.length; i++) {
    const number = packed[i] ?? 0;
    values[i] = number === missing ? NaN : offset + scale * number;
  }
  return { values, shape };
}

/** Reads a file that the service makes. */
export async function file<R extends Request>(request: R, given: Given<R>): Promise<Response> {
  return reach("GET", address(request, given));
}

/** Sends a file to be kept, whose id later requests name. */
export async function upload(content: File): Promise<Answer<"POST /uploads">> {
  const answer = await reach("POST", address("POST /uploads", { name: content.name }), content);
  return (await answer.json()) as Answer<"POST /uploads">;
}

/** Exchanges the token in the address for a cookie that no script can read, and forgets it. */
export async function openSession(): Promise<void> {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (!token) return;
  history.replaceState(null, "", location.pathname);
  await reach("POST", address("POST /session", {}), undefined, { Authorization: `Bearer ${token}` });
}

const verbOf = (request: string) => request.slice(0, request.indexOf(" "));

async function reach(
  method: string,
  path: string,
  body?: unknown,
  headers: Record<string, string> = {},
): Promise<Response> {
  const isFile = body instanceof Blob;
  const sent = body === undefined ? {} : { body: isFile ? body : JSON.stringify(body) };
  const kind = isFile ? "application/octet-stream" : "application/json";
  const type: Record<string, string> = body === undefined ? {} : { "Content-Type": kind };
  let answer: Response;
  try {
    answer = await fetch(path, { method, headers: { ...type, ...headers }, ...sent });
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
