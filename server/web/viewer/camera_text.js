// Converts a camera to text and back: to the options of `voxdag render`, in scene units, and to the
// members of a URL fragment.

const kDigits = 3;  // decimal places of a position in voxels

const numberText = (value) => String(Number(value.toPrecision(6)));

export class GridSpace {
  constructor({resolution, origin, edge}) {
    Object.assign(this, {resolution, origin, edge});
    this.decimals = Math.min(Math.max(Math.ceil(-Math.log10(edge / resolution)) + kDigits, 0), 20);
  }
  // Returns a point in voxels as text in scene units.
  text(point) {
    return this.toScene(point).map((c) => String(Number(c.toFixed(this.decimals)))).join(",");
  }
  toScene(point) {
    return point.map((c, axis) => this.origin[axis] + c * this.edge / this.resolution);
  }
  toVoxels(point) {
    return point.map((c, axis) => (c - this.origin[axis]) * this.resolution / this.edge);
  }
  // Returns a placement in voxels for {position, target, fov_degrees} of the manifest, in scene
  // units.
  placement({position, target, fov_degrees}) {
    return {eye: this.toVoxels(position), target: this.toVoxels(target), fovDegrees: fov_degrees};
  }
}

// Returns the options of `voxdag render` for a camera: "--camera 1,2,3 --target 4,5,6 --fov 35".
export function cameraText(space, {eye, target, fovDegrees}) {
  return `--camera ${space.text(eye)} --target ${space.text(target)} ` +
      `--fov ${numberText(fovDegrees)}`;
}

// Parses text from cameraText(), even if it is in the middle of a command. Throws an Error that
// names the missing option.
export function parseCameraText(space, text, defaultFov) {
  const option = (name) => new RegExp(`(?:^|\\s)--${name}[\\s=]+["']?([^\\s"']+)`).exec(text)?.[1];
  return parseCamera(space, option("camera"), option("target"), option("fov"), defaultFov);
}

// Returns the member of a URL fragment for a camera: "c", with the coordinates of the camera, the
// coordinates of the target, and the field of view.
export function cameraFragment(space, {eye, target, fovDegrees}) {
  return {c: [space.text(eye), space.text(target), numberText(fovDegrees)].join(",")};
}

// Returns the texts {camera, target, fov} of the camera in the members of a URL fragment. They are
// in one member, "c", or in the members "camera", "target" and "fov". Returns null if the members
// contain no camera.
export function cameraTexts(members) {
  if (members.has("c")) {
    const parts = members.get("c").split(","), text = (from, to) => parts.slice(from, to).join(",");
    return {camera: text(0, 3), target: text(3, 6), fov: text(6)};
  }
  if (!members.has("camera")) return null;
  return {camera: members.get("camera"), target: members.get("target"), fov: members.get("fov")};
}

// Parses a camera from the members of a URL fragment; null if the members contain no camera.
export function parseCameraFragment(space, members, defaultFov) {
  const texts = cameraTexts(members);
  return texts && parseCamera(space, texts.camera, texts.target, texts.fov, defaultFov);
}

function parseCamera(space, eye, target, fov, defaultFov) {
  return {
    eye: parsePoint(space, eye, "--camera"),
    target: parsePoint(space, target, "--target"),
    fovDegrees: fov ? parseNumber(fov, "--fov") : defaultFov
  };
}

function parsePoint(space, text, name) {
  const parts = (text ?? "").split(",");
  if (parts.length !== 3)
    throw new Error(`${name} is missing or is not three numbers. Expected ${name} X,Y,Z.`);
  return space.toVoxels(parts.map((part) => parseNumber(part, name)));
}

function parseNumber(text, name) {
  const value = Number(text);
  if (text.trim() === "" || !Number.isFinite(value))
    throw new Error(`${name}: "${text}" is not a number.`);
  return value;
}

// Returns the members as the text of a URL fragment, NAME=VALUE joined with "&". Keeps commas
// unescaped, so that points remain readable.
export function fragmentText(members) {
  return Object.entries(members)
      .filter(([, value]) => value !== null && value !== undefined)
      .map(([name, value]) => `${name}=${encodeURIComponent(value).replace(/%2C/g, ",")}`)
      .join("&");
}
