// Lets the user choose a scene: an uploaded scene, a new upload, or the path of a file on the
// server.

import {getJson} from "../lib/api.js";
import {announce, clear, field, h, setText} from "../lib/dom.js";
import {durationText, sizeText} from "../lib/format.js";
import {kSceneEndings, kSceneName, sceneName, upload} from "../lib/scene_upload.js";

import {meter, problemBox} from "./parts.js";

const kPageSize = 200;

export class SceneChoice {
  // `changed` is called when the user chooses a different scene.
  constructor(signal, changed) {
    this.signal = signal;
    this.changed = changed;
    this.select = h("select", {on: {change: changed}}, h("option", {value: ""}, "Loading…"));
    this.path = h("input", {
      autocomplete: "off",
      spellcheck: "false",
      placeholder: "/srv/scenes/building.glb",
      on: {change: changed}
    });
    this.file = h("input", {
      type: "file",
      accept: kSceneEndings.join(","),
      id: "scene-file",
      class: "unseen",
      on: {change: () => this.startUpload(this.file.files[0])}
    });
    const drop = h("div", {class: "drop"}, this.file,
      h("label", {for: "scene-file", class: "button"}, "Upload a scene…"),
      h("span", {class: "hint"}, `or drop a file here (${kSceneEndings.join(", ")})`));
      this.dropTarget(drop);
      this.uploadPlace = h("div", {});
      this.element =
          h("section", {class: "card stack", "aria-labelledby": "scene-title"},
            h("h2", {id: "scene-title"}, "Scene"), field("On the server", this.select), drop,
            this.uploadPlace,
            this.more =
                h("details", {}, h("summary", {}, "A path on the server"),
                  field(
                      "Absolute path", this.path,
                      "In one of the scene folders configured for the service.")));
  }

  // Returns the entered path. If no path is entered and the form copies a job with several scenes,
  // returns these scenes. Otherwise returns the selected scene; "" if no scene is selected.
  value() {
      return this.path.value.trim() || this.several || this.select.value;
  }

  // Fills the list of uploaded scenes. Then selects the scenes in `chosen`: the scenes of a copied
  // job, or a scene that was just uploaded.
  async load(chosen = null) {
      const scenes = [];
      for (let cursor = null, more = true; more; more = cursor !== null) {
        const query = new URLSearchParams({limit: kPageSize, ...(cursor && {cursor})});
        const page = await getJson(`/api/v1/scenes?${query}`, this.signal);
        scenes.push(...page.scenes.filter((scene) => scene.complete));
        cursor = page.next_cursor;
      }
      const before = this.select.value;
      clear(
          this.select, h("option", {value: ""}, scenes.length ? "Choose one…" : "None yet"),
          scenes.map(
              (scene) => h(
                  "option", {value: scene.name}, `${scene.name} (${sizeText(scene.size_bytes)})`)));
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

  dropTarget(element) {
      const over = (isOver) => (event) => {
        event.preventDefault();
        element.classList.toggle("over", isOver);
      };
      element.addEventListener("dragover", over(true));
      element.addEventListener("dragleave", over(false));
      element.addEventListener("drop", (event) => {
        over(false)(event);
        if (event.dataTransfer.files.length) this.startUpload(event.dataTransfer.files[0]);
      });
  }

  // Uploads the file, with buttons to pause and resume.
  startUpload(file) {
      if (!file) return;
      this.file.value = "";
      this.stop?.abort();
      const name = sceneName(file.name);
      if (!kSceneName.test(name)) {
        clear(this.uploadPlace, problemBox({
                code: "invalid_input",
                detail: `${file.name}: expected a file of type ${kSceneEndings.join(", ")}.`
              }));
        return;
      }
      const view = new UploadView(name, file.size, () => this.stop.abort(), () => run());
      clear(this.uploadPlace, view.element);
      const run = async () => {
        const stop = this.stop = new AbortController();
        this.signal.addEventListener(
            "abort", () => stop.abort(), {once: true, signal: stop.signal});
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
      this.element =
          h("div", {class: "upload"},
            h("div", {class: "split"}, h("strong", {}, name), this.pause, this.resume),
            this.bar.element, this.text, this.error);
    }
    begin() {
      this.pause.hidden = false;
      this.resume.hidden = true;
      this.beginMs = null;
      clear(this.error);
    }
    show(bytes) {
      this.beginMs ??= performance.now();
      this.beginBytes ??= bytes;
      const seconds = (performance.now() - this.beginMs) / 1000;
      const rate = (bytes - this.beginBytes) / Math.max(seconds, 1e-3);
      const left =
          seconds > 1 && rate > 0 ? `, ${durationText((this.size - bytes) / rate)} left` : "";
      this.bar.update(bytes / this.size);
      setText(this.text, `${sizeText(bytes)} of ${sizeText(this.size)}${left}`);
    }
    end() {
      this.pause.hidden = this.resume.hidden = true;
      this.bar.update(1);
      setText(this.text, `${sizeText(this.size)}, uploaded and selected`);
      announce(`${this.name} is uploaded`);
    }
    stop(problem) {
      this.pause.hidden = true;
      this.resume.hidden = false;
      if (problem) clear(this.error, problemBox(problem, "The upload stopped; it can be resumed."));
      else setText(this.text, `${this.text.textContent}, paused`);
    }
  }
