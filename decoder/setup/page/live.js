// Every change is tried at once: the selected gauge first, then the others; answers that come too late are dropped.
import { isDrawn, needsMarks } from "./kinds.js";
import { asDrawn, valued, written } from "./following.js";
import { ask, Lost, onLost, TAB } from "./server.js";

const TRIAL_MS = 160;
const CHECK_MS = 220;
const GOOD_SCORE = 0.9;

export class Live {
  constructor(store) {
    this.store = store;
    this.results = new Map(); // what was tried of a gauge, by all that it depends on
    this.latest = new Map(); // the last result of each gauge by its index, while a new one is awaited
    this.kept = null; // what the program was told last, to judge it and to keep it as the draft
    store.on("change", () => this.later());
    store.on("select", () => this.later());
    store.on("saved", () => { this.kept = null; }); // a draft that was saved is kept no longer
    onLost((lost) => lost || this.later());
    this.later();
  }

  // All that a gauge's reading depends on; null while it cannot be read.
  keyOf(index) {
    const { document, picture } = this.store.now;
    const gauge = document.gauges?.[index];
    if (!document.anchors?.length || !gauge) return null;
    if (!isDrawn(this.store, gauge) || (needsMarks(this.store, gauge) && valued(gauge.scale).length < 2)) return null;
    return JSON.stringify([picture, document.anchors, document.level, document.reference_points, document.focal_length_mm, written({ gauges: [gauge] })]);
  }

  resultOf(index) {
    return this.results.get(this.keyOf(index)) || null;
  }

  later() {
    clearTimeout(this.trialTimer);
    clearTimeout(this.checkTimer);
    this.trialTimer = setTimeout(() => {
      this.trialTimer = null;
      this.tryNext();
    }, TRIAL_MS);
    this.checkTimer = setTimeout(() => this.check(), CHECK_MS);
  }

  next() {
    const gauges = this.store.document.gauges || [];
    const order = gauges.map((_, index) => index);
    const { kind, index } = this.store.selection;
    if (kind === "gauge") order.sort((one, other) => (other === index) - (one === index));
    return order.find((each) => this.keyOf(each) && !this.results.has(this.keyOf(each)));
  }

  async tryNext() {
    const index = this.next();
    if (index === undefined) return;
    const key = this.keyOf(index);
    if (this.running === key) return;
    this.abort?.abort();
    this.abort = new AbortController();
    this.running = key;
    const { document, picture } = this.store.now;
    let result = null;
    try {
      result = await ask("trial", { document: written(document), picture, gauge: index, tab: TAB }, { signal: this.abort.signal });
    } catch (error) {
      if (error instanceof Lost) {
        this.running = null;
        return;
      }
      result = { error: error.message, problems: error.problems || [], frames: [] };
    }
    if (this.running !== key) return;
    this.running = null;
    if (result) {
      this.results.set(key, result);
      if (this.keyOf(index) === key) this.latest.set(index, result);
      this.store.tell("trial");
    }
    if (!this.trialTimer) this.tryNext();
  }

  // One question at a time: of what changes meanwhile only the last counts.
  async check() {
    this.isUnchecked = true;
    if (this.isChecking) return;
    this.isChecking = true;
    while (this.isUnchecked) {
      this.isUnchecked = false;
      await this.checkOnce();
    }
    this.isChecking = false;
  }

  async checkOnce() {
    const { document, picture } = this.store.now;
    const asked = JSON.stringify([document, picture]);
    if (this.kept === asked && this.store.judged === asked) return;
    this.kept = asked;
    try {
      const { problems } = await ask("check", { document: written(document), drawn: document, picture });
      this.store.judge(asked, problems.map(({ path, problem }) => ({ path: asDrawn(document, path), problem })));
    } catch (error) {
      this.kept = null;
      if (error instanceof Lost) return;
      this.store.judge(asked, []); // what was wrong before it was changed need not be
      this.store.tell("say", error.message);
    }
  }

  // How an anchor is found in the sample, for the outline: any gauge's trial tells.
  anchorSummary(name) {
    const gauges = this.store.document.gauges || [];
    const result = gauges.map((_, index) => this.resultOf(index)).find((each) => each?.anchors);
    if (!result) return { dot: "", count: "" };
    const found = result.frames.filter(({ reason }) => !reason).length;
    const failed = result.anchors[name] || 0;
    const dot = !failed && found === result.frames.length ? "good" : failed * 2 < found ? "warn" : "bad";
    return { dot, count: `${found - failed}/${result.frames.length}` };
  }

  // How a gauge is read, for the outline.
  summary(index) {
    const result = this.resultOf(index);
    if (!result) return { dot: "", count: this.keyOf(index) ? "…" : "" };
    if (result.error) return { dot: "bad", count: "" };
    const all = result.frames.flatMap((frame) => (frame.needles.length ? frame.needles.filter(({ together }) => !together) : [{ status: "missing", score: 0 }]));
    const read = all.filter(({ status }) => status !== "missing");
    const sure = read.every(({ score }) => score >= GOOD_SCORE);
    const dot = read.length === all.length && sure && !result.findings.length ? "good" : read.length > all.length / 2 ? "warn" : "bad";
    return { dot, count: `${read.length}/${all.length}` };
  }
}
