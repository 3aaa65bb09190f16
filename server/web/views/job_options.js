// The resolution and the options of a job. They are the same as on the command line.

import {Problem} from "../lib/api.js";
import {field, h} from "../lib/dom.js";
import {gridText} from "../lib/format.js";

const kMinLevel = 2, kMaxLevel = 20;
const kDefaultLevel = 11;
const kAutomatic = ["", "Automatic"];
const kAttributes = {
  alpha: "Alpha",
  normal: "Normals",
  material: "Materials"
};

// The form fields of all options; `on` has their event listeners. The keys of `options` are the
// names of the options in a request. An option is sent if its field is not empty.
class Fields {
  constructor(on) {
    this.on = on;
    this.resolution = this.choice(gridChoices(kMinLevel, kMaxLevel));
    this.resolution.value = String(2 ** kDefaultLevel);
    this.priority = this.number({min: "-100", max: "100", step: "1", placeholder: "0"});
    this.cube = this.choice(
        [["", "Bounds of the scene"], ["bounds", "Corner and edge"], ["voxel_size", "Voxel size"]]);
    this.bounds = ["X", "Y", "Z", "Edge"].map(
        (name) => this.number({step: "any", "aria-label": `Bounds: ${name}`, placeholder: name}));
    this.flags = {
      skip_invalid: this.checkBox("skip-invalid"),
      thin: this.checkBox("thin"),
      color: this.checkBox("color"),
      strict: this.checkBox("strict"),
      allow_empty: this.checkBox("allow-empty"),
    };
    this.attributes =
        Object.keys(kAttributes).map((name) => this.checkBox(`attribute-${name}`, name));
    this.options = {
      voxel_size: this.number({step: "any", min: "0"}),
      point_radius: this.number({step: "any", min: "0", placeholder: "one voxel"}),
      columns: h("input", {placeholder: "x,y,z,r,g,b", autocomplete: "off", on}),
      ignore_extension: h("input", {placeholder: "ACME_bent, …", autocomplete: "off", on}),
      cutouts: this.choice([kAutomatic, ["skip", "Leave out"], ["keep", "Keep"]]),
      solid: this.choice([
        ["", "Surface only"], ["winding", "By winding"], ["parity", "By parity"],
        ["enclosed", "Enclosed space"]
      ]),
      seed: h("input", {placeholder: "X,Y,Z", autocomplete: "off", on}),
      radius: this.number({min: "0", max: "16", step: "1", placeholder: "0"}),
      order: this.choice([["", "By hash"], ["first-parent", "By first parent"]]),
      color_resolution: this.choice([kAutomatic, ...gridChoices(kMinLevel, kMaxLevel)]),
      hash_bits: this.number({min: "4", max: "64", step: "1", placeholder: "64"}),
      memory: h("input", {placeholder: "2GiB", autocomplete: "off", on}),
      threads: this.number({min: "1", max: "1024", step: "1", placeholder: "default"}),
      subvolume: this.choice([kAutomatic, ...gridChoices(6, 14)]),
      backend: this.choice([
        kAutomatic, ["cpu", "CPU"], ["cuda", "CUDA"], ["parallel-host", "GPU pipeline on the CPU"]
      ]),
      method: this.choice(
          [kAutomatic, ["consing", "Consing"], ["pointers", "Pointers"], ["hashes", "Hashes"]]),
    };
  }

  number(attributes) {
    return h("input", {type: "number", ...attributes, on: this.on});
  }
  checkBox(id, value = null) {
    return h("input", {type: "checkbox", id, value, on: this.on});
  }
  choice(entries) {
    return h("select", {on: this.on}, entries.map(([value, text]) => h("option", {value}, text)));
  }
}

export class JobOptions {
  constructor(changed) {
    const fields = this.fields = new Fields({
      change: () => {
        this.showRows();
        changed();
      }
    });
    this.resolutionField =
        field("Resolution", fields.resolution, "Voxels along each edge of the cube.");
    this.colorSwitch = checkRow(fields.flags.color, "Colors of the scene");
    this.element =
        h("details", {class: "card"}, h("summary", {}, h("h2", {}, "Options")),
          h("div", {class: "options"}, this.geometryPart(), this.runPart()));
    this.showRows();
  }

  geometryPart() {
    const {cube, bounds, flags, attributes, options} = this.fields;
    const boundsAttributes = {class: "field", role: "group", "aria-label": "Bounds"};
    this.boundsRow =
        h("div", boundsAttributes, h("span", {class: "label"}, "Low corner and edge"),
          h("div", {class: "four"}, bounds));
    this.sizeRow = field("Edge of a voxel", options.voxel_size, "In the scene's units.");
    this.colorRow = field(
        "Color grid", options.color_resolution,
        "At most the resolution; finer voxels have the color of their cell.");
    return h(
        "fieldset", {}, h("legend", {}, "Geometry: determines the result"), field("Cube", cube),
        this.boundsRow, this.sizeRow,
        field(
            "Point radius", options.point_radius, "Draws each point as a cube of this half edge."),
        field("Columns", options.columns, "Names of the columns of text files with points."),
        field(
            "Ignored extensions", options.ignore_extension,
            "Required extensions of glTF files to read without."),
        field("Cutouts", options.cutouts, "Parts of surfaces that alpha makes invisible."),
        field("Interior", options.solid, "Also sets the voxels inside the surface."),
        field("Seed", options.seed, "A point: fills only the enclosed space around it."),
        field("Radius", options.radius, "Seals gaps of up to this many voxels."),
        checkRow(flags.skip_invalid, "Skip invalid triangles"), checkRow(flags.thin, "Thin voxels"),
        attributes.map((input) => checkRow(input, kAttributes[input.value])), this.colorRow,
        field("Node order", options.order, "By first parent: faster to view."),
        field("Hash bits", options.hash_bits));
  }

  runPart() {
    const {priority, flags, options: {memory, threads, subvolume, backend, method}} = this.fields;
    return h(
        "fieldset", {}, h("legend", {}, "Run: does not affect the result"),
        field("Memory", memory, "For example 512MiB or 8GiB."), field("Threads", threads),
        field("Subvolumes", subvolume), field("Backend", backend), field("Method", method),
        checkRow(flags.strict, "Treat warnings about the scene as errors"),
        checkRow(flags.allow_empty, "Allow a result without voxels"),
        field("Priority", priority, "Higher runs earlier; -100 to 100."));
  }

  showRows() {
    const cube = this.fields.cube.value;
    this.colorRow.hidden = !this.hasCells();
    this.boundsRow.hidden = cube !== "bounds";
    this.sizeRow.hidden = cube !== "voxel_size";
  }

  // True if the form requests colors or other attributes of cells.
  hasCells() {
    return [this.fields.flags.color, ...this.fields.attributes].some((input) => input.checked);
  }

  // Returns {resolution, priority?, options?}. Throws Problem for an invalid field.
  values() {
    const {resolution, priority} = this.fields, options = this.optionValues();
    return {
      resolution: Number(resolution.value),
      ...(priority.value && {priority: numberOf(priority, "The priority")}),
      ...(Object.keys(options).length && {options})
    };
  }

  optionValues() {
    const {cube, bounds, flags, attributes, options: inputs} = this.fields;
    const hidden = {voxel_size: cube.value !== "voxel_size", color_resolution: !this.hasCells()};
    const chosen = attributes.filter((input) => input.checked).map((input) => input.value);
    const values = {
      ...(cube.value === "bounds" &&
          {bounds: bounds.map((input) => numberOf(input, "The bounds"))}),
      ...Object.fromEntries(
          Object.entries(flags).filter(([, input]) => input.checked).map(([name]) => [name, true])),
      ...(chosen.length && {attributes: chosen}),
    };
    for (const [name, input] of Object.entries(inputs)) {
      const isRequired = name === "voxel_size";
      if (!hidden[name] && (isRequired || input.value.trim())) values[name] = valueOf(name, input);
    }
    return values;
  }

  // Fills the form with the options of a job.
  set({resolution, priority, options = {}}) {
    const {fields} = this, attributes = [options.attributes ?? []].flat();
    fields.resolution.value = String(resolution);
    if (priority) fields.priority.value = String(priority);
    fields.cube.value = options.bounds ? "bounds" : options.voxel_size ? "voxel_size" : "";
    options.bounds?.forEach((value, i) => fields.bounds[i].value = String(value));
    for (const [name, input] of Object.entries(fields.flags))
      input.checked = Boolean(options[name]) || attributes.includes(name);
    for (const input of fields.attributes) input.checked = attributes.includes(input.value);
    for (const [name, input] of Object.entries(fields.options))
      if (options[name] !== undefined) input.value = String(options[name]);
    this.showRows();
    this.element.open = Object.keys(options).length > 0;
  }
}

function gridChoices(minLevel, maxLevel) {
  const edges = Array.from({length: maxLevel - minLevel + 1}, (_, i) => 2 ** (minLevel + i));
  return edges.map((edge) => [edge, gridText(edge)]);
}

function checkRow(input, label) {
  return h("div", {class: "check"}, input, h("label", {for: input.id
           }, label));
}

// Returns the value of an option, in the form that a request needs.
function valueOf(name, input) {
  if (["memory", "backend", "method", "columns", "cutouts", "solid"].includes(name))
    return input.value.trim();
  if (name === "ignore_extension") return input.value.split(",").map((text) => text.trim());
  if (name === "seed") return pointOf(input);
  return numberOf(input, `The ${name.replace("_", " ")}`);
}

// Returns a point "X,Y,Z" as three numbers.
function pointOf(input) {
  const texts = input.value.split(",").map((text) => text.trim());
  const point = texts.map(Number);
  if (point.length !== 3 || texts.includes("") || !point.every(Number.isFinite))
    throw new Problem(0, "invalid_input", "The seed: expected three numbers X,Y,Z");
  return point;
}

function numberOf(input, what) {
  if (input.value.trim() === "" || !input.validity.valid)
    throw new Problem(
        0, "invalid_input", `${what}: ${input.validationMessage || "a number is missing"}`);
  return Number(input.value);
}
