// GLSL source: reads the words of the pool, and descends through the DAG along one ray, like
// query/rays/ray_walk.h.
//
// The ray is mirrored so that its direction is positive on every axis. Voxel coordinates are
// integers, and a ray begins at an integer voxel plus a fraction. The ray's parameter t at a plane
// is always computed by the same function, time_of, from the difference of two integers. So its
// error does not grow along the ray, for any grid up to 2^20 and any position of the camera. The
// cells on both sides of a plane get the same t to the last bit, so there are no cracks.

export const kPrecision = `
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
`;

const kMaxSteps = 4096;

// Uniforms of the pool, and of all rays of a picture.
const kPoolSource = `
uniform usampler2D u_pool, u_table;
uniform uint u_root;  // pointer to the root (see tiles/tile_format.js)
uniform int u_levels;        // the grid has 2^u_levels voxels per edge
uniform uint u_boundaries;   // bit s: nodes with 2^s voxels per edge are the roots of tiles
uniform ivec3 u_clip_low, u_clip_high;
// In voxels. Cells up to x wide are always hit as one cell, and cells wider than y never.
uniform vec2 u_cell_sizes;

uvec4 texel(uint address) {
  return texelFetch(u_pool, ivec2(address & 4095u, address >> 12), 0);
}

// Returns the pointer to the root of the slot's tile, or 0 if the tile is not loaded.
uint tile_of(uint slot) {
  return slot == 0u ? 0u : texelFetch(u_table, ivec2(slot & 1023u, slot >> 10), 0).x;
}

uint popcount8(uint x) {
  x -= x >> 1 & 0x55u;
  x = (x & 0x33u) + (x >> 2 & 0x33u);
  return (x + (x >> 4)) & 15u;
}

uint child_pointer(uint node, uint child) {
  uint rank = popcount8(node & ((1u << child) - 1u));
  uvec4 pointers = texel((node >> 8) + (rank >> 2));
  return (rank & 2u) == 0u ? ((rank & 1u) == 0u ? pointers.x : pointers.y)
                           : ((rank & 1u) == 0u ? pointers.z : pointers.w);
}
`;

export const kRaySource = `${kPoolSource}
struct Hit {
  float t;
  int scale;       // the cell has 2^scale voxels per edge
  int axis;        // axis of the face through which the ray enters; -1: the ray begins in the cell
  uint missing;  // texel of the cut-off node (tile_format.js) whose tile is missing; 0: none
};

ivec3 ray_base;
vec3 ray_shift, ray_inverse;
uint ray_mirror;
int step_count = 0;
uint random_state = 1u;
uint entered_count = 0u, entered_slot = 0u;  // slot of a random tile among all entered tiles
#ifdef WIRE
uniform int u_wire_scale;  // scale of the cubes whose edges are drawn; -1: none
uniform float u_wire_width;  // half the width of a line at distance 1
uniform vec2 u_wire_fade;     // distance at which lines begin to fade, and 1 / length of the fade
float wire = 0.0;  // opacity of the lines at the pixel, 0 to 1
const float kFront = 0.4;                   // a line's opacity factor per cube behind it
const float kHidden = 4.0, kClear = 20.0;  // cube edges in pixels: no lines below, full lines above
#endif
#ifdef CELL
ivec3 hit_cell = ivec3(0);   // low corner of the cell that was hit
#endif
#ifdef PICK
uint picked_slots[21];
#endif

// Begins a ray at cell + part, in voxels. Direction components below 1e-18 in size count as 1e-18.
void set_ray(ivec3 cell, vec3 part, vec3 direction) {
  ivec3 negative = ivec3(lessThan(direction, vec3(0)));
  ray_base = cell + negative * ((1 << u_levels) - 2 * cell);
  ray_shift = part * vec3(2 * negative - 1);
  ray_inverse = 1.0 / max(abs(direction), vec3(1e-18));
  ray_mirror = uint(negative.x << 2 | negative.y << 1 | negative.z);
}

vec3 time_of(ivec3 plane) {
  return (vec3(plane - ray_base) + ray_shift) * ray_inverse;
}

uint child_at(ivec3 position, int scale) {
  ivec3 bits = position >> scale & 1;
  return uint(bits.x << 2 | bits.y << 1 | bits.z) ^ ray_mirror;
}

int nearest_axis(vec3 next) {
  return next.x <= next.y ? (next.x <= next.z ? 0 : 2) : (next.y <= next.z ? 1 : 2);
}

void note_tile(uint slot) {
  random_state = random_state * 1664525u + 1013904223u;
  ++entered_count;
  if ((random_state >> 8) % entered_count == 0u) entered_slot = slot;
}

#ifdef WIRE
// Updates the variable wire when the ray enters an occupied cell of the scale u_wire_scale. The ray
// hits a line if it enters close to an edge of the cell's face. Lines fade with their distance, and
// where cubes are only a few pixels wide. They also fade with each further cube that the ray enters
// behind them, because they would hide the surface otherwise.
void note_wire(ivec3 position, int scale, int axis, float t) {
  if (scale != u_wire_scale || axis < 0) return;
  wire *= kFront;
  vec3 inward = (t - time_of(position)) / ray_inverse;
  vec3 outward = (time_of(position + (1 << scale)) - t) / ray_inverse;
  vec3 nearest = min(inward, outward);
  nearest += vec3(equal(ivec3(axis), ivec3(0, 1, 2))) * 1e30;
  if (min(nearest.x, min(nearest.y, nearest.z)) >= u_wire_width * t) return;
  float pixels = float(1 << scale) / (u_wire_width * t);
  wire = max(wire, smoothstep(kHidden, kClear, pixels) *
                       exp(-2.0 * max(0.0, t - u_wire_fade.x) * u_wire_fade.y));
}
#endif

// Finds the first occupied cell between t_min and t_max; returns false if no cell is hit. The cone
// around the ray is cone.x + cone.y * t wide. An occupied cell that is no wider than the cone is
// hit as one cell, without a descent to finer cells (within the limits of u_cell_sizes). If a tile
// is not loaded, the finest cells of its coarse brick (tile_format.js) are also hit as one cell.
bool trace(float t_min, float t_max, vec2 cone, out Hit hit) {
  int edge = 1 << u_levels;
  ivec3 mirrored = ivec3(ray_mirror >> 2 & 1u, ray_mirror >> 1 & 1u, ray_mirror & 1u);
  vec3 first = time_of(u_clip_low + mirrored * (edge - u_clip_high - u_clip_low));
  vec3 last = time_of(u_clip_high + mirrored * (edge - u_clip_high - u_clip_low));
  float t = t_min;
  int axis = -1;
  if (first.x > t) { t = first.x; axis = 0; }
  if (first.y > t) { t = first.y; axis = 1; }
  if (first.z > t) { t = first.z; axis = 2; }
  float t_end = min(min(last.x, last.y), min(last.z, t_max));
  hit = Hit(t, u_levels, axis, 0u);
  if (t > t_end) return false;
  if (float(edge) <= clamp(cone.x + cone.y * t, u_cell_sizes.x, u_cell_sizes.y)) return true;

  uint stack[21];            // at s: the node whose children have 2^s voxels per edge
  uint node = u_root, leaf = 0u, octant = 0u;
  uvec2 brick = uvec2(0);
  int brick_scale = -1;  // scale of the brick around the current position; -1: none
  ivec3 position = ivec3(0);
  int scale = u_levels - 1;
  if (u_levels == 2) {
    brick = texel(u_root >> 8).xy;
    brick_scale = 2;
  }
  stack[scale] = node;
  position += ivec3(greaterThanEqual(vec3(t), time_of(ivec3(1 << scale)))) << scale;
  for (int i = 0; i < ${kMaxSteps}; ++i) {
    ++step_count;
    uint child = child_at(position, scale);
    bool occupied;
    if (scale >= brick_scale) {
      occupied = (node >> child & 1u) != 0u;
    } else if (scale == brick_scale - 1) {
      octant = (child < 4u ? brick.x : brick.y) >> (8u * (child & 3u)) & 255u;
      occupied = octant != 0u;
    } else {
      occupied = (octant >> child & 1u) != 0u;
    }
    if (occupied) {
#ifdef WIRE
      note_wire(position, scale, axis, t);
#endif
      bool whole = float(1 << scale) <= clamp(cone.x + cone.y * t, u_cell_sizes.x, u_cell_sizes.y);
      if (whole || scale < brick_scale - 1) {
        hit = Hit(t, scale, axis, whole ? 0u : leaf);
#ifdef CELL
        hit_cell = position + mirrored * (edge - (1 << scale) - 2 * position);
#endif
        return true;
      }
      if (scale >= brick_scale) {
        uint pointer = child_pointer(node, child);
        if (scale == 2) {
          uvec4 bricks = texel(pointer >> 8);
          brick = (pointer & 1u) == 0u ? bricks.xy : bricks.zw;
          brick_scale = 2;
          leaf = 0u;
        } else if ((u_boundaries >> scale & 1u) == 0u) {
          node = pointer;
          stack[scale - 1] = node;
        } else {
          uvec4 cut_off = texel(pointer >> 8);
          uint tile = tile_of(cut_off.x);
          if (tile != 0u) {
            node = tile;
            stack[scale - 1] = node;
            note_tile(cut_off.x);
#ifdef PICK
            picked_slots[scale] = cut_off.x;
#endif
          } else {
            brick = cut_off.yz;
            brick_scale = scale;
            leaf = pointer >> 8;
#ifdef PICK
            picked_slots[scale] = 0u;
#endif
          }
        }
      }
      --scale;
      position += ivec3(greaterThanEqual(vec3(t), time_of(position + (1 << scale)))) << scale;
      continue;
    }
    // No component is indexed by a variable, because some compilers would then move the vector to
    // memory.
    vec3 next = time_of(position + (1 << scale));
    axis = nearest_axis(next);
    t = min(next.x, min(next.y, next.z));
    if (t >= t_end) return false;
    ivec3 to = position + (ivec3(equal(ivec3(axis), ivec3(0, 1, 2))) << scale);
    ivec3 flipped = position ^ to;
    int changed = flipped.x | flipped.y | flipped.z;
    position = to;
    if (changed >> scale > 1) {
      // The ray leaves the parent. Go up to the lowest node that contains both the old and the new
      // cell.
      scale = int(floatBitsToUint(float(changed)) >> 23) - 127;
      if (scale >= u_levels) return false;
      position &= -1 << scale;
      if (scale >= brick_scale) {
        brick_scale = -1;
        node = stack[scale];
      }
    }
  }
  return false;
}
`;

// Source that computes the ray of a pixel, as in query/render/camera.h, and reads the G-buffer.
export const kCameraSource = `
uniform ivec3 u_eye_cell;
uniform vec3 u_eye_part, u_forward, u_right, u_up;
uniform float u_pixel;       // width of a pixel at distance 1
uniform vec2 u_center;       // center of the picture, in pixels from its lower left corner

vec3 direction_of(vec2 point) {
  vec2 p = (point - u_center) * u_pixel;
  return normalize(u_forward + u_right * p.x + u_up * p.y);
}

bool found_in(uvec4 g) { return (g.y >> 23 & 1u) != 0u; }
float wire_in(uvec4 g) { return float(g.y >> 24) / 255.0; }
float t_in(uvec4 g) { return uintBitsToFloat(g.x); }
float size_in(uvec4 g) { return float(1 << int(g.y >> 16 & 31u)); }
int axis_in(uvec4 g) { return int(g.y >> 21 & 3u); }
uint steps_in(uvec4 g) { return g.y & 65535u; }
`;
