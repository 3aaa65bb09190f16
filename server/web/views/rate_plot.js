// Plots the rate of each stage over time. The service records the rates, so the plot is the same on
// each page that shows the job.

import {getJson} from "../lib/api.js";
import {clear, h, setText, svg} from "../lib/dom.js";
import {durationText, shortCount} from "../lib/format.js";

const kWidth = 520, kHeight = 170;
const kLeft = 52, kRight = 8, kTop = 10, kBottom = 24;
const kMinIntervalMs = 3000;  // between two requests

export class RatePlot {
  constructor(path, signal) {
    this.path = path;
    this.signal = signal;
    this.stages = [];
    this.nextFetchMs = 0;
    this.chosen = null;  // the stage chosen by the user; null for the current stage
    this.tabs = h("div", {class: "tabs", role: "group", "aria-label": "Stage"});
    this.note = h("p", {class: "faint"});
    this.picture = svg("svg", {viewBox: `0 0 ${kWidth} ${kHeight}`, class: "plot", role: "img"});
    this.element = h("div", {}, this.tabs, this.picture, this.note);
    this.draw();
  }

  // Draws the rates of the job. Fetches them at a limited rate while the job runs, and after
  // each change of its state. Calls `onChange` after each fetch.
  async update(job, onChange) {
    if (job.attempts !== this.job?.attempts) this.stages = [];
    this.job = job;
    this.draw();
    const p = job.progress;
    const key = `${job.attempts} ${p?.stage} ${p?.done} ${job.state}`;
    const isDue = job.state !== "running" || performance.now() >= this.nextFetchMs;
    if (!p || key === this.key || !isDue || this.fetching) return;
    this.fetching = true;
    const {attempts, state} = job;
    try {
      this.stages = (await getJson(this.path, this.signal)).stages;
      this.key = key;
    } catch {
      if (this.signal.aborted) return;
    } finally {
      this.fetching = false;
      this.nextFetchMs = performance.now() + kMinIntervalMs;
    }
    this.draw();
    onChange();
    // The last rates of an attempt can be stored while the request is in flight.
    if (this.job.attempts !== attempts || this.job.state !== state)
      await this.update(this.job, onChange);
  }

  // Returns the points of each stage by its name. The present rate of a running job is the last
  // point of its current stage.
  series() {
    const series = new Map(this.stages.map(({name, unit, points}) => [name, {unit, points}]));
    const p = this.job?.progress, now = p?.stages?.at(-1);
    if (this.job?.state === "running" && now && now.wall_s > 0) {
      const earlier = series.get(p.stage)?.points ?? [];
      const points = earlier.filter(([time]) => time < now.wall_s);
      series.set(p.stage, {unit: p.unit, points: [...points, [now.wall_s, p.rate]]});
    }
    return series;
  }

  draw() {
    const series = this.series();
    const names = [...series.keys()].filter((name) => series.get(name).points.length > 1);
    const current = this.job?.progress?.stage;
    const name = names.includes(this.chosen) ? this.chosen :
        names.includes(current)              ? current :
                                               longest(series, names);
    this.showTabs(names, name);
    this.picture.toggleAttribute("hidden", !name);
    this.empty = !name;
    if (!name) {
      setText(this.note, "Shown once a stage has run for some seconds.");
      return;
    }
    const {points, unit} = series.get(name);
    setText(this.note, `${unit} per second during ${name}`);
    this.picture.setAttribute(
        "aria-label", `Rate of ${name}: latest ${shortCount(points.at(-1)[1])} ${unit} per second`);
    clear(this.picture, plot(points));
  }

  showTabs(names, shown) {
    const key = names.join();
    if (this.tabs.dataset.key !== key) {
      this.tabs.dataset.key = key;
      clear(
          this.tabs,
          names.map(
              (name) =>
                  h("button", {
                    type: "button",
                    on: {
                      click: () => {
                        this.chosen = name;
                        this.draw();
                      }
                    }
                  },
                    name)));
    }
    this.tabs.hidden = names.length < 2;
    for (const button of this.tabs.children)
      button.setAttribute("aria-pressed", String(button.textContent === shown));
  }
}

function longest(series, names) {
  const size = (name) => series.get(name).points.length;
  return names.reduce((best, name) => (best && size(best) >= size(name) ? best : name), null);
}

// Returns the axes with a few round ticks, and a line over a filled area.
function plot(samples) {
  const begin = samples[0][0], end = Math.max(samples.at(-1)[0], begin + 1);
  const ticks = roundTicks(Math.max(...samples.map(([, rate]) => rate), 1e-9));
  const x = (time) => kLeft + (time - begin) / (end - begin) * (kWidth - kLeft - kRight);
  const y = (rate) => kHeight - kBottom - rate / ticks.at(-1) * (kHeight - kTop - kBottom);
  const points =
      samples.map(([time, rate]) => `${x(time).toFixed(1)},${y(rate).toFixed(1)}`).join(" ");
  const label = (atX, atY, anchor, text) =>
      svg("text", {x: atX, y: atY, "text-anchor": anchor}, text);
  return [
    ...ticks.flatMap(
        (tick) =>
            [svg("line", {class: "grid", x1: kLeft, x2: kWidth - kRight, y1: y(tick), y2: y(tick)}),
             label(kLeft - 8, y(tick) + 4, "end", shortCount(tick))]),
    svg("polygon", {
      class: "area",
      points: `${x(samples[0][0])},${y(0)} ${points} ${x(samples.at(-1)[0])},${y(0)}`
    }),
    svg("polyline", {class: "line", points}),
    label(kLeft, kHeight - 6, "start", durationText(begin)),
    label(kWidth - kRight, kHeight - 6, "end", durationText(end)),
  ];
}

// Returns the values of the ticks: 0 and two to four multiples of a round step. The last value is
// at least `max`.
function roundTicks(max) {
  const power = 10 ** Math.floor(Math.log10(max));
  const step = [0.25, 0.5, 1, 2, 5].map((factor) => factor * power).find((size) => max / size <= 4);
  return Array.from({length: Math.ceil(max / step) + 1}, (_, i) => i * step);
}
