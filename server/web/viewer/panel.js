// The panel, with sections for camera, pick, box, detail, light, statistics and keys.

import {clear, fact, field, h, setText} from "../lib/dom.js";
import {countText, sizeText} from "../lib/format.js";
import {copyButton} from "../views/parts.js";

import {ClipView} from "./clip_view.js";
import {keysHelp} from "./keys.js";
import {PickView} from "./pick_view.js";

export class Panel {
  // `viewer` is the Viewer (app.js) whose state the panel shows and changes.
  constructor(viewer) {
    this.viewer = viewer;
    const {manifest, space} = viewer;
    this.levels = manifest.levels;
    this.pick = new PickView(space, () => {
      this.showBoxButton();
      viewer.schedule();
    });
    this.clip = new ClipView(manifest.resolution, (clip) => viewer.setOptions({clip}));
    this.element =
        h("div", {class: "panel-parts"}, part("Camera", this.cameraPart(), true),
          part("Picked voxel", this.pick.element, true),
          part("Clipping box", [this.clip.element, this.boxButton = this.makeBoxButton()]),
          part("Detail and light", this.detailPart(), true),
          part("Statistics", this.statistics = h("dl", {class: "facts statistics"})),
          part("Keys", keysHelp()));
    this.showBoxButton();
  }

  cameraPart() {
    const {viewer} = this;
    this.cameraText = h("code", {class: "camera-text", id: "camera-text"});
    this.copyPlace = h("span", {});
    this.paste = h("input", {
      type: "text",
      spellcheck: "false",
      autocomplete: "off",
      placeholder: "--camera X,Y,Z --target X,Y,Z"
    });
    this.pasteError = h("p", {class: "bad", role: "alert"});
    const form = h(
        "form", {class: "stack paste"},
        field(
            "Move the camera to", this.paste, "Options of voxdag render, such as the ones above."),
        this.pasteError,
        h("div", {class: "buttons"}, h("button", {class: "small"}, "Show"), this.viewsChoice()));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      try {
        viewer.flyToText(this.paste.value);
        setText(this.pasteError, "");
      } catch (error) {
        setText(this.pasteError, error.message);
      }
    });
    return [h("div", {class: "camera-row"}, this.cameraText, this.copyPlace), form];
  }

  viewsChoice() {
    const views = this.viewer.manifest.views ?? {};
    if (Object.keys(views).length === 0) return null;
    const choice =
        h("select", {class: "small", "aria-label": "Named view"},
          h("option", {value: ""}, "Named view…"),
          Object.keys(views).map((name) => h("option", {value: name}, name)));
    choice.addEventListener("change", () => {
      if (choice.value) this.viewer.flyTo(this.viewer.namedPlacement(choice.value));
      choice.value = "";
    });
    return choice;
  }

  makeBoxButton() {
    return h(
        "button", {
          type: "button",
          class: "small",
          on: {click: () => this.viewer.setOptions({clip: this.pick.box()})}
        },
        "Box of the two picks");
  }
  showBoxButton() {
    if (this.boxButton) this.boxButton.hidden = this.pick.box() === null;
  }

  detailPart() {
    const {viewer, levels} = this;
    this.level = h("input", {
      type: "range",
      min: "1",
      max: String(levels),
      step: "1",
      on: {input: () => viewer.setOptions({level: Number(this.level.value)})}
    });
    this.levelNote = h("output", {class: "faint"});
    this.wire =
        h("select", {
          on: {
            change: () =>
                viewer.setOptions({wire: this.wire.value === "" ? null : Number(this.wire.value)})
          }
        },
          h("option", {value: ""}, "none"),
          Array.from(
              {length: levels + 1},
              (_, level) =>
                  h("option", {value: String(level)},
                    `level ${level}: edge ${countText(2 ** (levels - level))}`)));
    this.switches = {};
    return [
      field("Finest level", this.level),
      this.levelNote,
      field("Wireframe of octree cubes", this.wire),
      ...[["color", "Colors"], ["occlusion", "Ambient occlusion"],
          ["shadows", "Shadows of the sun"]]
          .map(([name, label]) => {
            if (name === "color" && !viewer.manifest.colors) return null;
            const box = this.switches[name] = h("input", {
              type: "checkbox",
              id: `switch-${name}`,
              on: {change: () => viewer.setOptions({[name]: box.checked})}
            });
            return h("div", {class: "check"}, box, h("label", {for: `switch-${name}`
                     }, label));
          }),
    ];
  }

  showCamera(text) {
    if (this.cameraText.textContent === text) return;
    clear(this.cameraText, breakable(text));
    clear(this.copyPlace, copyButton(text, "the camera"));
  }

  showOptions({level, wire, clip, ...switched}) {
    this.level.value = String(level);
    setText(
        this.levelNote,
        level === this.levels ? "single voxels" :
                                `cubes of ${countText(2 ** (this.levels - level))} voxels`);
    this.level.setAttribute("aria-valuetext", this.levelNote.textContent);
    this.wire.value = wire === null ? "" : String(wire);
    this.clip.set(clip);
    for (const [name, box] of Object.entries(this.switches)) box.checked = switched[name];
  }

  showStatistics(s) {
    if (!this.statistics.closest("details").open) return;
    const rows = [
      ["Frames per second", s.fps >= 10 ? s.fps.toFixed(0) : s.fps.toFixed(1)],
      ["Picture", `${s.internalWidth} × ${s.internalHeight}`],
      ["Rays per frame", countText(s.rays)],
      ["Steps per ray", `${s.stepsMean.toFixed(1)}; 99 % within ${Math.round(s.steps99)}`],
      ["Tiles", `${countText(s.tiles)}${s.loading ? `, ${countText(s.loading)} loading` : ""}`],
      ...(this.viewer.manifest.colors ? [["Color pages", countText(s.colorPages)]] : []),
      [
        "Memory for tiles",
        `${sizeText(s.poolBytes + s.colorPoolBytes)} of ${sizeText(s.budgetBytes)}`
      ],
      ["Memory for pictures", sizeText(s.targetBytes)],
      ["Received", sizeText(s.fetchedBytes)],
      ["Failed requests", countText(s.failed)],
      ["Compiling the shaders", `${Math.round(s.compileMs)} ms`],
      ["First picture", s.firstPictureMs === null ? "–" : `${Math.round(s.firstPictureMs)} ms`],
    ];
    clear(this.statistics, rows.map(([name, value]) => fact(name, value)));
  }
}

// Returns elements that show `text`. The browser can break lines only after spaces and commas,
// never in a number or a name.
function breakable(text) {
  return text.split(/(?<=[ ,])/)
      .flatMap(
          (piece) =>
              [h("span", {class: "unbroken"}, piece.trimEnd()), piece.endsWith(" ") && " ",
               h("wbr", {})]);
}

function part(title, content, open = false) {
  return h(
      "details", {class: "panel-part", open}, h("summary", {}, h("h2", {}, title)),
      h("div", {class: "stack"}, content));
}
