// The camera as text: as the options of `voxdag render`, in scene units, and as a URL fragment.

const kDigits = 4;  // of a voxel, after the point

const number_text = (value) => String(Number(value.toPrecision(6)));

export class GridSpace {
  constructor({resolution, origin, edge}) {
    Object.assign(this, {resolution, origin, edge});
    this.decimals = Math.min(Math.max(Math.ceil(-Math.log10(edge / resolution)) + kDigits, 0), 20);
  }
  // A point in voxels as text in scene units.
  text(point) {
    return this.to_scene(point).map((c) => String(Number(c.toFixed(this.decimals)))).join(",");
  }
  to_scene(point) {
    return point.map((c, axis) => this.origin[axis] + c * this.edge / this.resolution);
  }
  to_voxels(point) {
    return point.map((c, axis) => (c - this.origin[axis]) * this.resolution / this.edge);
  }
  // From {position, target, fov_degrees} of the manifest, in scene units.
  placement({position, target, fov_degrees}) {
    return {eye: this.to_voxels(position), target: this.to_voxels(target), fov_degrees};
  }
}

// "--camera 1,2,3 --target 4,5,6 --fov 35"
export function camera_text(space, {eye, target, fov_degrees}) {
  return `--camera ${space.text(eye)} --target ${space.text(target)} ` +
         `--fov ${number_text(fov_degrees)}`;
}

// Reads camera_text(), also from the middle of a command. Throws an Error that says what is missing.
export function parse_camera_text(space, text, default_fov) {
  const option = (name) => new RegExp(`(?:^|\\s)--${name}[\\s=]+["']?([^\\s"']+)`).exec(text)?.[1];
  return parse_camera(space, option("camera"), option("target"), option("fov"), default_fov);
}

export function camera_fragment(space, {eye, target, fov_degrees}) {
  return {camera: space.text(eye), target: space.text(target), fov: number_text(fov_degrees)};
}

// From the members of a fragment; null if it has no camera.
export function parse_camera_fragment(space, members, default_fov) {
  if (!members.has("camera")) return null;
  return parse_camera(space, members.get("camera"), members.get("target"), members.get("fov"), default_fov);
}

function parse_camera(space, eye, target, fov, default_fov) {
  return {eye: parse_point(space, eye, "--camera"), target: parse_point(space, target, "--target"),
          fov_degrees: fov ? parse_number(fov, "--fov") : default_fov};
}

function parse_point(space, text, name) {
  const parts = (text ?? "").split(",");
  if (parts.length !== 3) throw new Error(`Expected ${name} X,Y,Z.`);
  return space.to_voxels(parts.map((part) => parse_number(part, name)));
}

function parse_number(text, name) {
  const value = Number(text);
  if (text.trim() === "" || !Number.isFinite(value)) throw new Error(`${name}: "${text}" is not a number.`);
  return value;
}

// "&"-joined, with the commas legible.
export function fragment_text(members) {
  return Object.entries(members).filter(([, value]) => value !== null && value !== undefined)
               .map(([name, value]) => `${name}=${encodeURIComponent(value).replace(/%2C/g, ",")}`).join("&");
}
