// A city of square blocks with streets between them: towers in the middle, houses at the edge,
// some parks. The number of blocks follows from the requested triangles.
#include "scene/generate/city.h"

#include <algorithm>

#include "scene/generate/scene_builder.h"

namespace voxdag {
namespace {

constexpr double kPitch = 64;         // distance between streets
constexpr double kBlock = 52;         // edge of a block, including the pavement
constexpr double kPavement = 0.1875;  // height of the pavement
constexpr double kBuilt = 48;         // edge of the area for lots
// Average number of triangles per block, as measured. The number of blocks is estimated from it.
constexpr uint64_t kTrianglesPerBlock = 9900;

constexpr Rgba8 kStreet{90, 92, 96, 255}, kPavementColor{190, 186, 178, 255},
    kGrass{70, 130, 45, 255};
constexpr Rgba8 kWalls[] = {{205, 190, 160, 255}, {165, 75, 50, 255},  {170, 172, 175, 255},
                            {230, 225, 215, 255}, {125, 105, 85, 255}, {200, 145, 90, 255},
                            {150, 165, 185, 255}, {215, 165, 140, 255}};
constexpr Rgba8 kRoofs[] = {
    {135, 42, 24, 255}, {55, 57, 66, 255}, {62, 112, 92, 255}, {80, 76, 73, 255}};
constexpr Rgba8 kCarColors[] = {{185, 18, 18, 255}, {20, 45, 140, 255},   {235, 235, 235, 255},
                                {16, 16, 19, 255},  {165, 170, 175, 255}, {205, 145, 8, 255}};

template <size_t n>
const Rgba8& one_of(const Rgba8 (&colors)[n], Random& random) {
  return colors[random.below(n)];
}

class City {
 public:
  City(const GenerateOptions& options, SceneBuilder& scene)
      : seed_(options.seed), scene_(scene), parts_(scene) {
    const uint64_t blocks = std::max<uint64_t>(1, options.triangles / kTrianglesPerBlock);
    while ((columns_ + 1) * (columns_ + 1) <= blocks) ++columns_;
    rows_ = (blocks + columns_ / 2) / columns_;
  }

  void make() {
    for (uint64_t column = 0; column < columns_; ++column)
      for (uint64_t row = 0; row < rows_; ++row) make_block(column, row);
  }

 private:
  void make_block(uint64_t column, uint64_t row) {
    Random random(seed_, {column, row});
    // Colors have their own random numbers, so that the triangles are the same with and without
    // colors.
    paint_ = Random(seed_, {column, row, 1});
    const Vec3 center{
        kPitch * (static_cast<double>(2 * column) - static_cast<double>(columns_ - 1)) / 2, 0,
        kPitch * (static_cast<double>(2 * row) - static_cast<double>(rows_ - 1)) / 2};
    // With colors, the color of the ground depends on whether the block becomes a park. Random
    // numbers decide this after make_street(). So with colors, the ground is added last, and
    // without colors it is added first.
    if (!scene_.has_colors()) make_ground(center, false);
    make_street(center, random);
    const bool is_park = random.chance(10);
    if (scene_.has_colors()) make_ground(center, is_park);
    if (is_park) return make_park(center, random);
    make_lots(center, centrality(column, row), random);
  }

  // Returns how central a block is: 1 in the middle of the city, near 0 at its edge.
  double centrality(uint64_t column, uint64_t row) const {
    const auto off_middle = [](uint64_t i, uint64_t count) {
      const double middle = 0.5 * static_cast<double>(count - 1);
      const double d = static_cast<double>(i) - middle;
      return (d < 0 ? -d : d) / (middle + 0.5);
    };
    return 1 - std::max(off_middle(column, columns_), off_middle(row, rows_));
  }

  void make_ground(const Vec3& c, bool is_park) {
    constexpr double kHalf = kPitch / 2, kHalfBlock = kBlock / 2;
    scene_.paint(kGround, kStreet);
    scene_.mesh_for(4, 2).quad({c.x - kHalf, 0, c.z - kHalf}, {c.x - kHalf, 0, c.z + kHalf},
                               {c.x + kHalf, 0, c.z + kHalf}, {c.x + kHalf, 0, c.z - kHalf});
    scene_.paint(kGround, is_park ? kGrass : kPavementColor);
    scene_.mesh_for(8, 10).box({c.x - kHalfBlock, 0, c.z - kHalfBlock},
                               {c.x + kHalfBlock, kPavement, c.z + kHalfBlock}, false);
  }

  // Adds trees on the pavement of a block, and cars next to the pavement.
  void make_street(const Vec3& c, Random& random) {
    for (int side = 0; side < 4; ++side)
      for (int step = -2; step <= 2; ++step) {
        const double along = 9.5 * step, tree = side & 1 ? -25 : 25, car = side & 1 ? -27.5 : 27.5;
        if (random.chance(60)) plant(place(c, side, along, tree, kPavement), random);
        scene_.paint(kCars, one_of(kCarColors, paint_));
        if (random.chance(30))
          scene_.place(parts_.car[side / 2], place(c, side, along + 4.75, car, 0), {1, 1, 1});
      }
  }

  // Returns the point that is `along` and `across` away from the block's center `c`, measured along
  // a side and across it. Sides 0 and 1 run along x, 2 and 3 along z.
  static Vec3 place(const Vec3& c, int side, double along, double across, double height) {
    return side < 2 ? Vec3{c.x + along, height, c.z + across}
                    : Vec3{c.x + across, height, c.z + along};
  }

  void plant(const Vec3& foot, Random& random) {
    const double height = 5 + 0.5 * random.below(9);
    const auto shade = static_cast<uint8_t>(170 + paint_.below(86));
    scene_.paint(kPlants, {shade, 255, shade, 255});
    scene_.place(parts_.tree, foot, {height, height, height});
  }

  void make_park(const Vec3& c, Random& random) {
    for (int i = 0; i < 7; ++i)
      for (int j = 0; j < 7; ++j) {
        const double x = 6.5 * (i - 3) + 0.25 * random.between(-8, 8);
        const double z = 6.5 * (j - 3) + 0.25 * random.between(-8, 8);
        if (random.chance(70)) plant({c.x + x, kPavement, c.z + z}, random);
      }
  }

  // Fills a block with one tower, four buildings or nine small buildings. `central` is the block's
  // centrality().
  void make_lots(const Vec3& c, double central, Random& random) {
    const int across = central > 0.7 && random.chance(40)   ? 1
                       : central > 0.3 || random.chance(25) ? 2
                                                            : 3;
    const double width = kBuilt / across;
    const double usual = 2 + (across == 3 ? 2 : 22 * central * central + (across == 1 ? 12 : 3));
    for (int i = 0; i < across; ++i)
      for (int j = 0; j < across; ++j) {
        const Vec3 center{c.x + width * (2 * i - across + 1) / 2, kPavement,
                          c.z + width * (2 * j - across + 1) / 2};
        const auto floors = static_cast<uint32_t>(usual * (0.5 + 0.75 * random.unit()) + 0.5);
        Lot lot{center, width - 2.5, std::max(1u, floors), {}, {}};
        lot.wall = one_of(kWalls, paint_);
        lot.roof = one_of(kRoofs, paint_);
        if (across == 3 && random.chance(30))
          add_turned_house(scene_, lot, random);
        else
          add_building(scene_, parts_, lot, random);
      }
  }

  const uint64_t seed_;
  SceneBuilder& scene_;
  const CityParts parts_;
  Random paint_{0, {}};
  uint64_t columns_ = 0;
  uint64_t rows_ = 0;
};

}  // namespace

const std::array<SceneMaterial, 4> kCityMaterials{{{"ground", {0.5f, 0.49f, 0.47f}},
                                                   {"buildings", {0.82f, 0.8f, 0.76f}},
                                                   {"plants", {0.22f, 0.42f, 0.09f}},
                                                   {"cars", {1, 1, 1}}}};

void make_city(const GenerateOptions& options, SceneBuilder& scene) { City(options, scene).make(); }

}  // namespace voxdag
