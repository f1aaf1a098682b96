// What the page knows of the service, kept fresh by one stream of events. Nothing here is the only copy:
// closing the tab loses nothing.
import { address, ask, file, openSession, ProblemError, type Given, type Problem } from "./api";
import { untrack } from "svelte";
import type {
  CameraResource,
  CaptureResource,
  DeskResource,
  EventResource,
  ExperimentLine,
  JobResource,
  NewCapture,
  ProjectorResource,
  ResultLine,
} from "./schema";

export const PAGES = ["Rig", "Calibrate", "Plan", "Capture", "Reconstruct", "Look"] as const;
/** Reached from Rig: answers for a new experiment, and those of the one that is open. */
const ASIDE = ["New", "Room"] as const;
export type Page = (typeof PAGES)[number] | (typeof ASIDE)[number];

// So many pixels across see the packaged room's 9.7 K in single windows; 384 would take 7400 frames.
const SIMULATED_PX = 1536;
// So many letters has the title of a job at most.
const LONGEST = 200;
// Fewer do not tell how they differ.
export const LEAST_BURSTS = 3;
const ACTIVE = ["queued", "running", "pausing", "cancelling", "lost"];

export type Action = Given<"POST /jobs/{job}/{action}">["action"];
export type Format = Given<"GET /experiments/{experiment}/results/{result}/exports/{form}">["form"];

export interface Step {
  label: string;
  page: Page;
  busy: boolean;
  act: () => Promise<unknown>;
}

/** A part of an address; what is no address of this page stays as it is written. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** What is said of an address whose experiment is not there. */
const missing = (experiment: string): Problem => ({
  code: "not_found",
  title: "Not found",
  detail: `There is no experiment ${experiment}. Another one is shown; choose one above.`,
  status: 404,
});

class Bench {
  page = $state<Page>("Rig");
  connected = $state(false);
  /** How often the service came back: what could not be read while it was away is read again. */
  returns = $state(0);
  experiments = $state.raw<ExperimentLine[]>([]);
  experiment = $state<string | null>(null);
  /** The cameras by their view's number; `camera` is the first view's. */
  cameras = $state.raw<CameraResource[]>([]);
  /** The projectors by the number of the first view that sees by each. */
  projectors = $state.raw<ProjectorResource[]>([]);
  desk = $state.raw<DeskResource | null>(null);
  captures = $state.raw<CaptureResource[]>([]);
  jobs = $state.raw<JobResource[]>([]);
  results = $state.raw<ResultLine[]>([]);
  result = $state<string | null>(null);
  /** How the room is looked at, as an address brought it. */
  view = "";
  problem = $state.raw<Problem | null>(null);
  working = $state<string | null>(null);
  /** True once the first answers are there: from then on the address follows the page. */
  opened = $state(false);
  /** How the next reconstruction is solved. */
  preset = $state("auto");
  /** Whether each burst of a sequence is solved for as well. */
  everyBurst = $state(true);
  /** What the next capture takes: frames of a picture, bursts of a flow and the time from one to the next, and whether
      T of each is shown as it comes. */
  wanted = $state({ frames: 100, bursts: 1, every_s: 6, live: false });
  /** Whether several cameras take their pictures at the same time. */
  atOnce = $state(false);
  /** What each running job says that it does. */
  stages = $state.raw<Record<string, string>>({});
  /** When a job will end, as it told last: seconds since 1970; null where it does not know. */
  ends = $state.raw<Record<string, number | null>>({});
  done = $state("");
  /** Grows with everything that is told of a guided calibration. */
  guided = $state(0);
  /** Grows with everything that is told of T of the bursts. */
  looked = $state(0);

  /** Whether the new experiment is for pictures that another camera took. */
  importing = $state(false);

  /** What was found in a result and goes to the room's editor, as an answer. */
  adding: Record<string, unknown> | null = null;

  /** The next step of a page that has its own. */
  offered = $state.raw<Step | null>(null);

  private stream: EventSource | null = null;
  private pending = new Set<string>();
  /** Waits to read again what a lost request did not. */
  private soon: ReturnType<typeof setTimeout> | undefined;
  /** The operator has chosen a page: the first answers no longer choose one. */
  private turned = false;
  private again: (() => Promise<unknown>) | null = null;
  private leave: (() => Promise<unknown>) | null = null;

  /** The experiment that actions are about. */
  get here(): string {
    return this.experiment ?? "";
  }

  current = $derived(this.experiments.find((one) => one.experiment === this.experiment) ?? null);
  /** What lights the walls from projectors, by the number of the first view that sees by each. */
  lamps = $derived(
    [...(this.current?.views ?? []).entries()].filter(
      ([number, one]) => one.lamp === number && one.light === "projector",
    ),
  );
  active = $derived(this.jobs.filter((job) => ACTIVE.includes(job.state)));
  camera = $derived(this.cameras.find((one) => one.view === 0) ?? null);
  /** The camera and the projectors, where they are connected for this experiment. */
  ownCamera = $derived(this.camera?.experiment === this.experiment ? this.camera : null);
  ownProjectors = $derived(
    this.projectors.filter((one) => one.state !== "closed" && one.experiment === this.experiment),
  );
  ownDesk = $derived(this.desk?.experiment === this.experiment ? this.desk : null);
  finished = $derived(this.captures.filter((one) => one.state === "finished"));
  /** How many bursts the newest flow is of. */
  bursts = $derived.by(() => {
    const flows = this.finished.filter((one) => one.role === "flow");
    const newest = flows.reduce<CaptureResource | null>((a, b) => (a && a.capture > b.capture ? a : b), null);
    return newest?.sequence ? flows.filter((one) => one.sequence === newest.sequence).length : 1;
  });
  next = $derived.by(() => this.nextStep());

  async start(): Promise<void> {
    await this.attempt("Opening", async () => {
      await openSession();
      const named = this.read(location.hash);
      const asked = this.experiment;
      await this.refresh();
      if (asked && asked !== this.experiment) this.problem = missing(asked);
      if (!named && !this.turned && this.result) this.page = "Look";
      this.listen();
      this.opened = true;
    });
    if (!this.stream) setTimeout(() => void this.start(), 2000);
  }

  /** Runs an action; what goes wrong is shown in the service's own words until it is dismissed, or until
      an action that began after it succeeds. An effect that calls this does not run again when another problem is
      shown: a request that fails would be sent without end. */
  async attempt<T>(what: string, action: () => Promise<T>): Promise<T | undefined> {
    const before = untrack(() => this.problem);
    this.working = what;
    try {
      const outcome = await action();
      if (this.problem === before) this.problem = null;
      return outcome;
    } catch (error) {
      if (!(error instanceof ProblemError)) throw error;
      this.problem = error.problem;
      if (error.problem.code === "unreachable") this.missed();
      return undefined;
    } finally {
      this.working = null;
    }
  }

  /** Makes a change to what was read at `revision`. Where somebody else's came before, `settle` ends it; `leave`
      reads anew what is there. */
  async change<T>(
    what: string,
    revision: string,
    send: (revision: string | null) => Promise<T>,
    leave: (() => Promise<unknown>) | null = null,
  ): Promise<void> {
    await this.attempt(what, async () => {
      try {
        await send(revision);
      } catch (error) {
        if (error instanceof ProblemError && error.problem.code === "changed")
          [this.again, this.leave] = [() => send(null), leave];
        throw error;
      }
    });
  }

  /** Sends the refused change again, to whatever is there, or leaves what is there. */
  async settle(again: boolean): Promise<void> {
    const settled = again ? this.again : this.leave;
    [this.again, this.leave, this.problem] = [null, null, null];
    await this.attempt("Settling", async () => {
      await settled?.();
      await this.refresh();
    });
  }

  async refresh(): Promise<void> {
    [this.experiments, , this.desk, this.jobs] = await Promise.all([
      ask("GET /experiments", {}),
      this.refreshDevices(),
      ask("GET /captures/running", {}),
      ask("GET /jobs", {}),
    ]);
    const known = this.experiments.some((one) => one.experiment === this.experiment);
    if (!known) this.experiment = this.camera?.experiment ?? this.experiments[0]?.experiment ?? null;
    await this.refreshExperiment();
  }

  async refreshDevices(): Promise<void> {
    const devices = await ask("GET /devices", {});
    this.cameras = devices.filter((one): one is CameraResource => one.device === "camera");
    this.projectors = devices.filter((one): one is ProjectorResource => one.device === "projector");
  }

  async refreshExperiment(): Promise<void> {
    if (!this.experiment) return;
    const here = { experiment: this.experiment };
    const [captures, results, experiments] = await Promise.all([
      ask("GET /experiments/{experiment}/captures", here),
      ask("GET /experiments/{experiment}/results", here),
      ask("GET /experiments", {}),
    ]);
    // An answer about an experiment that is no longer open is not shown.
    if (here.experiment !== this.experiment) return;
    [this.captures, this.results, this.experiments] = [captures, results, experiments];
    const finished = this.results.filter((one) => one.state === "finished");
    if (!finished.some((one) => one.result === this.result)) this.result = finished[0]?.result ?? null;
  }

  /** Where the page is, as the part of its address after the #: page, experiment, and on Look the result. */
  get place(): string {
    const parts = [this.page.toLowerCase(), this.experiment, this.page === "Look" ? this.result : null];
    return `#/${parts.flatMap((part) => (part ? [encodeURIComponent(part)] : [])).join("/")}`;
  }

  /** Turns to a page, as the operator asked. */
  turn(page: Page): void {
    [this.turned, this.page] = [true, page];
  }

  /** Goes to an address that `place` gave. */
  async go(hash: string): Promise<void> {
    const before = this.experiment;
    this.read(hash);
    if (!this.experiment || this.experiment === before) return;
    if (this.experiments.some((one) => one.experiment === this.experiment))
      return this.choose(this.experiment, this.result);
    [this.problem, this.experiment, this.result] = [missing(this.experiment), before, null];
    await this.attempt("Opening", () => this.refreshExperiment());
  }

  /** Whether the address names a page. */
  private read(hash: string): boolean {
    const [page, experiment, result, view] = hash.replace(/^#\/?/, "").split("/").map(decoded);
    const found = [...PAGES, ...ASIDE].find((one) => one.toLowerCase() === page);
    if (!found) return false;
    this.page = found;
    // A result is one experiment's.
    if (result || (experiment && experiment !== this.experiment)) this.result = result || null;
    if (experiment) this.experiment = experiment;
    if (view) this.view = view;
    return true;
  }

  async choose(experiment: string, result: string | null = null): Promise<void> {
    // What was found in a result belongs to the room of its experiment.
    if (experiment !== this.experiment) this.adding = null;
    this.experiment = experiment;
    [this.captures, this.results, this.result] = [[], [], result];
    await this.attempt("Opening", () => this.refreshExperiment());
  }

  // Actions: each is one request of the API.

  async createSimulated(light: "texture" | "projector" = "texture"): Promise<void> {
    const title = light === "texture" ? "Simulated room" : "Simulated room, projected light";
    const made = await ask("POST /experiments", {}, { kind: "simulated", title, light, camera_px: SIMULATED_PX });
    this.experiment = made.experiment;
    await this.connect();
    await this.refresh();
  }

  /** Puts what is known of a view's camera in its place. */
  put(camera: CameraResource): void {
    this.cameras = [...this.cameras.filter((one) => one.view !== camera.view), camera];
  }

  /** Connects the cameras of all views, in turn; what is wrong with a further one is told at its picture. */
  async connect(): Promise<void> {
    await this.connectView(0);
    for (const view of new Set(this.current?.views.map((one) => one.camera).filter((one) => one > 0) ?? [])) {
      try {
        await this.connectView(view);
      } catch (error) {
        if (!(error instanceof ProblemError)) throw error;
        await this.refreshDevices();
      }
    }
  }

  async connectView(view: number): Promise<void> {
    this.put(await ask("POST /devices/camera/connect", {}, { experiment: this.here, view }));
  }

  /** The camera of a view of this experiment, and whether it shows something. */
  cameraOf(view: number): CameraResource | null {
    return this.cameras.find((one) => one.view === view && one.experiment === this.experiment) ?? null;
  }

  isOpen(view: number): boolean {
    return ["ready", "capturing"].includes(this.cameraOf(view)?.state ?? "");
  }

  /** The operator's word that the experiment may open the devices that were just shown. */
  async confirmAddresses(): Promise<void> {
    const addresses = (this.problem?.current?.["addresses"] ?? []) as string[];
    await this.attempt("Confirming", async () => {
      await ask("PUT /experiments/{experiment}/addresses", { experiment: this.here }, { addresses });
      this.done = `Confirmed: ${addresses.join(", ")}. Connect again`;
    });
  }

  async disconnect(): Promise<void> {
    await ask("POST /devices/camera/disconnect", {});
    await this.refreshDevices();
  }

  /** Puts what is known of a projector in its place. */
  putProjector(projector: ProjectorResource): void {
    const others = this.projectors.filter((one) => one.view !== projector.view);
    this.projectors = [...others, projector].sort((a, b) => a.view - b.view);
  }

  async connectProjector(view: number): Promise<void> {
    this.putProjector(await ask("POST /devices/projector/connect", {}, { experiment: this.here, view }));
  }

  async disconnectProjector(view: number): Promise<void> {
    this.putProjector(await ask("POST /devices/projector/disconnect", { view }));
  }

  async calibrate(): Promise<void> {
    await ask("POST /experiments/{experiment}/calibration", { experiment: this.here }, { kind: "simulated" });
    await this.refresh();
  }

  async capture(role: NewCapture["role"]): Promise<void> {
    const { frames, bursts, every_s, live } = this.wanted;
    const series = role === "flow" && bursts > 1 ? { bursts, every_s } : {};
    const wanted = { role, frames, live, at_once: this.atOnce, ...series };
    this.desk = await ask("POST /experiments/{experiment}/captures", { experiment: this.here }, wanted);
  }

  async retake(capture: string, view: string): Promise<void> {
    const named = { experiment: this.here, capture };
    this.desk = await ask("POST /experiments/{experiment}/captures/{capture}/retake", named, { view });
  }

  async abort(discard: boolean): Promise<void> {
    this.desk = await ask("POST /captures/running/abort", {}, { discard });
    await this.refreshExperiment();
  }

  async reconstruct(preset: string): Promise<void> {
    await ask(
      "POST /jobs",
      {},
      {
        kind: "reconstruct",
        experiment: this.here,
        title: `Reconstruct (${preset}): ${this.current?.title || this.experiment}`.slice(0, LONGEST),
        settings: { preset, sequence: this.bursts >= LEAST_BURSTS && this.everyBurst },
        key: crypto.randomUUID(),
      },
    );
    this.jobs = await ask("GET /jobs", {});
  }

  async act(job: JobResource, action: Action): Promise<void> {
    await ask("POST /jobs/{job}/{action}", { job: job.job, action });
    this.jobs = await ask("GET /jobs", {});
  }

  async export(format: Format): Promise<void> {
    const wanted = { experiment: this.here, result: this.result ?? "", form: format };
    const answer = await file("GET /experiments/{experiment}/results/{result}/exports/{form}", wanted);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    const named = /filename="?([^";]+)/.exec(answer.headers.get("Content-Disposition") ?? "");
    link.download = named?.[1] ?? `${this.result}.${format}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    this.done = `Saved ${link.download}`;
  }

  /** Opens the room's editor with one more object, which nobody keeps until the room is changed there. */
  state(answer: Record<string, unknown>): void {
    [this.adding, this.page] = [answer, "Room"];
  }

  /** Opens the report in a window of its own; a refusal is shown here, not there. */
  async report(result: string): Promise<void> {
    const wanted = { experiment: this.here, result };
    await file("GET /experiments/{experiment}/results/{result}/report", wanted);
    const found = address("GET /experiments/{experiment}/results/{result}/report", wanted);
    window.open(found, "_blank", "noopener,noreferrer");
    this.done = "Opened the report";
  }

  private nextStep(): Step {
    const running = this.ownDesk?.state === "running";
    const job = this.active.find((one) => one.experiment === this.experiment);
    const step = (label: string, page: Page, act: () => Promise<unknown>, busy = false) => ({ label, page, act, busy });
    const nothing = () => Promise.resolve();
    if (this.offered?.page === this.page) return this.offered;
    if (!this.experiment) return step("Start a simulated rig", "Rig", () => this.createSimulated());
    const needsCamera = ["Rig", "Calibrate", "Capture"].includes(this.page);
    if (needsCamera && this.ownCamera?.state === "failed")
      return step("Reconnect the camera", "Rig", () => this.connect());
    if (running) {
      const { role, done, total } = this.ownDesk!;
      return step(`Taking the ${role}: ${done} of ${total}`, "Capture", nothing, true);
    }
    // What is not done yet is told by the service, as it tells `airlens status`.
    const next = this.current?.next?.step;
    if (next === "camera") return step("Name the camera", "Room", nothing, this.page === "Room");
    if (next === "calibrate") {
      const first = this.current?.uncalibrated[0] ?? "rig";
      if (this.current?.camera === "simulated" && first === "camera")
        return step("Calibrate", "Calibrate", () => this.calibrate());
      // A real rig, or one that was begun with, is calibrated by its operator: the guide says what to show.
      return step(`Calibrate the ${first}`, "Calibrate", nothing, this.page === "Calibrate");
    }
    if (next === "reference" || next === "flow") return step(`Take the ${next}`, "Capture", () => this.capture(next));
    if (job) {
      const share = job.steps ? `: ${Math.round(100 * job.progress)} %` : " …";
      return step(`${job.kind === "plan" ? "Planning" : "Reconstructing"}${share}`, "Reconstruct", nothing, true);
    }
    const last = this.jobs.find((one) => one.experiment === this.experiment && one.kind === "reconstruct");
    if (!this.result && last && ["failed", "cancelled"].includes(last.state))
      return step("Retry the reconstruction", "Reconstruct", () => this.act(last, "retry"));
    if (next === "reconstruct" || !this.result)
      return step("Reconstruct", "Reconstruct", () => this.reconstruct(this.preset));
    if (this.page !== "Look") return step("Look at the result", "Look", nothing);
    return step("Export NetCDF", "Look", () => this.export("nc"));
  }

  async takeNextStep(): Promise<void> {
    const { label, page, act, busy } = this.next;
    if (busy) return;
    this.turn(page);
    this.done = "";
    await this.attempt(label, act);
  }

  // Events

  private listen(away = false): void {
    const stream = new EventSource(address("GET /events", {}));
    const heard = (message: MessageEvent<string>) => this.hear(JSON.parse(message.data) as EventResource);
    for (const kind of ["job", "device", "capture", "calibration", "log", "experiment", "live"])
      stream.addEventListener(kind, heard);
    stream.onopen = () => {
      if (!this.connected) void this.later("all");
      if (away) this.returns++;
      if (this.problem?.code === "unreachable") this.problem = null;
      [this.connected, away] = [true, false];
    };
    stream.onerror = () => {
      [this.connected, away] = [false, true];
      // A refused stream is not tried again by the browser: a new token, or a proxy that gave up.
      if (stream.readyState === EventSource.CLOSED) setTimeout(() => this.listen(away), 2000);
    };
    this.stream = stream;
  }

  /** A request did not reach the service. The stream of events may not notice, so all is read again two seconds later. */
  missed(): void {
    this.soon ??= setTimeout(() => {
      this.soon = undefined;
      // A stream that broke as well tells when the service is back.
      if (!this.connected) return;
      this.returns++;
      void this.later("all");
    }, 2000);
  }

  private hear(event: EventResource): void {
    if (event.kind === "capture") {
      if (this.desk) this.desk = { ...this.desk, ...(event.body as Partial<DeskResource>) };
      if (event.body["state"] !== "running") void this.later("experiment");
    } else if (event.kind === "device") void this.later("devices");
    else if (event.kind === "live") this.looked++;
    else if (event.kind === "experiment") void this.later("all");
    else if (event.kind === "calibration") {
      this.guided++;
      if (event.body["state"] !== "running") void this.later("all");
    } else if (event.job) {
      this.progress(event);
      if (event.kind === "state") void this.later("all");
    }
  }

  private progress(event: EventResource): void {
    const { step, steps, stage, left_s } = event.body;
    if (event.job && typeof stage === "string") this.stages = { ...this.stages, [event.job]: stage };
    if (event.job && (stage !== undefined || step !== undefined))
      this.ends = { ...this.ends, [event.job]: typeof left_s === "number" ? event.at_s + left_s : null };
    if (typeof step !== "number" || typeof steps !== "number") return;
    const progress = steps > 0 ? Math.min(1, step / steps) : 0;
    this.jobs = this.jobs.map((job) => (job.job === event.job ? { ...job, step, steps, progress } : job));
  }

  /** Many events in a burst cause one look. */
  private async later(what: "all" | "devices" | "experiment"): Promise<void> {
    if (this.pending.has(what)) return;
    this.pending.add(what);
    await new Promise((resolve) => setTimeout(resolve, 100));
    this.pending.delete(what);
    try {
      if (what === "devices") await this.refreshDevices();
      else if (what === "experiment") await this.refreshExperiment();
      else await this.refresh();
      if (what === "experiment") this.desk = await ask("GET /captures/running", {});
    } catch (error) {
      if (!(error instanceof ProblemError)) throw error;
      if (error.problem.code === "unreachable") this.missed();
      else this.problem = error.problem;
    }
  }
}

export const bench = new Bench();
