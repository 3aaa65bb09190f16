// Plots the rate of each stage over time, from the updates that this page has received.

import {clear, h, setText, svg} from "../lib/dom.js";
import {durationText, shortCount} from "../lib/format.js";

const kWidth = 520, kHeight = 170;
const kLeft = 52, kRight = 8, kTop = 10, kBottom = 24;
const kWindowS = 2;       // minimum duration over which a rate is averaged
const kMaxSamples = 600;  // if there are more samples, every other sample is dropped

// Maps a job's id to the series of its stages. The series are kept until the browser leaves the
// dashboard, so that they are shown again when the user returns to a job.
const seriesByJob = new Map();

export class RatePlot {
  constructor(id) {
    if (!seriesByJob.has(id)) seriesByJob.set(id, new Map());
    this.series = seriesByJob.get(id);
    this.chosen = null;  // the stage chosen by the user; null for the current stage
    this.tabs = h("div", {class: "tabs", role: "group", "aria-label": "Stage"});
    this.note = h("p", {class: "faint"});
    this.picture = svg("svg", {viewBox: `0 0 ${kWidth} ${kHeight}`, class: "plot", role: "img"});
    this.element = h("div", {}, this.tabs, this.picture, this.note);
    this.draw();
  }

  add(job) {
    const p = job.progress;
    if (job.state === "running" && p.stage) this.record(p);
    this.draw();
  }

  record(p) {
    let series = this.series.get(p.stage);
    const known = p.stages?.find((stage) => stage.name === p.stage);
    const time = known ? known.wall_s : p.elapsed_s;
    if (!series || time < series.marks.at(-1).time)  // a new attempt
      this.series.set(p.stage, series = {unit: p.unit, marks: [], samples: []});
    series.marks.push({time, done: p.done});
    while (series.marks.length > 2 && time - series.marks[1].time >= kWindowS) series.marks.shift();
    const from = series.marks[0];
    if (time - from.time < 0.4) return;
    series.samples.push([time, (p.done - from.done) / (time - from.time)]);
    if (series.samples.length > kMaxSamples)
      series.samples = series.samples.filter((_, i) => i % 2 === 0);
    this.current = p.stage;
  }

  draw() {
    const names =
        [...this.series.keys()].filter((name) => this.series.get(name).samples.length > 1);
    const name = names.includes(this.chosen) ? this.chosen :
        names.includes(this.current)         ? this.current :
                                               longest(this.series, names);
    this.showTabs(names, name);
    this.picture.toggleAttribute("hidden", !name);
    this.empty = !name;
    if (!name) {
      setText(this.note, "Recorded while the job runs and this page is open.");
      return;
    }
    const {samples, unit} = this.series.get(name);
    setText(this.note, `${unit} per second during ${name}`);
    this.picture.setAttribute(
        "aria-label", `Rate of ${name}: now ${shortCount(samples.at(-1)[1])} ${unit} per second`);
    clear(this.picture, plot(samples));
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
  const size = (name) => series.get(name).samples.length;
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
