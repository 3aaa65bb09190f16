// The exports of a job's result: a form that requests an export, and the exports with their
// progress and their files.

import {getJson, poll, sendJson} from "../lib/api.js";
import {announce, clear, confirmAction, field, h, setText} from "../lib/dom.js";
import {gridText, sizeText} from "../lib/format.js";
import {saveFile} from "../lib/save_file.js";

import {actionButton} from "./job_actions.js";
import {meter, problemBox, stateBadge} from "./parts.js";

const kBusyPauseMs = 700;
const kIdlePauseMs = 5000;
const kMinLevel = 2;

export class ExportsView {
  // `path`: the address of the job's exports.
  constructor(path, signal) {
    this.path = path;
    this.signal = signal;
    this.rows = new Map();  // rows by the id of their export
    this.error = h("div", {role: "alert"});
    this.format = h("select", {});
    this.grid = h("select", {});
    this.list = h("ul", {class: "exports"});
    this.element =
        h("section", {class: "card stack", "aria-labelledby": "exports-title", hidden: true},
          h("h2", {id: "exports-title"}, "Exports"),
          h("div", {class: "export-form"}, field("Format", this.format), field("Grid", this.grid),
            actionButton("Export", () => this.post(this.request()), "", this.error)),
          this.error, this.list);
  }

  // Shows the exports of a job that has succeeded.
  update(job) {
    this.element.hidden = job.state !== "succeeded";
    if (this.element.hidden || this.job) return;
    this.job = job;
    this.topLevel = Math.round(Math.log2(job.resolution));
    const levels = Array.from({length: this.topLevel - kMinLevel + 1}, (_, i) => this.topLevel - i);
    clear(
        this.grid,
        levels.map((level) => h("option", {value: String(level)}, gridText(2 ** level))));
    poll(() => this.refresh(), (problem) => this.showFailure(problem), this.signal);
  }

  showFailure(problem) {
    this.hasFailed = true;
    clear(this.error, problemBox(problem));
  }

  request() {
    const level = Number(this.grid.value);
    return {to: this.format.value, ...(level < this.topLevel && {level})};
  }

  async post(request) {
    await sendJson("POST", this.path, request);
    announce("The export is queued.");
    await this.refresh();
  }

  // Loads the exports. Returns the pause in ms before the next call.
  async refresh() {
    if (!this.format.firstChild) await this.loadFormats();
    const {exports} = await getJson(this.path, this.signal);
    if (this.hasFailed) clear(this.error);
    this.hasFailed = false;
    const ids = exports.map(({id}) => id);
    for (const [id, row] of this.rows) {
      if (ids.includes(id)) continue;
      row.element.remove();
      this.rows.delete(id);
    }
    for (const each of exports) this.show(each);
    return exports.some(({state}) => !["succeeded", "failed"].includes(state)) ? kBusyPauseMs :
                                                                                 kIdlePauseMs;
  }

  // The OpenAPI document lists the formats of this service.
  async loadFormats() {
    const api = await getJson("/openapi.json", this.signal);
    const formats = api.components.schemas.ExportRequest.properties.to.enum;
    clear(this.format, formats.map((name) => h("option", {value: name}, name)));
    if (formats.includes("glb")) this.format.value = "glb";
  }

  // Shows an export. Makes its row again only if the state has changed, so that the keyboard focus
  // remains.
  show(it) {
    const known = this.rows.get(it.id);
    if (known?.state !== it.state) {
      const row = this.row(it);
      if (known) {
        const hadFocus = known.element.contains(document.activeElement);
        known.element.replaceWith(row.element);
        if (hadFocus) row.element.querySelector("button")?.focus();
        announce(`The export is ${it.state}.`);
      } else {
        this.list.append(row.element);
      }
      this.rows.set(it.id, row);
    }
    this.rows.get(it.id).update(it);
  }

  row(it) {
    const error = h("div", {role: "alert"});
    const name = this.nameOf(it.request);
    const bar = meter(`Progress of the export ${name}`);
    const stage = h("span", {class: "faint"});
    const button = (text, action, kind = "") => {
      const element = actionButton(text, action, `small ${kind}`, error);
      element.setAttribute("aria-label", `${text} (${name})`);
      return element;
    };
    const may = (...states) => states.includes(it.state);
    const element =
        h("li", {"data-state": it.state},
          h("div", {class: "export-row"}, h("strong", {}, name), stateBadge(it.state), stage),
          may("queued", "running") && bar.element,
          it.error && problemBox({code: it.error.code, detail: it.error.message}),
          it.warnings.map((warning) => h("p", {}, `Warning: ${warning}`)),
          it.notes.map((note) => h("p", {class: "faint"}, note)),
          h("div", {class: "buttons"},
            it.files.map(
                (file) => button(
                    `Download ${file.name} (${sizeText(file.bytes)})`, () => saveFile(file))),
            may("failed") && button("Retry", () => this.post(it.request)),
            may("queued", "running") && button("Cancel", () => this.remove(it), "danger"),
            may("failed", "succeeded") && button("Delete", () => this.askToRemove(it), "danger")),
          error);
    const update = ({progress}) => {
      bar.update(progress ? (progress.total > 0 ? progress.done / progress.total : null) : 0);
      setText(stage, progress ? progress.stage : "");
    };
    return {element, state: it.state, update};
  }

  // Returns the format and options of an export, such as "glb, 2048³, up z".
  nameOf({to, level, ...more}) {
    const options = Object.entries(more).map(
        ([option, value]) => value === true ? option : `${option} ${value}`);
    return [to, gridText(2 ** (level ?? this.topLevel)), ...options].join(", ");
  }

  async askToRemove(it) {
    if (await confirmAction("Delete this export?", "Its files will be deleted.", "Delete"))
      await this.remove(it);
  }

  async remove(it) {
    await sendJson("DELETE", it.links.self);
    await this.refresh();
  }
}
