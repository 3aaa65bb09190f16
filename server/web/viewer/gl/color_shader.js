// GLSL source: reads the colors of cells from the pages on the GPU (layout: colors/page_format.js),
// and writes the feedback about missing and used pages.

import {kCameraSource, kPrecision} from "./ray_shader.js";

// GLSL source: the word with the color of a pixel, which the passes write and read.
export const kColorState = `
const uint kColored = 1u << 24;      // the low bits are red, green and blue, as sRGB
const uint kPageMissing = 1u << 25;  // the color is coarse or absent because a page is missing
vec3 linear_of(uint color) {
  vec3 s = vec3(color & 255u, color >> 8 & 255u, color >> 16 & 255u) / 255.0;
  return mix(pow((s + 0.055) / 1.055, vec3(2.4)), s / 12.92, lessThanEqual(s, vec3(0.04045)));
}
`;

export const kColorSource = `${kColorState}
uniform usampler2D u_page_texels, u_page_table;
uniform uint u_page_mask;    // number of entries of the table, minus 1
uniform int u_color_levels;  // finest level with colors; -1: colors are off

uvec4 page_texel(uint address) {
  return texelFetch(u_page_texels, ivec2(address & 4095u, address >> 12), 0);
}
uint word_of(uvec4 words, uint i) {
  uvec2 pair = (i & 2u) == 0u ? words.xy : words.zw;
  return (i & 1u) == 0u ? pair.x : pair.y;
}
uint popcount32(uint x) {
  x -= x >> 1 & 0x55555555u;
  x = (x & 0x33333333u) + (x >> 2 & 0x33333333u);
  return ((x + (x >> 4)) & 0x0f0f0f0fu) * 0x01010101u >> 24;
}

// Returns 1 plus the number of the page's first block (16 texels) in the pool; 0 if the page is not
// loaded. place: the position of the page on its level.
uint page_at(int level, ivec3 place) {
  uvec3 key = uvec3(place);
  key.x |= uint(level) << 20;
  uint hash = key.x * 0x8da6b343u ^ key.y * 0xd8163841u ^ key.z * 0xcb1ab31fu;
  hash = (hash ^ hash >> 15) * 0x2c1b3c6du;
  uint at = (hash ^ hash >> 13) & u_page_mask;
  for (int i = 0; i < 256; ++i) {
    uvec4 entry = texelFetch(u_page_table, ivec2(at & 1023u, at >> 10), 0);
    if (entry.w == 0u || entry.xyz == key) return entry.w;
    at = (at + 1u) & u_page_mask;
  }
  return 0u;
}

// Returns the color of cell i in a block of 16 bytes (docs/format.md).
uint block_color(uvec4 block, uint i) {
  uvec3 a, b;
  uint weight, top;
  if ((block.x & 0xffffu) == 0u) {
    a = uvec3(block.y & 255u, block.x >> 24, block.x >> 16 & 255u);
    b = uvec3(block.y >> 24, block.y >> 16 & 255u, block.y >> 8 & 255u);
    weight = (i < 16u ? block.z : block.w) >> (2u * (i & 15u)) & 3u;
    top = 3u;
  } else {
    uvec3 shift = uvec3(11, 5, 0), bits = uvec3(5, 6, 5), ones = (uvec3(1) << bits) - 1u;
    uvec3 from = uvec3(block.x & 0xffffu) >> shift & ones;
    uvec3 to = uvec3(block.x >> 16) >> shift & ones;
    a = from << (8u - bits) | from >> (2u * bits - 8u);
    b = to << (8u - bits) | to >> (2u * bits - 8u);
    uint bit = 3u * i, low = word_of(block, 1u + (bit >> 5)) >> (bit & 31u);
    if ((bit & 31u) > 29u) low |= word_of(block, 2u + (bit >> 5)) << (32u - (bit & 31u));
    weight = low & 7u;
    top = 7u;
  }
  uvec3 color = (a * (top - weight) + b * weight + top / 2u) / top;
  return color.x | color.y << 8 | color.z << 16;
}

// Returns the color of the cell with this Morton code in the page; 0 if the cell is empty. first:
// the address of the page's first texel.
uint color_in_page(uint first, uint code) {
  uint word = code >> 5, quarter = word >> 2, below = (1u << (code & 31u)) - 1u;
  uvec4 mask = page_texel(first + 1u + quarter);
  uint bits = word_of(mask, word);
  if ((bits >> (code & 31u) & 1u) == 0u) return 0u;
  uvec4 head = page_texel(first);
  uint rank = (head.x >> 16 & 31u) + popcount32(bits & below);
  if (quarter > 0u) rank += head.y >> (10u * (quarter - 1u)) & 1023u;
  if ((word & 3u) > 0u) rank += popcount32(mask.x);
  if ((word & 3u) > 1u) rank += popcount32(mask.y);
  if ((word & 3u) > 2u) rank += popcount32(mask.z);
  bool single = (head.x >> 24 & 1u) != 0u;
  uint at = single ? rank >> 2 : rank >> 5, texel_at = first + 8u + at;
  if (at >= 8u) {
    uint block = (at - 8u) >> 4;
    texel_at = word_of(page_texel(first + 5u + (block >> 2)), block) + ((at - 8u) & 15u);
  }
  uvec4 colors = page_texel(texel_at);
  return kColored | (single ? word_of(colors, rank) & 0xffffffu : block_color(colors, rank & 31u));
}

uint spread_bits(int x) {
  return uint((x & 1) | (x & 2) << 2 | (x & 4) << 4);
}

// Returns the color of the cell with this low corner and 2^scale voxels per edge, or of the nearest
// coarser cell whose page is loaded. Sets kPageMissing if the color is coarser than the cell by at
// least one level. If is_final is false, finer cells will soon replace this cell, so kPageMissing
// is set only if the color is coarser by at least three levels.
uint color_of_cell(ivec3 cell, int scale, bool is_final) {
  int wanted = min(u_levels - scale, u_color_levels);
  ivec3 at = cell >> (u_levels - wanted);
  for (int level = wanted; level >= 0; --level) {
    uint number = page_at(level, at >> 3);
    if (number != 0u) {
      uint code = spread_bits(at.x) << 2 | spread_bits(at.y) << 1 | spread_bits(at.z);
      uint color = color_in_page((number - 1u) * 16u, code);
      if (color != 0u) return color | (wanted - level >= (is_final ? 1 : 3) ? kPageMissing : 0u);
    }
    at >>= 1;
  }
  return kPageMissing;
}
`;

// Writes one texel per block of u_block x u_block pixels. The texel describes the page of one pixel
// of the block: of the first pixel whose page is missing, or else of the pixel u_sample. The four
// words are the page's x, with the level in the bits from 20; y; z; and a number. The number is 0
// if the pixel shows no surface, and otherwise 1 plus the number of the block's pixels whose page
// is missing.
export const kColorFeedback = `#version 300 es
${kPrecision}${kCameraSource}${kColorState}
uniform usampler2D u_hits, u_colors;
uniform vec2 u_jitter;
uniform int u_levels, u_color_levels, u_block;
uniform ivec2 u_size, u_sample;
layout(location = 0) out uvec4 o_page;

// Returns the page of a pixel's color. The position of the hit is computed again from its distance
// t. So it is rounded differently than in the trace pass, and can be in a neighboring page.
uvec3 page_of(ivec2 pixel, uvec4 g) {
  vec3 direction = direction_of(vec2(pixel) + 0.5 + u_jitter), p = direction * t_in(g);
  if (axis_in(g) < 3)
    p += sign(direction) * vec3(equal(ivec3(axis_in(g)), ivec3(0, 1, 2))) * (0.5 * size_in(g));
  ivec3 voxel = clamp(u_eye_cell + ivec3(floor(u_eye_part + p)), 0, (1 << u_levels) - 1);
  int level = min(u_levels - int(g.y >> 16 & 31u), u_color_levels);
  uvec3 page = uvec3(voxel >> (u_levels - level + 3));
  page.x |= uint(level) << 20;
  return page;
}

void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * u_block, last = u_size - 1;
  ivec2 chosen = min(first + u_sample, last);
  uint missing = 0u;
  for (int j = 0; j < u_block; ++j)
    for (int i = 0; i < u_block; ++i) {
      ivec2 at = min(first + ivec2(i, j), last);
      if ((texelFetch(u_colors, at, 0).x & kPageMissing) == 0u) continue;
      if (missing == 0u) chosen = at;
      ++missing;
    }
  uvec4 g = texelFetch(u_hits, chosen, 0);
  o_page = found_in(g) ? uvec4(page_of(chosen, g), 1u + missing) : uvec4(0);
}`;
