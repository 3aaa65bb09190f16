#include <algorithm>

#include "scene/generate/city.h"

namespace voxdag {
namespace {

constexpr double kFloorHeight = 3.25;
constexpr double kWindowDepth = 0.25;
constexpr double kSlabHeight = 0.5;
constexpr Rgba8 kSlab{175, 172, 168, 255};

// One or more floors of a building. The walls consist of bays, each with one window.
struct Tier {
  double x = 0, z = 0;  // center
  double y = 0;
  uint32_t bays_x = 0, bays_z = 0, floors = 0;
  double bay = 3;

  double half_x() const { return 0.5 * bay * bays_x; }
  double half_z() const { return 0.5 * bay * bays_z; }
  double top() const { return y + kFloorHeight * floors; }
};

// Adds a wall, bay by bay from its left end as seen from outside.
void add_wall(SceneBuilder& scene, const CityParts& parts, const Tier& tier, uint32_t direction) {
  static constexpr int kAlong[4][2] = {{1, 0}, {0, -1}, {-1, 0}, {0, 1}};
  const auto [ax, az] = kAlong[direction];
  // The outward direction is the wall's direction turned right: (-az, ax).
  const double x = tier.x - (ax + az) * tier.half_x(), z = tier.z + (ax - az) * tier.half_z();
  const bool along_x = az == 0;
  const Vec3 scale = along_x ? Vec3{tier.bay, kFloorHeight, kWindowDepth}
                             : Vec3{kWindowDepth, kFloorHeight, tier.bay};
  for (uint32_t floor = 0; floor < tier.floors; ++floor)
    for (uint32_t bay = 0; bay < (along_x ? tier.bays_x : tier.bays_z); ++bay)
      scene.place(
          parts.window[direction],
          {x + ax * (tier.bay * bay), tier.y + kFloorHeight * floor, z + az * (tier.bay * bay)},
          scale);
}

// Adds the walls, and a slab on top that projects beyond them.
void add_tier(SceneBuilder& scene, const CityParts& parts, const Tier& tier, const Lot& lot) {
  scene.paint(kBuildings, lot.wall);
  for (uint32_t direction = 0; direction < 4; ++direction) add_wall(scene, parts, tier, direction);
  scene.paint(kBuildings, kSlab);
  const double x = tier.half_x() + 0.375, z = tier.half_z() + 0.375;
  scene.mesh_for(8, 12).box({tier.x - x, tier.top(), tier.z - z},
                            {tier.x + x, tier.top() + kSlabHeight, tier.z + z});
}

// Adds a roof with a ridge along the longer side. The roof's ends are upright, or sloping (a hip).
void add_ridge_roof(SceneBuilder& scene, const Tier& tier, Random& random) {
  const double y = tier.top() + kSlabHeight;
  const bool along_x = tier.bays_x >= tier.bays_z;
  const double across = along_x ? tier.half_z() : tier.half_x();
  const double along = along_x ? tier.half_x() : tier.half_z();
  const double height = across * (0.5 + 0.125 * random.below(5));
  const double ridge = random.chance(40) ? along - across * 0.5 : along;
  const auto at = [&](double l, double up, double c) {
    return along_x ? Vec3{tier.x + l, y + up, tier.z + c} : Vec3{tier.x + c, y + up, tier.z - l};
  };
  MeshBuilder& mesh = scene.mesh_for(6, 6);
  const uint32_t first =
      mesh.add_vertices({at(-along, 0, across), at(along, 0, across), at(along, 0, -across),
                         at(-along, 0, -across), at(-ridge, height, 0), at(ridge, height, 0)});
  constexpr uint8_t kFaces[6][3] = {{0, 1, 5}, {0, 5, 4}, {1, 2, 5},
                                    {2, 3, 4}, {2, 4, 5}, {3, 0, 4}};
  for (const auto& f : kFaces) mesh.add_triangle(first + f[0], first + f[1], first + f[2]);
}

// Adds a box that is rotated relative to the building, and on it a pyramid with the same rotation.
void add_crown(SceneBuilder& scene, const Tier& tier, Random& random) {
  const double half = std::min(tier.half_x(), tier.half_z());
  const double y = tier.top() + kSlabHeight;
  const Vec3 body{half * 0.625, half * 0.5, half * 0.625};
  const Turn turn = pythagorean_turn(random.below(12));
  scene.mesh_for(8, 10).turned_box({tier.x, y, tier.z}, body, turn);
  scene.mesh_for(5, 4).pyramid({tier.x, y + body.y, tier.z},
                               {half * 0.6875, half * 1.25, half * 0.6875}, turn);
}

// Adds equipment boxes at odd angles, and sometimes a mast.
void add_flat_roof(SceneBuilder& scene, const Tier& tier, Random& random) {
  const double y = tier.top() + kSlabHeight;
  for (int i = random.between(1, 3); i > 0; --i) {
    const double x = tier.x + tier.half_x() * 0.5 * random.signed_unit();
    const double z = tier.z + tier.half_z() * 0.5 * random.signed_unit();
    const Vec3 size{1.0 + random.unit(), 1.5 + random.unit(), 1.5 + random.unit()};
    const Turn turn = pythagorean_turn(random.below(12));
    scene.mesh_for(8, 10).turned_box({x, y, z}, size, turn);
  }
  if (tier.floors > 4 && random.chance(40))
    scene.mesh_for(8, 12).box({tier.x - 0.125, y, tier.z - 0.125},
                              {tier.x + 0.125, y + 6 + random.below(8), tier.z + 0.125});
}

void add_roof(SceneBuilder& scene, const Tier& tier, bool tall, Random& random) {
  const uint32_t draw = random.below(100);
  if (tall ? draw < 35 : draw < 10) return add_crown(scene, tier, random);
  if (!tall && draw < 70) return add_ridge_roof(scene, tier, random);
  add_flat_roof(scene, tier, random);
}

}  // namespace

void add_building(SceneBuilder& scene, const CityParts& parts, const Lot& lot, Random& random) {
  Tier tier{lot.center.x, lot.center.z, lot.center.y, 0, 0, 0, 2.5 + 0.5 * random.below(3)};
  const auto most = static_cast<int>(lot.width / tier.bay);
  tier.bays_x = static_cast<uint32_t>(random.between(most * 5 / 8, most));
  tier.bays_z = static_cast<uint32_t>(random.between(most * 5 / 8, most));
  const bool tall = lot.floors > 9;
  for (uint32_t left = lot.floors;;) {
    // A tall building becomes narrower after each tier, until few floors or few bays are left.
    const bool last = !tall || left < 6 || tier.bays_x < 4 || tier.bays_z < 4;
    tier.floors = last ? left : left / 2 + random.below(left / 4);
    add_tier(scene, parts, tier, lot);
    left -= tier.floors;
    if (left == 0) break;
    tier.y = tier.top() + kSlabHeight;
    tier.bays_x -= 1 + random.below(2);
    tier.bays_z -= 1 + random.below(2);
  }
  scene.paint(kBuildings, lot.roof);
  add_roof(scene, tier, tall, random);
}

void add_turned_house(SceneBuilder& scene, const Lot& lot, Random& random) {
  const Turn turn = pythagorean_turn(1 + random.below(11));
  const double x = lot.width * (0.25 + 0.09375 * random.unit());
  const double z = lot.width * (0.25 + 0.09375 * random.unit());
  const double height = kFloorHeight * lot.floors;
  scene.paint(kBuildings, lot.wall);
  scene.mesh_for(8, 10).turned_box(lot.center, {x, height, z}, turn);
  scene.paint(kBuildings, lot.roof);
  const Vec3 eaves{lot.center.x, lot.center.y + height, lot.center.z};
  scene.mesh_for(5, 4).pyramid(eaves, {x + 0.5, (x + z) * (0.375 + 0.25 * random.unit()), z + 0.5},
                               turn);
}

}  // namespace voxdag
