// The panel: camera, pick, box, detail, light, statistics, keys.

import {clear, fact, field, h, set_text} from "../lib/dom.js";
import {count_text, size_text} from "../lib/format.js";
import {copy_button} from "../views/parts.js";
import {ClipView} from "./clip_view.js";
import {keys_help} from "./keys.js";
import {PickView} from "./pick_view.js";

export class Panel {
  // `viewer` is the Viewer (app.js) that the panel shows and changes.
  constructor(viewer) {
    this.viewer = viewer;
    const {manifest, space} = viewer;
    this.levels = manifest.levels;
    this.pick = new PickView(space, () => {
      this.show_box_button();
      viewer.schedule();
    });
    this.clip = new ClipView(manifest.resolution, (clip) => viewer.set_options({clip}));
    this.element = h("div", {class: "panel-parts"},
      part("Camera", this.camera_part(), true),
      part("Picked voxel", this.pick.element, true),
      part("Clipping box", [this.clip.element, this.box_button = this.make_box_button()]),
      part("Detail and light", this.detail_part(), true),
      part("Statistics", this.statistics = h("dl", {class: "facts statistics"})),
      part("Keys", keys_help()));
    this.show_box_button();
  }

  camera_part() {
    const {viewer} = this;
    this.camera_text = h("code", {class: "camera-text", id: "camera-text"});
    this.copy_place = h("span", {});
    this.paste = h("input", {type: "text", spellcheck: "false", autocomplete: "off",
                             placeholder: "--camera X,Y,Z --target X,Y,Z"});
    this.paste_error = h("p", {class: "bad", role: "alert"});
    const form = h("form", {class: "stack paste"},
      field("Take the camera of", this.paste, "Options of voxdag render, such as the ones above."), this.paste_error,
      h("div", {class: "buttons"}, h("button", {class: "small"}, "Show"), this.views_choice()));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      try {
        viewer.fly_to_text(this.paste.value);
        set_text(this.paste_error, "");
      } catch (error) {
        set_text(this.paste_error, error.message);
      }
    });
    return [h("div", {class: "camera-row"}, this.camera_text, this.copy_place), form];
  }

  views_choice() {
    const views = this.viewer.manifest.views ?? {};
    if (Object.keys(views).length === 0) return null;
    const choice = h("select", {class: "small", "aria-label": "Named view"}, h("option", {value: ""}, "Named view…"),
      Object.keys(views).map((name) => h("option", {value: name}, name)));
    choice.addEventListener("change", () => {
      if (choice.value) this.viewer.fly_to(this.viewer.fit(this.viewer.space.placement(views[choice.value])));
      choice.value = "";
    });
    return choice;
  }

  make_box_button() {
    return h("button", {type: "button", class: "small", on: {click: () => this.viewer.set_options({clip: this.pick.box()})}},
             "Box of the two picks");
  }
  show_box_button() {
    if (this.box_button) this.box_button.hidden = this.pick.box() === null;
  }

  detail_part() {
    const {viewer, levels} = this;
    this.level = h("input", {type: "range", min: "1", max: String(levels), step: "1",
                             on: {input: () => viewer.set_options({level: Number(this.level.value)})}});
    this.level_note = h("output", {class: "faint"});
    this.wire = h("select", {on: {change: () => viewer.set_options({wire: this.wire.value === "" ? null : Number(this.wire.value)})}},
      h("option", {value: ""}, "none"),
      Array.from({length: levels + 1}, (_, level) => h("option", {value: String(level)},
        `level ${level}: edge ${count_text(2 ** (levels - level))}`)));
    this.switches = {};
    return [
      field("Finest level", this.level), this.level_note, field("Wireframe of octree cubes", this.wire),
      ...[["color", "Colors"], ["occlusion", "Ambient occlusion"], ["shadows", "Shadows of the sun"]].map(([name, label]) => {
        if (name === "color" && !viewer.manifest.colors) return null;
        const box = this.switches[name] = h("input", {type: "checkbox", id: `switch-${name}`,
          on: {change: () => viewer.set_options({[name]: box.checked})}});
        return h("div", {class: "check"}, box, h("label", {for: `switch-${name}`}, label));
      }),
    ];
  }

  show_camera(text) {
    if (this.camera_text.textContent === text) return;
    set_text(this.camera_text, text);
    clear(this.copy_place, copy_button(text, "the camera"));
  }

  show_options({level, wire, clip, ...switched}) {
    this.level.value = String(level);
    set_text(this.level_note, level === this.levels ? "single voxels"
      : `cubes of ${count_text(2 ** (this.levels - level))} voxels`);
    this.level.setAttribute("aria-valuetext", this.level_note.textContent);
    this.wire.value = wire === null ? "" : String(wire);
    this.clip.set(clip);
    for (const [name, box] of Object.entries(this.switches)) box.checked = switched[name];
  }

  show_statistics(s) {
    if (!this.statistics.closest("details").open) return;
    const rows = [
      ["Frames per second", s.fps >= 10 ? s.fps.toFixed(0) : s.fps.toFixed(1)],
      ["Picture", `${s.internalWidth} × ${s.internalHeight}`],
      ["Rays per frame", count_text(s.rays)],
      ["Steps per ray", `${s.stepsMean.toFixed(1)}; 99 % within ${Math.round(s.steps99)}`],
      ["Tiles", `${count_text(s.tiles)}${s.loading ? `, ${count_text(s.loading)} loading` : ""}`],
      ...(this.viewer.manifest.colors ? [["Color pages", count_text(s.colorPages)]] : []),
      ["Memory for tiles", `${size_text(s.poolBytes + s.colorPoolBytes)} of ${size_text(s.budgetBytes)}`],
      ["Memory for pictures", size_text(s.targetBytes)],
      ["Received", size_text(s.fetchedBytes)],
      ["Failed requests", count_text(s.failed)],
      ["Compiling the shaders", `${Math.round(s.compileMs)} ms`],
      ["First picture", s.firstPictureMs === null ? "–" : `${Math.round(s.firstPictureMs)} ms`],
    ];
    clear(this.statistics, rows.map(([name, value]) => fact(name, value)));
  }
}

function part(title, content, open = false) {
  return h("details", {class: "panel-part", open}, h("summary", {}, h("h2", {}, title)),
           h("div", {class: "stack"}, content));
}
