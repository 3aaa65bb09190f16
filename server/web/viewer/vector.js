// Vectors are arrays of three doubles.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, by) => [a[0] * by, a[1] * by, a[2] * by];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const distance = (a, b) => length(subtract(a, b));
export const normalize = (a) => scale(a, 1 / length(a));
export const cross =
    (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const mix = (a, b, share) => add(scale(a, 1 - share), scale(b, share));

// Returns the unit vectors {forward, right, up} of a picture that is taken in a direction. `above`
// is the direction up in the scene. If `direction` is straight down or up, the picture's up vector
// is -z or z.
export function pictureAxes(direction, above = [0, 1, 0]) {
  const forward = normalize(direction),
        vertical = Math.abs(dot(forward, normalize(above))) > 1 - 1e-9;
  const right = normalize(cross(forward, vertical ? [0, 0, forward[1] < 0 ? -1 : 1] : above));
  return {forward, right, up: cross(right, forward)};
}

// Returns the unit direction of the ray through a point of the picture. x and y are the distances
// to the right of the center and above it, for a picture at distance 1.
export function pictureDirection({forward, right, up}, x, y) {
  return normalize(add(forward, add(scale(right, x), scale(up, y))));
}
