// Building subvolumes for the self-test: triangles from memory, sub-DAGs kept or only counted.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/backend/backend.h"

namespace voxdag::selftest {

// A backend by the name that tables show.
struct Subject {
  std::string name;
  std::function<std::unique_ptr<Backend>()> open;
};

class MemoryStream : public TriangleStream {
 public:
  explicit MemoryStream(std::span<const FixedTriangle> triangles) : triangles_(triangles) {}
  uint64_t count() const override { return triangles_.size(); }
  void rewind() override { next_ = 0; }
  size_t read(std::span<FixedTriangle> out) override {
    const size_t n = std::min(out.size(), triangles_.size() - next_);
    std::copy_n(triangles_.begin() + static_cast<std::ptrdiff_t>(next_), n, out.begin());
    next_ += n;
    return n;
  }

 private:
  std::span<const FixedTriangle> triangles_;
  size_t next_ = 0;
};

// Builds scenes of every kind by the subject and by the CPU backend, compares every level array and
// count, prints a table. `quick` takes small cubes only. True if all are equal.
bool compare_with_cpu(const std::vector<Subject>& subjects, bool quick);

struct BenchOptions {
  uint32_t grid_levels = 12;
  int64_t subvolume_edge = 0;  // 0 for an eighth of the grid's
  unsigned workers = 2;        // of a subject, each with a backend of its own
  unsigned cpu_workers = 1;
  uint64_t worker_bytes = uint64_t{8} << 30;
};

// Builds two large scenes subvolume by subvolume and prints voxels per second of wall time.
void bench(const std::vector<Subject>& subjects, BenchOptions options);

}  // namespace voxdag::selftest
