// Follows work of the service that somebody steps through: told by events; asked as well, for the count.
import { ProblemError, type Problem } from "./api";
import { bench } from "./bench.svelte";

const AGAIN_MS = 1500;

interface Work<T> {
  /** What is asked about; empty while there is nothing to ask. */
  topic: () => string;
  ask: () => Promise<T>;
  show: (found: T) => void;
  /** Whether it cannot go on by itself. */
  ends: (found: T) => boolean;
  /** Takes the next step. */
  take: () => unknown;
  refused: (problem: Problem) => void;
}

/** One look at a time, and none that was begun before the last action ended or about another topic is heeded: it would
    still find the work idle, go on by itself, and be refused. */
export class Following<T extends { busy: boolean }> {
  /** Whether it goes on by itself. */
  alone = $state(false);
  private looking = false;
  private actions = 0;
  private again = false;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly work: Work<T>) {}

  async read(): Promise<void> {
    const asked = this.work.topic();
    if (!asked) return;
    if (this.looking) {
      this.again = true;
      return;
    }
    const before = this.actions;
    this.looking = true;
    try {
      const found = await this.work.ask();
      if (asked === this.work.topic() && before === this.actions) this.heed(found);
      else this.again = true;
    } catch (error) {
      if (!(error instanceof ProblemError)) throw error;
      this.alone = false;
      this.work.refused(error.problem);
    } finally {
      this.looking = false;
      if (this.again) {
        this.again = false;
        void this.read();
      }
    }
  }

  /** Does what was asked for, and shows its answer. */
  async told(what: string, action: () => Promise<T>): Promise<void> {
    const found = await bench.attempt(what, action);
    this.actions++;
    if (found) this.heed(found);
    else this.alone = false;
  }

  /** Looks no more by itself. */
  rest(): void {
    clearTimeout(this.timer);
  }

  private heed(found: T): void {
    this.work.show(found);
    if (this.work.ends(found)) this.alone = false;
    this.rest();
    if (found.busy) this.timer = setTimeout(() => void this.read(), AGAIN_MS);
    else if (this.alone && bench.working === null) void this.work.take();
  }
}
