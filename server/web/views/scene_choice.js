// Chooses a scene: an uploaded one, a new upload, or the path of a file on the server.

import {get_json} from "../lib/api.js";
import {announce, clear, field, h, set_text} from "../lib/dom.js";
import {duration_text, size_text} from "../lib/format.js";
import {meter, problem_box} from "./parts.js";
import {kSceneName, scene_name, upload} from "../lib/scene_upload.js";

const kPageSize = 200;

export class SceneChoice {
  // `changed` is called when another scene is chosen.
  constructor(signal, changed) {
    this.signal = signal;
    this.changed = changed;
    this.select = h("select", {on: {change: changed}}, h("option", {value: ""}, "Loading…"));
    this.path = h("input", {autocomplete: "off", spellcheck: "false", placeholder: "/srv/scenes/building.glb",
                            on: {change: changed}});
    this.file = h("input", {type: "file", accept: ".glb,.gltf,.ply", id: "scene-file", class: "unseen",
                            on: {change: () => this.start_upload(this.file.files[0])}});
    const drop = h("div", {class: "drop"}, this.file,
      h("label", {for: "scene-file", class: "button"}, "Upload a scene…"),
      h("span", {class: "hint"}, "or drop a .glb or .ply file here"));
    this.drop_target(drop);
    this.upload_place = h("div", {});
    this.element = h("section", {class: "card stack", "aria-labelledby": "scene-title"},
      h("h2", {id: "scene-title"}, "Scene"), field("On the server", this.select), drop, this.upload_place,
      this.more = h("details", {}, h("summary", {}, "A path on the server"),
        field("Absolute path", this.path, "In one of the scene folders configured for the service.")));
  }

  // The path if one is entered, else the chosen scene, else "".
  value() {
    return this.path.value.trim() || this.several || this.select.value;
  }

  // Fills the list and selects `chosen`, the scenes of a job.
  async load(chosen = null) {
    const scenes = [];
    for (let cursor = null, more = true; more; more = cursor !== null) {
      const query = new URLSearchParams({limit: kPageSize, ...(cursor && {cursor})});
      const page = await get_json(`/api/v1/scenes?${query}`, this.signal);
      scenes.push(...page.scenes.filter((scene) => scene.complete));
      cursor = page.next_cursor;
    }
    const before = this.select.value;
    clear(this.select, h("option", {value: ""}, scenes.length ? "Choose one…" : "None yet"),
      scenes.map((scene) => h("option", {value: scene.name}, `${scene.name} (${size_text(scene.size_bytes)})`)));
    this.select.value = before;
    if (chosen) this.choose(chosen);
  }

  choose(scenes) {
    this.several = scenes.length > 1 ? scenes : null;
    if (scenes.length === 1 && scenes[0].startsWith("/")) {
      this.path.value = scenes[0];
      this.more.open = true;
    } else if (scenes.length === 1) {
      this.select.value = scenes[0];
    } else {
      this.select.replaceChildren(h("option", {value: ""}, scenes.join(" + ")));
    }
  }

  drop_target(element) {
    const over = (is_over) => (event) => {
      event.preventDefault();
      element.classList.toggle("over", is_over);
    };
    element.addEventListener("dragover", over(true));
    element.addEventListener("dragleave", over(false));
    element.addEventListener("drop", (event) => {
      over(false)(event);
      if (event.dataTransfer.files.length) this.start_upload(event.dataTransfer.files[0]);
    });
  }

  // Uploads the file, with buttons to pause and resume.
  start_upload(file) {
    if (!file) return;
    this.file.value = "";
    this.stop?.abort();
    const name = scene_name(file.name);
    if (!kSceneName.test(name)) {
      clear(this.upload_place, problem_box({code: "invalid_input", detail: `${file.name}: expected a .glb, .gltf or .ply file.`}));
      return;
    }
    const view = new UploadView(name, file.size, () => this.stop.abort(), () => run());
    clear(this.upload_place, view.element);
    const run = async () => {
      const stop = this.stop = new AbortController();
      this.signal.addEventListener("abort", () => stop.abort(), {once: true, signal: stop.signal});
      view.begin();
      try {
        await upload(file, name, (bytes) => view.show(bytes), stop.signal);
        view.end();
        await this.load([name]);
        this.changed();
      } catch (problem) {
        if (!this.signal.aborted) view.stop(stop.signal.aborted ? null : problem);
      }
    };
    run();
  }
}

class UploadView {
  constructor(name, size, pause, resume) {
    this.name = name;
    this.size = size;
    this.bar = meter(`upload of ${name}`);
    this.text = h("span", {class: "hint"});
    this.error = h("div", {role: "alert"});
    this.pause = h("button", {type: "button", class: "quiet small", on: {click: pause}}, "Pause");
    this.resume = h("button", {type: "button", class: "small", on: {click: resume}}, "Resume");
    this.element = h("div", {class: "upload"}, h("div", {class: "split"}, h("strong", {}, name), this.pause, this.resume),
                     this.bar.element, this.text, this.error);
  }
  begin() {
    this.pause.hidden = false;
    this.resume.hidden = true;
    this.begin_ms = null;
    clear(this.error);
  }
  show(bytes) {
    this.begin_ms ??= performance.now();
    this.begin_bytes ??= bytes;
    const seconds = (performance.now() - this.begin_ms) / 1000;
    const rate = (bytes - this.begin_bytes) / Math.max(seconds, 1e-3);
    const left = seconds > 1 && rate > 0 ? `, ${duration_text((this.size - bytes) / rate)} left` : "";
    this.bar.update(bytes / this.size);
    set_text(this.text, `${size_text(bytes)} of ${size_text(this.size)}${left}`);
  }
  end() {
    this.pause.hidden = this.resume.hidden = true;
    this.bar.update(1);
    set_text(this.text, `${size_text(this.size)}, uploaded and selected`);
    announce(`${this.name} is uploaded`);
  }
  stop(problem) {
    this.pause.hidden = true;
    this.resume.hidden = false;
    if (problem) clear(this.error, problem_box(problem, "The upload stopped; it can be resumed."));
    else set_text(this.text, `${this.text.textContent}, paused`);
  }
}
