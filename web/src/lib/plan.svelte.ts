// The plan of the experiment in use: read when there is one, made by a job of its own.
import { ask, ProblemError } from "./api";
import { bench } from "./bench.svelte";
import type { Plan, PresetLine } from "./schema";

class Planned {
  plan = $state.raw<Plan | null>(null);
  job = $derived(bench.jobs.find((one) => one.kind === "plan" && one.experiment === bench.experiment) ?? null);
  busy = $derived(this.job !== null && ["queued", "running", "lost"].includes(this.job.state));

  async read(experiment: string | null): Promise<void> {
    if (!experiment || !bench.current?.planned) {
      this.plan = null;
      return;
    }
    try {
      const found = await ask("GET /experiments/{experiment}/plan", { experiment });
      if (experiment === bench.experiment) this.plan = found;
    } catch (error) {
      if (!(error instanceof ProblemError)) throw error;
      bench.problem = error.problem;
    }
  }

  async make(excess_k: number | null): Promise<void> {
    await ask(
      "POST /jobs",
      {},
      {
        kind: "plan",
        experiment: bench.here,
        title: `Plan: ${bench.current?.title ?? bench.experiment}`,
        settings: excess_k === null ? {} : { excess_k },
        key: crypto.randomUUID(),
      },
    );
    bench.jobs = await ask("GET /jobs", {});
  }

  preset(name: string): PresetLine | null {
    return this.plan?.presets.find((one) => one.preset === name) ?? null;
  }
}

export const planned = new Planned();
