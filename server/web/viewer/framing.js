// Adapts the camera of a named view to the aspect ratio of the picture.

import {add, dot, normalize, scale, subtract} from "./vector.js";

// Aspect ratios (width / height) of the cameras in the manifest: kWideAspect for `views`,
// kTallAspect for `tall_views`.
const kWideAspect = 16 / 9, kTallAspect = 1 / 2;

// Returns a placement of the camera that shows the complete scene in a picture with this aspect
// ratio. `wide` and `tall` are the placements of the same view for kWideAspect and kTallAspect.
// `box` is the box of the scene. All positions are in voxels.
//
// The view direction is fixed, so only the distance of the eye changes. All positions below are
// along the axis from the target to the eye. A point of the scene at the position s fits the width
// of the picture if the eye is at s + x / aspect or farther, where x depends only on the position
// of the point across the axis. With `tall`, the eye is at tallAt, so a point that touches the side
// of the picture has x = (tallAt - s) * kTallAspect. For another aspect ratio, the eye must be at s
// + (tallAt - s) * kTallAspect / aspect. The s of these points is unknown, so `limit` replaces it:
// the s in the box for which the eye must be farthest. If `aspect` is less than kTallAspect, this
// is the lowest s, otherwise the highest s.
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
