// Adapts the camera of a named view to the shape of the picture.

import {add, dot, normalize, scale, subtract} from "./vector.js";

// Aspect ratios for which the manifest has cameras: `views` and `tall_views`.
const kWideAspect = 16 / 9, kTallAspect = 1 / 2;

// Returns the placement of a view that shows the complete scene in a picture with this aspect
// ratio. `wide` and `tall` are the view's placements for kWideAspect and kTallAspect. `box` is the
// scene's box. All positions are in voxels.
//
// A point fits the picture's width if the eye is at least s + x / aspect away, where s is the
// point's position along the view and x depends on its position across the view. So the distance
// for one aspect ratio limits the distance for another one, if s is limited by the box.
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
