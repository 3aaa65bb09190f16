// The pieces of a generated city, in meters, y up. The sizes and places of windows are small
// multiples of 1/64, which floats represent exactly. So a window has exactly the same corners
// whether it is stored as triangles or as an instance.
#pragma once

#include <cstdint>

#include "scene/generate/random.h"
#include "scene/generate/scene_builder.h"

namespace voxdag {

// Indices into kCityMaterials.
enum CityMaterial : uint32_t { kGround, kBuildings, kPlants, kCars };

// The numbers of a city's parts, as SceneBuilder::add_part() returns them. Each part is stored once
// and placed many times. The parts are a piece of wall with a window (one for each of four
// directions), a tree, a car along x, and a car along z.
struct CityParts {
  explicit CityParts(SceneBuilder& scene);
  uint32_t window[4];  // facing +z, +x, -z, -x; unit size; the pane is set back by 1
  uint32_t tree;       // unit height, with its base at the origin
  uint32_t car[2];
};

// The site of a building: its place, its maximum width and its number of floors.
struct Lot {
  Vec3 center;  // on the ground
  double width = 0;
  uint32_t floors = 0;
  Rgba8 wall = kWhite, roof = kWhite;  // used in a city with colors
};

void add_building(SceneBuilder& scene, const CityParts& parts, const Lot& lot, Random& random);
// Adds a small house without windows, rotated about the vertical axis.
void add_turned_house(SceneBuilder& scene, const Lot& lot, Random& random);

}  // namespace voxdag
