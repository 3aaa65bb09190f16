// The resolution and the options of a job, the same as on the command line.

import {Problem} from "../lib/api.js";
import {field, h} from "../lib/dom.js";
import {gridText} from "../lib/format.js";

const kMinLevel = 2, kMaxLevel = 20;
const kDefaultLevel = 11;

export class JobOptions {
  constructor(changed) {
    const watch = {on: {change: changed}};
    const number = (attributes) => h("input", {type: "number", ...attributes, ...watch});
    const choice = (...options) =>
        h("select", watch, options.map(([value, text]) => h("option", {value}, text)));
    const powers = (from, to) => Array.from({length: to - from + 1}, (_, i) => 2 ** (from + i));
    this.resolution = choice(...powers(kMinLevel, kMaxLevel).map((r) => [r, gridText(r)]));
    this.resolution.value = String(2 ** kDefaultLevel);
    this.resolutionField =
        field("Resolution", this.resolution, "Voxels along each edge of the cube.");

    this.cube = choice(
        ["", "Bounds of the scene"], ["bounds", "Corner and edge"], ["voxel_size", "Voxel size"]);
    this.bounds = ["X", "Y", "Z", "Edge"].map(
        (name) => number({step: "any", "aria-label": `Bounds: ${name}`, placeholder: name}));
    this.voxel_size = number({step: "any", min: "0"});
    this.boundsRow = h(
        "div", {class: "field", role: "group", "aria-label": "Bounds"},
        h("span", {class: "label"}, "Low corner and edge"), h("div", {class: "four"}, this.bounds));
    this.sizeRow = field("Edge of a voxel", this.voxel_size, "In the scene's units.");
    this.skip_invalid = h("input", {type: "checkbox", id: "skip-invalid", ...watch});
    this.color = h("input", {type: "checkbox", id: "color", ...watch});
    this.attributes = ["alpha", "normal", "material"].map(
        (name) => h("input", {type: "checkbox", id: `attribute-${name}`, value: name, ...watch}));
    this.color_resolution =
        choice(["", "Automatic"], ...powers(kMinLevel, kMaxLevel).map((k) => [k, gridText(k)]));
    this.colorRow = field(
        "Color grid", this.color_resolution,
        "At most the resolution; finer voxels have the color of their cell.");
    this.hash_bits = number({min: "4", max: "64", step: "1", placeholder: "64"});
    this.memory = h("input", {placeholder: "2GiB", autocomplete: "off", ...watch});
    this.threads = number({min: "1", step: "1", placeholder: "default"});
    this.subvolume =
        choice(["", "Automatic"], ...powers(6, 14).map((edge) => [edge, gridText(edge)]));
    this.backend = choice(
        ["", "Automatic"], ["cpu", "CPU"], ["cuda", "CUDA"],
        ["parallel-host", "GPU pipeline on the CPU"]);
    this.method = choice(
        ["", "Automatic"], ["consing", "Consing"], ["pointers", "Pointers"], ["hashes", "Hashes"]);
    this.priority = number({min: "-100", max: "100", step: "1", placeholder: "0"});
    this.cube.addEventListener("change", () => this.showRows());
    for (const input of [this.color, ...this.attributes])
      input.addEventListener("change", () => this.showRows());
    this.element =
        h("details", {class: "card"}, h("summary", {}, h("h2", {}, "Options")),
          h("div", {class: "options"},
            h("fieldset", {}, h("legend", {}, "Geometry: determines the result"),
              field("Cube", this.cube), this.boundsRow, this.sizeRow,
              h("div", {class: "check"}, this.skip_invalid,
                h("label",
                  {for: "skip-invalid"
                  },
                  "Skip invalid triangles")),
              h("div", {class: "check"}, this.color,
                h("label",
                  {for: "color"
                  },
                  "Colors of the scene")),
              this.attributes.map(
                  (input, i) =>
                      h("div", {class: "check"}, input,
                        h("label",
                          {for: input.id
                          },
                          ["Alpha", "Normals", "Materials"][i]))),
              this.colorRow, field("Hash bits", this.hash_bits)),
            h("fieldset", {}, h("legend", {}, "Run: does not affect the result"),
              field("Memory", this.memory, "For example 512MiB or 8GiB."),
              field("Threads", this.threads), field("Subvolumes", this.subvolume),
              field("Backend", this.backend), field("Method", this.method),
              field("Priority", this.priority, "Higher runs earlier; -100 to 100."))));
    this.showRows();
  }

  showRows() {
    this.colorRow.hidden = !this.hasCells();
    this.boundsRow.hidden = this.cube.value !== "bounds";
    this.sizeRow.hidden = this.cube.value !== "voxel_size";
  }

  // True if cells have colors or other attributes.
  hasCells() {
    return [this.color, ...this.attributes].some((input) => input.checked);
  }

  // {resolution, priority?, options?}
  values() {
    const options = {};
    if (this.cube.value === "bounds")
      options.bounds = this.bounds.map((input) => numberOf(input, "The bounds"));
    if (this.cube.value === "voxel_size")
      options.voxel_size = numberOf(this.voxel_size, "The voxel size");
    if (this.skip_invalid.checked) options.skip_invalid = true;
    if (this.color.checked) options.color = true;
    const attributes = this.attributes.filter((input) => input.checked).map((input) => input.value);
    if (attributes.length) options.attributes = attributes;
    if (this.hasCells() && this.color_resolution.value)
      options.color_resolution = Number(this.color_resolution.value);
    if (this.hash_bits.value) options.hash_bits = numberOf(this.hash_bits, "The hash bits");
    if (this.memory.value.trim()) options.memory = this.memory.value.trim();
    if (this.threads.value) options.threads = numberOf(this.threads, "The threads");
    if (this.subvolume.value) options.subvolume = Number(this.subvolume.value);
    if (this.backend.value) options.backend = this.backend.value;
    if (this.method.value) options.method = this.method.value;
    return {
      resolution: Number(this.resolution.value),
      ...(this.priority.value && {priority: numberOf(this.priority, "The priority")}),
      ...(Object.keys(options).length && {options})
    };
  }

  // Copies the options of a job.
  set({resolution, priority, options = {}}) {
    this.resolution.value = String(resolution);
    if (priority) this.priority.value = String(priority);
    this.cube.value = options.bounds ? "bounds" : options.voxel_size ? "voxel_size" : "";
    options.bounds?.forEach((value, i) => {
      this.bounds[i].value = String(value);
    });
    this.skip_invalid.checked = Boolean(options.skip_invalid);
    const given = [options.attributes ?? []].flat();
    this.color.checked = Boolean(options.color) || given.includes("color");
    for (const input of this.attributes) input.checked = given.includes(input.value);
    for (const name
             of ["voxel_size", "color_resolution", "hash_bits", "memory", "threads", "subvolume",
                 "backend", "method"])
      if (options[name] !== undefined) this[name].value = String(options[name]);
    this.showRows();
    this.element.open = Object.keys(options).length > 0;
  }
}

function numberOf(input, what) {
  if (input.value.trim() === "" || !input.validity.valid)
    throw new Problem(
        0, "invalid_input", `${what}: ${input.validationMessage || "a number is missing"}`);
  return Number(input.value);
}
