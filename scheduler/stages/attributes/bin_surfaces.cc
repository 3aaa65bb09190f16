#include "scheduler/stages/attributes/bin_surfaces.h"

#include <algorithm>
#include <array>

#include "core/base/options/option_text.h"
#include "core/color/snap_surface.h"
#include "core/format/checksum.h"
#include "scheduler/stages/ingest/ingest.h"
#include "scheduler/stages/ingest/read_pieces.h"
#include "scheduler/stages/partition/partition.h"
#include "scheduler/state/checkpoint/content_digest.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

bool is_white(const std::array<uint16_t, 4>& color) {
  return color[0] == kFullIntensity && color[1] == kFullIntensity && color[2] == kFullIntensity;
}

bool has_color(const FixedSurface& surface, const Material& material) {
  return material.image != Material::kNoImage || !is_white(material.factor) ||
         !std::ranges::all_of(surface.corners, is_white, &SurfaceCorner::color);
}

// A piece of the scene as records, with the bins of each record.
class SurfacePiece {
 public:
  SurfacePiece(const SurfaceBinning& binning, const CubeTree& tree, MemoryBudget& budget)
      : binning_(binning),
        tree_(tree),
        charge_(
            budget,
            kPieceTriangles * (2 * kMaxSurfaceRecordBytes + binning.record_bytes + sizeof(Record)) +
                kMaxPlaces * sizeof(Place),
            "a piece of the scene") {}

  void read(TriangleCursor& cursor, uint64_t first, uint64_t count) {
    bytes_.clear();
    records_.clear();
    triangles_.clear();
    places_.clear();
    late_ = kNone;
    has_colors_ = false;
    cursor.read_surfaces(first, count, [this](std::span<const SurfaceTriangle> batch) {
      for (const SurfaceTriangle& surface : batch) add(surface);
    });
    checksum_ = checksum128(triangles_);
  }
  const Checksum128& checksum() const { return checksum_; }
  bool has_colors() const { return has_colors_; }

  void copy(ChunkWriter& writer, std::span<BinContent> contents) {
    const auto copy_to = [&](size_t bin, const Record& record) {
      writer.append(bin, bytes_of(record), 1);
      BinContent& content = contents[bin];
      ++content.surfaces;
      content.sum.low += record.digest.low;
      content.sum.high += record.digest.high;
      const uint32_t image = binning_.materials[record.material].image;
      if (image != Material::kNoImage) content.images.set(image % content.images.size());
    };
    for (const Place& place : places_) copy_to(place.bin, records_[place.record]);
    for (size_t i = late_; i < records_.size(); ++i) {
      const auto surface = SurfaceRecords(bytes_of(records_[i])).next();
      tree_.for_each_touched(surface->position, hint_,
                             [&](size_t bin) { copy_to(bin, records_[i]); });
    }
  }

 private:
  struct Record {
    uint32_t offset, bytes;  // position in bytes_
    uint32_t material;
    Checksum128 digest;
  };
  // The indexes of a record and of a bin that gets this record.
  struct Place {
    uint32_t bin, record;
  };
  static constexpr size_t kNone = ~size_t{0};
  // Maximum number of places in memory. If the triangles of a piece touch so many bins that the
  // places could exceed this number, places_ omits the records from late_ on. copy() then finds the
  // bins of these records.
  static constexpr size_t kMaxPlaces = 4 * kPieceTriangles;

  std::span<const std::byte> bytes_of(const Record& record) const {
    return std::span(bytes_).subspan(record.offset, record.bytes);
  }
  bool has_image(uint32_t material) const {
    return binning_.materials[material].image != Material::kNoImage;
  }

  void add(const SurfaceTriangle& triangle) {
    FixedSurface surface;
    if (snap_surface(binning_.grid, triangle, surface) != SnapResult::kInside) return;
    const size_t begin = bytes_.size(), record = records_.size();
    append_identity(surface, binning_.cutouts, binning_.record_bytes, triangles_);
    append_surface(surface, has_image(surface.material), bytes_);
    has_colors_ = has_colors_ || has_color(surface, binning_.materials[surface.material]);
    records_.push_back({static_cast<uint32_t>(begin),
                        static_cast<uint32_t>(bytes_.size() - begin),
                        surface.material,
                        {}});
    records_.back().digest =
        surface_digest(bytes_of(records_.back()), binning_.looks[surface.material]);
    if (late_ != kNone) return;
    if (places_.size() + binning_.cubes.size() > kMaxPlaces) {
      late_ = record;
      return;
    }
    tree_.for_each_touched(surface.position, hint_, [&](size_t bin) {
      places_.push_back({static_cast<uint32_t>(bin), static_cast<uint32_t>(record)});
    });
  }

  const SurfaceBinning& binning_;
  const CubeTree& tree_;
  const MemoryCharge charge_;
  CubeTree::Hint hint_;
  std::vector<std::byte> bytes_, triangles_;  // the records; the data for ingest's digest
  std::vector<Record> records_;               // their data is in bytes_
  std::vector<Place> places_;
  size_t late_ = kNone;  // first record whose places were not added
  bool has_colors_ = false;
  Checksum128 checksum_;
};

}  // namespace

BinnedSurfaces bin_surfaces(TriangleSource& scene, const SurfaceBinning& binning,
                            RecordStore& store, const StageContext& context) {
  const CubeTree tree(binning.grid.levels, Cube{}, binning.cubes);
  BinnedSurfaces binned;
  binned.bins.resize(binning.cubes.size());
  binned.contents.resize(binning.cubes.size());
  ChunkWriter writer = surface_writer(store, binned.bins, binning.buffer_bytes);
  ContentDigest digest = initial_digest(binning.grid, binning.cutouts);
  uint64_t position = 0;
  context.build.progress.begin_stage("surfaces", scene.declared_triangles(), "triangles");
  read_pieces<SurfacePiece>(
      scene, position, context, [&](auto& piece) { piece.emplace(binning, tree, context.budget); },
      [&](SurfacePiece& piece, uint64_t end) {
        piece.copy(writer, binned.contents);
        binned.have_colors |= piece.has_colors();
        digest.add(piece.checksum());
        position = end;
      });
  writer.flush();
  context.build.progress.end_stage();
  if (digest.hex() != binning.digest)
    throw Error(ErrorCode::kInvalidInput,
                "the scene's triangles differ from the built triangles (digest " +
                    binning.digest.substr(0, 16) + ", now " + digest.hex().substr(0, 16) +
                    "): expected a scene that does not change during the build; start over "
                    "with " +
                    option_text("restart"));
  return binned;
}

}  // namespace voxdag
