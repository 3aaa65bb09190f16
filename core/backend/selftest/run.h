// What the self-test does with backends: compare them, and time them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/backend/backend.h"

namespace voxdag::selftest {

// A backend by the name that tables show.
struct Subject {
  std::string name;
  std::function<std::unique_ptr<Backend>()> open;
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
