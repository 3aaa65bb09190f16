// GLSL source of the passes of a picture: trace (G-buffer), light (normals and sun), occlusion
// (sky), combine (filter and accumulate), present (tones), and feedback (missing and used tiles).
// The lighting is the same as in query/render.

import {kColorSource, kColorState} from "./color_shader.js";
import {kCameraSource, kPrecision, kRaySource} from "./ray_shader.js";

const kVersion = `#version 300 es\n${kPrecision}`;

export const kQuad = `${kVersion}
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const kTraceMain = `
uniform vec2 u_jitter;  // offset of the ray from the center of its pixel
uniform float u_cone;        // width of the cone at distance 1
uniform uint u_seed;
layout(location = 0) out uvec4 o_hit;
#ifdef COLOR
layout(location = 1) out uint o_color;
#endif

uvec4 pack_hit(bool found, Hit hit, uint steps, float wire, uint slot) {
  uint axis = hit.axis < 0 ? 3u : uint(hit.axis);
  return uvec4(found ? floatBitsToUint(hit.t) : 0u,
               min(steps, 65535u) | uint(hit.scale) << 16 | axis << 21 | (found ? 1u << 23 : 0u) |
                   uint(wire * 255.0 + 0.5) << 24,
               found ? hit.missing : 0u, slot);
}

void main() {
  random_state = uint(gl_FragCoord.x) * 1973u + uint(gl_FragCoord.y) * 9277u + u_seed * 26699u;
#ifdef PICK
  for (int s = 0; s < 21; ++s) picked_slots[s] = 0u;
#endif
#ifdef PICK
  vec2 point = vec2(0.5);  // both pixels cast this ray; the second one writes more words of the hit
#else
  vec2 point = gl_FragCoord.xy + u_jitter;
#endif
  set_ray(u_eye_cell, u_eye_part, direction_of(point));
  Hit hit;
  bool found = trace(0.0, 1e30, vec2(0.0, u_cone), hit);
#ifdef WIRE
  o_hit = pack_hit(found, hit, uint(step_count), wire, entered_slot);
#endif
#ifdef COLOR
  o_color =
      found && u_color_levels >= 0 ? color_of_cell(hit_cell, hit.scale, hit.missing == 0u) : 0u;
#endif
#ifdef PICK
  o_hit = pack_hit(found, hit, uint(step_count), 0.0, entered_slot);
  uint slot = 0u;
  for (int s = hit.scale + 1; s < u_levels && slot == 0u; ++s)
    if ((u_boundaries >> s & 1u) != 0u) slot = picked_slots[s];
  if (gl_FragCoord.x > 1.0) o_hit = uvec4(uvec3(hit_cell), slot);
#endif
}`;

export const kTrace = `${kVersion}
#define WIRE\n${kRaySource}${kCameraSource}${kTraceMain}`;
// Variant for files with colors.
export const kColoredTrace = `${kVersion}
#define WIRE\n#define CELL\n#define COLOR\n${kRaySource}${kCameraSource}${kColorSource}${
    kTraceMain}`;
export const kPick = `${kVersion}
#define PICK\n#define CELL\n${kRaySource}${kCameraSource}${kTraceMain}`;

const kSky = `
const float kPi = 3.14159265, kOpenFloor = 0.82;  // green light of an unoccluded sky on a floor
const vec3 kZenith = vec3(0.62, 0.78, 1.00), kHorizon = vec3(0.95, 0.98, 1.02);
const vec3 kGround = vec3(0.40, 0.36, 0.31);
vec3 sky_color(vec3 direction) {
  return mix(kHorizon, direction.y >= 0.0 ? kZenith : kGround, sqrt(abs(direction.y)));
}
// Packs a unit vector into two numbers of 16 bits, by the octahedral encoding.
uint pack_normal(vec3 n) {
  n /= abs(n.x) + abs(n.y) + abs(n.z);
  vec2 folded = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  vec2 p = n.z >= 0.0 ? n.xy : folded;
  return packSnorm2x16(p);
}
// Returns the pixel among 2 x 2 for which a sample computes the sky's light.
ivec2 chosen_of_four(int frame) {
  return ivec2(frame & 1, (frame & 1) ^ (frame >> 1 & 1));
}
vec3 unpack_normal(uint packed_normal) {
  vec2 p = unpackSnorm2x16(packed_normal);
  vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  float t = max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -t : t;
  n.y += n.y >= 0.0 ? -t : t;
  return normalize(n);
}
`;

// GLSL source shared by the passes of light, for rays that begin at the surface of a pixel.
const kSurface = `
uniform usampler2D u_hits;
uniform ivec2 u_size;        // size of the picture in the lower left corner of the targets
uniform vec2 u_jitter;
uniform int u_frame;         // number of the sample

struct Surface {
  vec3 center, face, direction;
  float t, size, cube;  // cube: 1: voxels appear as cubes, 0: as a smooth surface, between: a mix
};
Surface surface_at(ivec2 pixel, uvec4 g) {
  Surface s;
  s.direction = direction_of(vec2(pixel) + 0.5 + u_jitter);
  s.t = t_in(g);
  s.size = size_in(g);
  s.center = s.direction * s.t;
  s.face = -s.direction;
  if (axis_in(g) < 3) s.face = -sign(s.direction) * vec3(equal(ivec3(axis_in(g)), ivec3(0, 1, 2)));
  s.cube = clamp((s.size / max(s.t * u_pixel, 1e-9) - 5.0) / 8.0, 0.0, 1.0);
  return s;
}
// Returns the start of a ray to the light, outside the surface so that no voxel step blocks it.
vec3 start_of(Surface s, vec3 normal) {
  return s.center + normal * (s.size * 2.2 * (1.0 - s.cube)) + s.face * (s.size * 0.01);
}
uniform vec2 u_floor;  // x: distance of the floor below the eye, 0: no floor; y: scene's diagonal
uniform vec3 u_floor_center; // center of the scene, relative to the eye
// Computes the point where the pixel's ray meets the floor below the scene. Returns the weight, 0
// to 1, of the shadow there; 0 if the ray does not meet the floor.
float floor_at(ivec2 pixel, out Surface s) {
  s.direction = direction_of(vec2(pixel) + 0.5 + u_jitter);
  if (u_floor.x <= 0.0 || s.direction.y >= 0.0) return 0.0;
  s.t = u_floor.x / -s.direction.y;
  s.size = 0.5 * u_pixel * s.t;
  s.center = s.direction * s.t;
  s.face = vec3(0, 1, 0);
  s.cube = 1.0;
  float far = length(s.center - u_floor_center) / u_floor.y, fade = exp(-1.6 * far * far);
  return fade < 0.01 ? 0.0 : fade;
}
void basis_around(vec3 n, out vec3 a, out vec3 b) {
  a = normalize(abs(n.x) > 0.7 ? cross(n, vec3(0, 1, 0)) : cross(n, vec3(1, 0, 0)));
  b = cross(n, a);
}

// Begins a ray at an offset from the eye.
void set_ray_from(vec3 offset, vec3 direction) {
  vec3 p = u_eye_part + offset, whole = floor(p);
  set_ray(u_eye_cell + ivec3(whole), p - whole, direction);
}

// Returns a point of the R2 sequence. The 4 x 4 neighboring pixels start at 16 different offsets.
vec2 sample_pair(ivec2 pixel, int dimension) {
  int place = (pixel.x & 3) * 4 + (pixel.y & 3);
  float n = float(u_frame * 16 + place * 7 % 16);
  return fract(vec2(0.1 + 0.37 * float(dimension), 0.6 + 0.21 * float(dimension)) +
               n * vec2(0.7548776662, 0.5698402910));
}
`;

const kBlocked = `
// True if a cell blocks the light. toward: direction to the light; reach: maximum distance.
bool is_blocked(Surface s, vec3 normal, vec3 toward, float reach, vec2 cone, out Hit hit) {
  // Where surfaces are close together, the start can be in an occupied cell. The second attempt
  // starts on the path of the camera ray, which is free unless the eye is in an occupied cell.
  for (int attempt = 0; attempt < 2; ++attempt) {
    vec3 start = attempt == 0 ? start_of(s, normal) : s.direction * max(0.0, s.t - 1.5 * s.size);
    set_ray_from(start, toward);
    if (!trace(0.0, reach, cone, hit)) return false;
    if (hit.t > 0.0) return true;
  }
  return false;
}
`;

// Computes the normal of the surface at each pixel, and whether the surface sees the sun.
export const kLight = `${kVersion}${kRaySource}${kCameraSource}${kSky}${kSurface}${kBlocked}
uniform vec3 u_sun;          // unit vector toward the sun
uniform bool u_shadows;
layout(location = 0) out float o_sun;
layout(location = 1) out uint o_normal;
layout(location = 2) out uint o_missing;

const float kSunWidening = 0.006, kSunRadius = 0.006;
const int kReach = 3;

vec3 offset_of(ivec2 pixel, float t) {
  return direction_of(vec2(pixel) + 0.5 + u_jitter) * t;
}

// Returns the normal of the plane that best fits the surface near the pixel: the eigenvector of the
// smallest eigenvalue of the covariance matrix, by inverse iteration.
vec3 plane_normal(ivec2 pixel, vec3 center, float size, vec3 face, vec3 direction) {
  float footprint = u_pixel * length(center), reach = (float(kReach) + 0.5) * max(size, footprint);
  int stride = int(clamp(size / footprint, 1.0, 5.0));
  float weight = 0.0;
  vec3 first = vec3(0), squares = vec3(0), products = vec3(0);
  for (int j = -kReach; j <= kReach; ++j)
    for (int i = -kReach; i <= kReach; ++i) {
      ivec2 at = pixel + ivec2(i, j) * stride;
      if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, u_size))) continue;
      uvec4 g = texelFetch(u_hits, at, 0);
      if (!found_in(g)) continue;
      vec3 d = (offset_of(at, t_in(g)) - center) / reach;
      float rest = 1.0 - dot(d, d);
      if (rest <= 0.0) continue;
      float w = rest * rest;
      weight += w;
      first += w * d;
      squares += w * d * d;
      products += w * d.yzx * d.zxy;
    }
  if (weight < 2.0) return face;
  vec3 c0 = vec3(squares.x, products.z, products.y) - first * (first.x / weight);
  vec3 c1 = vec3(products.z, squares.y, products.x) - first * (first.y / weight);
  vec3 c2 = vec3(products.y, products.x, squares.z) - first * (first.z / weight);
  float trace_inverse = 1.0 / max(c0.x + c1.y + c2.z, 1e-9);
  c0 = c0 * trace_inverse + vec3(1e-3, 0, 0);
  c1 = c1 * trace_inverse + vec3(0, 1e-3, 0);
  c2 = c2 * trace_inverse + vec3(0, 0, 1e-3);
  vec3 a0 = cross(c1, c2), a1 = cross(c2, c0), a2 = cross(c0, c1);
  float scale = 1.0 / (a0.x + a1.y + a2.z);
  vec3 toward_eye = face - direction, n = toward_eye;
  for (int i = 0; i < 8; ++i) n = vec3(dot(a0, n), dot(a1, n), dot(a2, n)) * scale;
  n = normalize(n);
  return dot(n, direction) > 0.0 ? -n : n;
}

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  uvec4 g = texelFetch(u_hits, pixel, 0);
  o_sun = 0.0;
  o_normal = 0u;
  o_missing = 0u;
  Surface s;
  Hit hit;
  if (!found_in(g)) {
    if (floor_at(pixel, s) == 0.0) return;
    o_sun = 1.0;
    if (!u_shadows) return;
    set_ray_from(s.center, u_sun);
    if (trace(0.0, 1e30, vec2(s.size, kSunWidening), hit)) {
      o_sun = 0.0;
      o_missing = hit.missing;
    }
    return;
  }
  s = surface_at(pixel, g);
  vec3 normal = s.face;
  if (s.cube < 1.0) {
    vec3 plane = plane_normal(pixel, s.center, s.size, s.face, s.direction);
    normal = normalize(mix(plane, s.face, s.cube));
  }
  o_normal = pack_normal(normal);
  if (dot(normal, u_sun) <= 0.0) return;
  o_sun = 1.0;
  if (!u_shadows) return;
  vec3 a, b;
  basis_around(u_sun, a, b);
  vec2 p = sample_pair(pixel, 1);
  // The first sample has sharp shadows, because noise disappears only with more samples.
  float r = u_frame == 0 ? 0.0 : kSunRadius * sqrt(p.x), angle = 2.0 * kPi * p.y;
  vec3 toward = normalize(u_sun + a * (r * cos(angle)) + b * (r * sin(angle)));
  if (is_blocked(s, normal, toward, 1e30, vec2(s.size, kSunWidening), hit)) {
    o_sun = 0.0;
    o_missing = hit.missing;
  }
}`;

// Computes the light from the sky for one of every 2 x 2 pixels.
export const kOcclusion = `${kVersion}${kRaySource}${kCameraSource}${kSky}${kSurface}${kBlocked}
uniform usampler2D u_normals;
uniform float u_sky_reach;   // distance beyond which nothing occludes the sky
uniform bool u_occlusion;
layout(location = 0) out vec4 o_sky;

const float kBounce = 0.42, kSkyWidening = 0.1;

void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 pixel = min(2 * place + chosen_of_four(u_frame), u_size - 1);
  uvec4 g = texelFetch(u_hits, pixel, 0);
  o_sky = vec4(0);
  Surface s;
  vec3 normal = vec3(0, 1, 0), sky = vec3(kOpenFloor);
  if (found_in(g)) {
    s = surface_at(pixel, g);
    normal = unpack_normal(texelFetch(u_normals, pixel, 0).x);
    sky = sky_color(normal);
  } else if (floor_at(pixel, s) == 0.0) {
    return;
  }
  if (u_occlusion) {
    vec3 a, b;
    basis_around(normal, a, b);
    vec2 p = sample_pair(place, 0);
    float r = sqrt(p.x), angle = 2.0 * kPi * p.y;
    vec3 toward = a * (r * cos(angle)) + b * (r * sin(angle)) + normal * sqrt(1.0 - p.x);
    Hit hit;
    float open = 1.0;
    if (is_blocked(s, normal, toward, u_sky_reach, vec2(s.size, kSkyWidening), hit)) {
      float distance = hit.t / u_sky_reach;
      open = kBounce * sqrt(distance) * (1.0 - distance) + distance * distance * distance;
    }
    sky = sky_color(toward) * open;
  }
  o_sky = vec4(sky / 1.1, 1.0);
}`;

// Writes one texel for each of 48 positions of the sun (columns) and each of 40 x 24 probed pixels
// (rows). First word of a texel: 0 if the pixel shows no surface, 1 if it is in shadow, 2 if it is
// lit. Second word: Hit.missing (ray_shader.js) of the ray to the sun.
export const kSunPlaces = 48, kSunRows = 960;
export const kSun = `${kVersion}${kRaySource}${kCameraSource}${kSky}${kSurface}${kBlocked}
uniform usampler2D u_normals;
uniform float u_turn;
layout(location = 0) out uvec4 o_lit;

void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 pixel = ivec2((vec2(place.y % 40, place.y / 40) + 0.5) / vec2(40, 24) * vec2(u_size));
  uvec4 g = texelFetch(u_hits, pixel, 0);
  o_lit = uvec4(0);
  if (!found_in(g)) return;
  Surface s = surface_at(pixel, g);
  vec3 normal = unpack_normal(texelFetch(u_normals, pixel, 0).x);
  float turn = u_turn - 2.0 * kPi * float(place.x % 16) / 16.0;
  float height = 0.65 + 0.25 * float(place.x / 16);
  vec3 sun = vec3(cos(turn) * cos(height), sin(height), sin(turn) * cos(height));
  Hit hit;
  if (dot(normal, sun) <= 0.0) {
    o_lit = uvec4(1, 0, 0, 0);
    return;
  }
  // The cone and the 48 positions of the sun are the same as in query/render.
  bool blocked = is_blocked(s, normal, sun, 1e30, vec2(s.size, 0.004), hit);
  o_lit = uvec4(blocked ? 1u : 2u, blocked ? hit.missing : 0u, 0, 0);
}`;

const kReflected = `
const vec3 kPlaster = vec3(0.74, 0.70, 0.64), kSunlight = vec3(3.6, 3.2, 2.6);
vec3 reflected(vec3 albedo, vec3 normal, vec3 sky, float sun) {
  return albedo * (sky + kSunlight * (sun * max(0.0, dot(normal, u_sun))));
}
`;

// Source that averages the light of the sky over 4 x 4 samples on the same plane. On the floor, the
// samples of the floor are averaged.
const kSkyFilter = `
uniform usampler2D u_hits, u_normals;
uniform sampler2D u_light, u_sky;
uniform ivec2 u_size;
uniform vec2 u_jitter;
uniform vec3 u_sun;
uniform int u_frame;

vec3 sky_around(ivec2 pixel, uvec4 g, vec3 normal) {
  bool on_surface = found_in(g);
  ivec2 sky_size = (u_size + 1) / 2, chosen = chosen_of_four(u_frame);
  float t = t_in(g), slack = 3.0 * u_pixel * t + 0.5 * size_in(g), weights = 0.0;
  vec3 center = direction_of(vec2(pixel) + 0.5 + u_jitter) * t, sum = vec3(0);
  for (int j = -2; j < 2; ++j)
    for (int i = -2; i < 2; ++i) {
      ivec2 place = (pixel + 1) / 2 + ivec2(i, j);
      if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, sky_size))) continue;
      ivec2 at = min(2 * place + chosen, u_size - 1);
      uvec4 other = texelFetch(u_hits, at, 0);
      vec4 light = texelFetch(u_sky, place, 0);
      if (found_in(other) != on_surface || light.a == 0.0) continue;
      float w = 1.0;
      if (on_surface) {
        float alike = max(0.0, dot(normal, unpack_normal(texelFetch(u_normals, at, 0).x)));
        vec3 offset = direction_of(vec2(at) + 0.5 + u_jitter) * t_in(other) - center;
        w = alike * alike * alike * alike * max(0.0, 1.0 - abs(dot(normal, offset)) / slack) + 1e-4;
      }
      sum += w * light.rgb;
      weights += w;
    }
  if (weights > 0.0) return sum * (1.1 / weights);
  return on_surface ? 0.5 * sky_color(normal) : vec3(kOpenFloor);
}
`;

// Combines light and color. The result is premultiplied by its coverage of the background. Haze
// reduces the coverage of far surfaces. A shadow on the floor is black, with a coverage below 1.
export const kCombine = `${kVersion}${kCameraSource}${kSky}${kColorState}${kSkyFilter}
uniform usampler2D u_colors;
uniform bool u_colored;      // true if u_colors has colors
uniform sampler2D u_before;
uniform vec2 u_haze;  // x: distance at which haze begins; y: 1 / the scene's diagonal
uniform float u_share;  // weight of this sample: 1 / number of samples; if 1, u_before is unused
uniform float u_range;       // divisor of the light that is written to the target (passes.js)
uniform vec2 u_floor;
uniform vec3 u_floor_center;
layout(location = 0) out vec4 o_color;
${kReflected}
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  uvec4 g = texelFetch(u_hits, pixel, 0);
  vec4 color = vec4(0);
  float sun = texelFetch(u_light, pixel, 0).x;
  if (found_in(g)) {
    vec3 normal = unpack_normal(texelFetch(u_normals, pixel, 0).x);
    vec3 sky = sky_around(pixel, g, normal);
    float depth = max(0.0, t_in(g) - u_haze.x) * u_haze.y;
    float coverage = 1.0 - 0.25 * (1.0 - exp(-depth * depth));
    uint own = u_colored ? texelFetch(u_colors, pixel, 0).x : 0u;
    vec3 albedo = (own & kColored) != 0u ? linear_of(own) : kPlaster;
    color = vec4(reflected(albedo, normal, sky, sun) * coverage / u_range, coverage);
  } else {
    vec3 direction = direction_of(gl_FragCoord.xy + u_jitter);
    if (u_floor.x > 0.0 && direction.y < 0.0) {
      vec3 offset = direction * (u_floor.x / -direction.y) - u_floor_center;
      float fade = exp(-1.6 * dot(offset, offset) / (u_floor.y * u_floor.y));
      if (fade >= 0.01) {
        float open = sky_around(pixel, g, vec3(0, 1, 0)).g / kOpenFloor;
        color.a = fade * (0.75 - 0.35 * open - 0.40 * sun);
      }
    }
  }
  float wire = 0.7 * wire_in(g);
  color = vec4(mix(color.rgb, vec3(0.05, 0.25, 0.9) / u_range, wire), max(color.a, wire));
  o_color = u_share < 1.0 ? mix(texelFetch(u_before, pixel, 0), color, u_share) : color;
}`;

export const kPresent = `${kVersion}
uniform sampler2D u_color;
uniform ivec2 u_size;        // size of the picture in the lower left corner of u_color
uniform vec2 u_extent;       // size of the canvas in pixels
uniform float u_exposure;    // exposure times u_range, because u_color was divided by u_range
out vec4 o_color;

const vec3 kTop = vec3(0.46, 0.54, 0.65), kBottom = vec3(0.86, 0.87, 0.88);

// A filmic curve that compresses bright light: the ACES fit of Narkowicz 2015.
vec3 tone_map(vec3 x) {
  return min(vec3(1), x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
}
vec3 srgb(vec3 v) {
  vec3 bright = 1.055 * pow(max(v, vec3(1e-5)), vec3(1.0 / 2.4)) - 0.055;
  return mix(12.92 * v, bright, step(vec3(0.0031308), v));
}
void main() {
  vec2 place = gl_FragCoord.xy / u_extent;
  vec2 at = clamp(place * vec2(u_size), vec2(0.5), vec2(u_size) - 0.5);
  vec4 color = texture(u_color, at / vec2(textureSize(u_color, 0)));
  vec3 background = mix(kBottom, kTop, place.y);
  vec3 lit = tone_map(color.rgb / max(color.a, 1e-3) * u_exposure);
  // Ordered dither, so that gradients show no steps.
  ivec2 p = ivec2(gl_FragCoord.xy) & 3;
  int order = (p.x ^ p.y) & 1 | (p.y & 1) << 1 | ((p.x ^ p.y) & 2) << 1 | (p.y & 2) << 2;
  order = (order & 1) << 3 | (order & 2) << 1 | (order & 4) >> 1 | order >> 3;
  o_color = vec4(srgb(mix(background, lit, color.a)) + (float(order) / 16.0 - 0.47) / 255.0, 1.0);
}`;

// Writes one texel per block of u_block x u_block pixels. Word 1: Hit.missing of the widest cell
// whose tile is missing, or else of a shadow's ray. Word 2: the width of this cell in pixels, and
// the brightness of the pixel u_sample, which differs between frames. Word 3: the slot of a tile
// that this pixel uses, and half the number of steps of its ray. Word 4: the distance t of its hit.
export const kFeedback = `${kVersion}${kCameraSource}${kSky}${kSkyFilter}
uniform usampler2D u_shadow_missing;
uniform int u_block;
uniform ivec2 u_sample;
layout(location = 0) out uvec4 o_feedback;
${kReflected}
const float kShadowPixels = 0.25;  // width of a cell if only a shadow's ray misses its tile

void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * u_block, last = u_size - 1;
  uint missing = 0u, shadow_missing = 0u;
  float pixels = 0.0;
  for (int j = 0; j < u_block; ++j)
    for (int i = 0; i < u_block; ++i) {
      ivec2 at = min(first + ivec2(i, j), last);
      uint other = texelFetch(u_shadow_missing, at, 0).x;
      if (other != 0u) shadow_missing = other;
      uvec4 g = texelFetch(u_hits, at, 0);
      if (!found_in(g)) continue;
      float width = size_in(g) / max(t_in(g) * u_pixel, 1e-6);
      if (g.z != 0u && width > pixels) {
        pixels = width;
        missing = g.z;
      }
    }
  if (missing == 0u && shadow_missing != 0u) {
    missing = shadow_missing;
    pixels = kShadowPixels;
  }
  ivec2 at = min(first + u_sample, last);
  uvec4 g = texelFetch(u_hits, at, 0);
  float luminance = 0.0;
  if (found_in(g)) {
    vec3 normal = unpack_normal(texelFetch(u_normals, at, 0).x);
    vec3 sky = sky_around(at, g, normal);
    // Like query/render, measures the exposure on plaster, so that dark colors remain dark.
    vec3 light = reflected(kPlaster, normal, sky, texelFetch(u_light, at, 0).x);
    luminance = dot(light, vec3(0.2126, 0.7152, 0.0722));
  }
  o_feedback = uvec4(missing, packHalf2x16(vec2(min(pixels, 60000.0), luminance)),
                     g.w | min(steps_in(g) >> 1, 1023u) << 22, g.x);
}`;
