// Answers about a rig and its room while they are typed: every change can be undone, is kept in the browser until
// the experiment is made, and is checked by the service.
import { ask, ProblemError, type Problem } from "./api";
import { bench } from "./bench.svelte";
import type { CheckResource } from "./schema";

export type Path = (string | number)[];
export type Tree = Record<string, unknown>;
export const KINDS = [
  "supply",
  "outlet",
  "surface",
  "wall",
  "object",
  "thermometer",
  "anemometer",
  "view",
  "light",
] as const;
export type Kind = (typeof KINDS)[number];

const KEPT = "answers";
const BRINGS = "pictures are brought";
const REST_MS = 250;
const LENGTHS: Record<string, number> = { m: 1, cm: 0.01, mm: 0.001, ft: 0.3048, in: 0.0254 };

/** The metres of "45 cm"; null where it is no length. */
export function metres(text: unknown): number | null {
  const found = /^\s*([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(\w+)\s*$/i.exec(String(text));
  const [value, factor] = [Number(found?.[1]), LENGTHS[found?.[2] ?? ""]];
  return factor === undefined || !Number.isFinite(value) ? null : value * factor;
}

export const written = (value_m: number) => `${Number(value_m.toFixed(3))} m`;

/** `supply[0].flow` */
export const fieldName = (path: Path) =>
  path
    .map((part) => (typeof part === "number" ? `[${part}]` : `.${part}`))
    .join("")
    .replace(/^\./, "");

function at(tree: unknown, path: Path): unknown {
  return path.reduce<unknown>((inner, part) => (inner as Tree | undefined)?.[part], tree);
}

class Draft {
  answers = $state.raw<Tree>({});
  check = $state.raw<CheckResource | null>(null);
  /** The answers that `check` is about. */
  private checked = $state.raw<Tree | null>(null);
  /** Why they could not be checked. */
  private refusal: Problem | null = null;
  /** The experiment whose room is edited; null for a new one. */
  experiment = $state<string | null>(null);
  revision = $state("");
  /** Why the experiment's room cannot be edited here; empty where it can. */
  refused = $state("");
  /** What the experiment's scene holds and no answer says; a change leaves it as it is. */
  unsaid = $state.raw<string[]>([]);
  past = $state.raw<Tree[]>([]);
  future = $state.raw<Tree[]>([]);
  private last = "";
  private timer: ReturnType<typeof setTimeout> | undefined;
  private asked = 0;

  /** What the answers make, as they are now; null while that is not known. */
  told = $derived(this.checked === this.answers ? (this.check?.told ?? null) : null);
  mistakes = $derived(new Map((this.check?.mistakes ?? []).map((one) => [one.field, one.sentence])));

  value(path: Path): unknown {
    return at(this.answers, path);
  }

  items(kind: Kind): Tree[] {
    const found = this.answers[kind];
    return Array.isArray(found) ? (found as Tree[]) : [];
  }

  /** Opens what was typed before, or the answers of an experiment. */
  async open(experiment: string | null): Promise<void> {
    [this.past, this.future, this.last] = [[], [], ""];
    [this.answers, this.check, this.experiment, this.refused] = [{}, null, experiment, ""];
    this.unsaid = [];
    // An answer to a question of before, about another experiment, is not waited for.
    clearTimeout(this.timer);
    const number = ++this.asked;
    // Whether another room was opened meanwhile: then this one's answers are not shown.
    const isLate = () => number !== this.asked;
    if (experiment) {
      try {
        const found = await ask("GET /experiments/{experiment}/answers", { experiment });
        if (isLate()) return;
        [this.answers, this.unsaid, this.revision] = [found.answers, found.unsaid, found.revision];
        if (bench.adding) this.add("object", bench.adding);
      } catch (error) {
        if (isLate()) return;
        if (!(error instanceof ProblemError) || error.problem.code !== "bad_input") throw error;
        this.refused = error.problem.cause ?? error.problem.detail;
        return;
      } finally {
        if (!isLate()) bench.adding = null;
      }
    } else {
      this.answers = JSON.parse(localStorage.getItem(KEPT) ?? "{}") as Tree;
      bench.importing ||= localStorage.getItem(BRINGS) !== null;
    }
    this.later();
  }

  /** Sets one field; undefined removes it, and empties one of several coordinates, so that the others keep their
      places. Typing in one field is undone at once. */
  set(path: Path, value: unknown): void {
    const next = JSON.parse(JSON.stringify(this.answers)) as Tree;
    const parent = at(next, path.slice(0, -1)) as Tree | undefined;
    const key = path.at(-1);
    if (!parent || key === undefined) return;
    if (value !== undefined) parent[key] = value;
    else if (Array.isArray(parent)) parent[Number(key)] = "";
    else delete parent[key];
    this.put(next, fieldName(path));
  }

  /** Removes the thing at `index` of its kind; those behind it move up. */
  remove(kind: Kind, index: number): void {
    this.put({ ...this.answers, [kind]: this.items(kind).filter((_, number) => number !== index) });
  }

  add(kind: Kind, item: Tree): void {
    this.put({ ...this.answers, [kind]: [...this.items(kind), item] }, "");
  }

  /** Replaces all answers; `name` joins changes of one field. */
  put(next: Tree, name = ""): void {
    // An empty list says nothing.
    next = Object.fromEntries(Object.entries(next).filter(([, one]) => !(Array.isArray(one) && !one.length)));
    if (!name || name !== this.last) this.past = [...this.past.slice(-199), this.answers];
    [this.answers, this.future, this.last] = [next, [], name];
    this.later();
  }

  undo(): void {
    const before = this.past.at(-1);
    if (!before) return;
    [this.future, this.past] = [[...this.future, this.answers], this.past.slice(0, -1)];
    [this.answers, this.last] = [before, ""];
    this.later();
  }

  redo(): void {
    const after = this.future.at(-1);
    if (!after) return;
    [this.past, this.future] = [[...this.past, this.answers], this.future.slice(0, -1)];
    [this.answers, this.last] = [after, ""];
    this.later();
  }

  /** Checks the answers once typing rests. */
  later(): void {
    if (!this.experiment) {
      localStorage.setItem(KEPT, JSON.stringify(this.answers));
      if (bench.importing) localStorage.setItem(BRINGS, "yes");
      else localStorage.removeItem(BRINGS);
    }
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.ask(), REST_MS);
  }

  private async ask(): Promise<void> {
    const [number, answers] = [++this.asked, this.answers];
    try {
      const found = await ask("POST /answers/check", {}, { answers, experiment: this.experiment });
      // Only the newest question's answer counts.
      if (number !== this.asked) return;
      if (this.refusal && bench.problem === this.refusal) bench.problem = null;
      [this.check, this.checked, this.refusal] = [found, answers, null];
    } catch (error) {
      if (!(error instanceof ProblemError)) throw error;
      if (number !== this.asked) return;
      // What was checked before is not what is typed now.
      this.check = null;
      bench.problem = this.refusal = error.problem;
      if (error.problem.code === "unreachable") bench.missed();
    }
  }

  /** Makes the experiment, or changes it, and goes on to its rig or to the import of its pictures. */
  async send(): Promise<void> {
    if (this.experiment) {
      const there = { experiment: this.experiment };
      const send = async (revision: string | null) => {
        const body = { answers: this.answers };
        const made = await ask("PUT /experiments/{experiment}/answers", there, body, revision);
        this.revision = made.revision;
        bench.page = bench.result ? "Look" : "Rig";
      };
      // Who leaves it as somebody else made it goes on from there.
      await bench.change("Changing the room", this.revision, send, () => this.open(there.experiment));
    } else {
      const made = await ask("POST /experiments/from-answers", {}, { answers: this.answers });
      localStorage.removeItem(KEPT);
      localStorage.removeItem(BRINGS);
      // Pictures that were taken elsewhere have no camera to connect.
      [bench.experiment, bench.page] = [made.experiment, bench.importing ? "Capture" : "Rig"];
      await bench.refresh();
      if (!bench.importing) await bench.connect();
    }
    await bench.refresh();
  }
}

export const draft = new Draft();
