// Compares tiles of different depths (numbers of levels): how many tiles and bytes five pictures
// need, and how fast one core encodes the tiles.
//
//     bench_tiles [--size WxH] [--pixels P --views VIEWS] FILE.vdag
//
// It prints the cameras of five views, as lines of a file VIEWS. For each depth, it prints the
// number of tiles that a viewer must load, and their bytes (uncompressed, and with gzip, tile by
// tile),
//   - until no cell of the view `auto` is wider than 16 pixels,
//   - until no cell is wider than one pixel, for each of five views and for all five together.
//
// Then it encodes the tiles of all five views in random order, and prints sizes and speeds for four
// cases:
// - cold: the file was dropped from the page cache (unless another process keeps it there);
// - warm: the file is in memory;
// - comparing: the checksum of each block of the file is compared at the first use of the block;
// - compared: the same once more, so the checksums of all used blocks have already been compared.
//
// VIEWS is a file whose lines have a name and the camera options of `voxdag render`. With it, only
// these views are measured, until no cell is wider than P pixels. The viewer uses P = 0.75.
#include <zlib.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <random>
#include <string>

#include "bench/page_cache.h"
#include "bench/tiles/needed_tiles.h"
#include "core/base/clock.h"
#include "core/format/global/open_global.h"
#include "query/rays/ray_caster.h"
#include "query/render/views.h"

namespace voxdag::query {
namespace {

using Addresses = NeededTiles::Addresses;

constexpr double kFirstPixels = 16, kLastPixels = 1;

uint64_t packed_bytes(const std::vector<uint32_t>& words, int level) {
  z_stream stream{};
  deflateInit2(&stream, level, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY);
  std::vector<Bytef> out(deflateBound(&stream, words.size() * 4));
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<uint32_t*>(words.data()));
  stream.avail_in = static_cast<uInt>(words.size() * 4);
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  deflateEnd(&stream);
  return stream.total_out;
}

struct Bytes {
  uint64_t plain = 0, packed = 0;
};
Bytes bytes_of(const DagView& dag, uint32_t depth, const Addresses& tiles) {
  Bytes sum;
  for (const auto& [level, offset] : tiles) {
    const auto words = encode_tile(dag, depth, {level, offset});
    sum.plain += words.size() * 4;
    sum.packed += packed_bytes(words, 1);
  }
  return sum;
}

struct View {
  std::string name;
  Placement placement;
};
// Returns the named views, and one more view from a point where a voxel in the middle of the `auto`
// view is four pixels wide.
std::vector<View> views_of(const DagView& dag, double aspect, int width, int height) {
  std::vector<View> views;
  for (const char* name : {"auto", "iso", "front", "left"})
    views.push_back({name, named_view(name, dag, aspect, {})});
  const Camera camera(views[0].placement, width, height);
  const Ray ray = camera.ray(width / 2.0, height / 2.0);
  Hit hit;
  if (RayCaster(dag).cast(ray, {0, camera.pixel_spread()}, 0, 1e30, hit)) {
    Placement close = views[0].placement;
    close.eye = ray.at(std::max(0.0, hit.t - 1 / (4 * camera.pixel_spread())));
    close.target = ray.at(hit.t);
    views.push_back({"close", close});
  }
  return views;
}

std::vector<View> views_of_file(const DagView& dag, const voxdag_reader::File& file,
                                const std::string& path) {
  std::ifstream in(path);
  std::vector<View> views;
  const double scale = static_cast<double>(dag.resolution()) / file.edge();
  for (std::string line; std::getline(in, line);) {
    char name[64];
    double eye[3], target[3];
    View view;
    if (std::sscanf(line.c_str(), "%63s --camera %lf,%lf,%lf --target %lf,%lf,%lf --fov %lf", name,
                    &eye[0], &eye[1], &eye[2], &target[0], &target[1], &target[2],
                    &view.placement.fov_degrees) != 8)
      continue;
    view.name = name;
    for (int axis = 0; axis < 3; ++axis) {
      view.placement.eye[axis] = (eye[axis] - file.origin()[axis]) * scale;
      view.placement.target[axis] = (target[axis] - file.origin()[axis]) * scale;
    }
    views.push_back(view);
  }
  return views;
}

// Prints views as lines of a file VIEWS.
void print_cameras(const std::vector<View>& views, const voxdag_reader::File& file) {
  for (const auto& [name, placement] : views) {
    const auto eye = world_point(placement.eye, file), target = world_point(placement.target, file);
    std::printf("%s --camera %.9g,%.9g,%.9g --target %.9g,%.9g,%.9g --fov %.9g\n", name.c_str(),
                eye[0], eye[1], eye[2], target[0], target[1], target[2], placement.fov_degrees);
  }
}

void print(uint32_t depth, const char* what, size_t tiles, const Bytes& bytes) {
  std::printf("depth %u  %-14s %7zu tiles  %8.2f MB  %8.2f MB packed\n", depth, what, tiles,
              static_cast<double>(bytes.plain) / 1e6, static_cast<double>(bytes.packed) / 1e6);
  std::fflush(stdout);
}

// Encodes all the tiles in random order, and prints their sizes and the speed.
void time_tiles(const std::string& path, uint32_t depth, const Addresses& tiles) {
  std::vector<TileAddress> order;
  for (const auto& [level, offset] : tiles) order.push_back({level, offset});
  std::shuffle(order.begin(), order.end(), std::mt19937_64(1));
  drop_from_page_cache(path);
  const auto file = open_global_file(path);
  const DagView dag(*file);
  const CheckedBlocks blocks(*file);
  const std::pair<const char*, const CheckedBlocks*> passes[] = {
      {"cold", nullptr}, {"warm", nullptr}, {"comparing", &blocks}, {"compared", &blocks}};
  for (const auto& [what, checks] : passes) {
    std::vector<size_t> sizes;
    const double start_s = wall_seconds(), start_cpu_s = process_cpu_seconds();
    for (const TileAddress& address : order)
      sizes.push_back(encode_tile(dag, depth, address, checks).size() * 4);
    const double wall_s = wall_seconds() - start_s, cpu_s = process_cpu_seconds() - start_cpu_s;
    uint64_t sum = 0;
    for (const size_t size : sizes) sum += size;
    std::sort(sizes.begin(), sizes.end());
    std::printf(
        "depth %u  %s: %.0f tiles/s, %.0f MB/s (%.3f s, %.3f s CPU); mean %llu bytes, "
        "p99 %zu, largest %zu\n",
        depth, what, static_cast<double>(order.size()) / wall_s,
        static_cast<double>(sum) / 1e6 / wall_s, wall_s, cpu_s,
        static_cast<unsigned long long>(sum / sizes.size()), sizes[sizes.size() * 99 / 100],
        sizes.back());
    std::fflush(stdout);
  }
}

void print_views(const DagView& dag, const std::vector<View>& views, double pixels, int width,
                 int height, std::vector<Addresses>& all) {
  for (const View& view : views) {
    const auto tiles = NeededTiles(dag, pixels).find(view.placement, width, height);
    for (uint32_t depth = 1; depth <= kMaxTileLevels; ++depth) {
      all[depth].insert(tiles[depth].begin(), tiles[depth].end());
      print(depth, view.name.c_str(), tiles[depth].size(), bytes_of(dag, depth, tiles[depth]));
    }
  }
  for (uint32_t depth = 1; depth <= kMaxTileLevels; ++depth)
    print(depth, "all views", all[depth].size(), bytes_of(dag, depth, all[depth]));
}

void run_views(const std::string& path, const std::string& views, double pixels, int width,
               int height) {
  std::vector<Addresses> all(kMaxTileLevels + 1);
  const auto file = open_global_file(path);
  const DagView dag(*file);
  print_views(dag, views_of_file(dag, *file, views), pixels, width, height, all);
}

void run(const std::string& path, int width, int height) {
  std::vector<Addresses> all(kMaxTileLevels + 1);
  {
    const auto file = open_global_file(path);
    const DagView dag(*file);
    const auto views = views_of(dag, static_cast<double>(width) / height, width, height);
    print_cameras(views, *file);
    const auto first = NeededTiles(dag, kFirstPixels).find(views[0].placement, width, height);
    for (uint32_t depth = 1; depth <= kMaxTileLevels; ++depth)
      print(depth, "first picture", first[depth].size(), bytes_of(dag, depth, first[depth]));
    print_views(dag, views, kLastPixels, width, height, all);
  }
  for (uint32_t depth = 1; depth <= kMaxTileLevels; ++depth) time_tiles(path, depth, all[depth]);
}

}  // namespace
}  // namespace voxdag::query

int main(int argc, char** argv) {
  int width = 1920, height = 1080;
  double pixels = 1;
  const char *path = nullptr, *views = nullptr;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--size") == 0 && i + 1 < argc)
      std::sscanf(argv[++i], "%dx%d", &width, &height);
    else if (std::strcmp(argv[i], "--pixels") == 0 && i + 1 < argc)
      pixels = std::atof(argv[++i]);
    else if (std::strcmp(argv[i], "--views") == 0 && i + 1 < argc)
      views = argv[++i];
    else
      path = argv[i];
  }
  if (!path) {
    std::fprintf(stderr, "usage: bench_tiles [--size WxH] [--pixels P --views VIEWS] FILE.vdag\n");
    return 2;
  }
  try {
    if (views)
      voxdag::query::run_views(path, views, pixels, width, height);
    else
      voxdag::query::run(path, width, height);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_tiles: %s\n", error.what());
    return 1;
  }
}
