// Adapts the camera of a named view to the aspect ratio of the picture.

import {add, dot, normalize, scale, subtract} from "./vector.js";

// Aspect ratios (width / height) of the cameras in the manifest: kWideAspect for `views`,
// kTallAspect for `tall_views`.
const kWideAspect = 16 / 9, kTallAspect = 1 / 2;

// Returns a placement of the camera that shows the complete scene in a picture with this aspect
// ratio. `wide` and `tall` are the placements of the same view for kWideAspect and kTallAspect.
// `box` is the box of the scene. All positions are in voxels.
//
// The view direction is fixed, so only the distance of the eye changes. Let s be the position of a
// point of the scene on the axis from the target to the eye. The point fits the width of the
// picture if the eye is at s + x / aspect or beyond, where x depends only on the position of the
// point across this axis. For a smaller aspect ratio than kTallAspect, the eye must move back, and
// a point with the lowest s moves it the most. For a larger one, the eye may move forward, and a
// point with the highest s allows the least. The points that touch the sides of the picture are
// unknown, so `limit`, the lowest or highest s of the box, replaces their s.
export function framed(wide, tall, box, aspect) {
  if (!tall || !box || aspect >= kWideAspect) return wide;
  const back = normalize(subtract(wide.eye, wide.target));
  const depths = cornersOf(box).map((corner) => dot(corner, back));
  const limit = aspect >= kTallAspect ? Math.max(...depths) : Math.min(...depths);
  const wideAt = dot(wide.eye, back), tallAt = dot(tall.eye, back);
  const neededAt = limit + (tallAt - limit) * kTallAspect / aspect;
  if (neededAt <= wideAt) return wide;
  return {...tall, eye: add(tall.eye, scale(back, neededAt - tallAt))};
}

function cornersOf({low, high}) {
  return Array.from(
      {length: 8}, (_, corner) => low.map((c, axis) => corner >> axis & 1 ? high[axis] : c));
}
