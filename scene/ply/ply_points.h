// The vertices of a PLY file without faces and strips, as points.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "scene/messages.h"
#include "scene/ply/ply_file.h"
#include "scene/ply/surfaces.h"
#include "scene/ply/vertex_reader.h"
#include "scene/points/point_file.h"

namespace voxdag::ply {

class VertexPointReader : public points::PointReader {
 public:
  VertexPointReader(const PlyFile& ply, Surfaces& surfaces, MemoryBudget& budget)
      : ply_(ply),
        surfaces_(surfaces),
        budget_(budget),
        positions_(ply, ply.layout().axes, budget) {}

  void read(uint64_t first, size_t count, double* xyz) override {
    positions_.read(first, count, xyz);
  }
  void read_colors(uint64_t first, size_t count, Color* out) override {
    const ColorScale& scale = surfaces_.values().vertex_colors;
    if (!colors_) colors_.emplace(ply_, ply_.layout().vertex_colors, budget_);
    numbers_.resize(scale.channels() * count);
    colors_->read(first, count, numbers_.data());
    for (size_t i = 0; i < count; ++i) out[i] = scale.to_color(&numbers_[scale.channels() * i]);
  }
  std::string fault_of(uint64_t point) override {
    return "vertex " + std::to_string(point) + not_finite();
  }

 private:
  const PlyFile& ply_;
  Surfaces& surfaces_;
  MemoryBudget& budget_;
  VertexReader positions_;
  std::optional<VertexReader> colors_;
  std::vector<double> numbers_;
};

class VertexPoints : public points::PointFile {
 public:
  VertexPoints(FileSystem& files, std::unique_ptr<const PlyFile> ply, MemoryBudget& budget,
               const CancelToken& cancel)
      : ply_(std::move(ply)), surfaces_(std::make_unique<Surfaces>(files, *ply_, budget, cancel)) {}

  const ReadableFile& file() const override { return ply_->file(); }
  uint64_t count() const override { return ply_->vertex_element().count; }
  bool has_colors() const override { return !ply_->layout().vertex_colors.empty(); }
  std::vector<Warning> warnings() const override { return ply_->warnings(); }
  std::unique_ptr<points::PointReader> open(unsigned, MemoryBudget& budget) const override {
    return std::make_unique<VertexPointReader>(*ply_, *surfaces_, budget);
  }

 private:
  const std::unique_ptr<const PlyFile> ply_;
  const std::unique_ptr<Surfaces> surfaces_;
};

}  // namespace voxdag::ply
