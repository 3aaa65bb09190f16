// The two modes of the self-test: comparing backends, and measuring them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/backend/backend.h"

namespace voxdag::selftest {

// A backend to test, and its name in the printed tables.
struct Subject {
  std::string name;
  std::function<std::unique_ptr<Backend>()> open;
};

enum class Comparison {
  kFull,
  kQuick,    // only small cubes
  kMinimal,  // only the first subject and cubes of 64^3 voxels
};

// Builds all scenes of scenes.h with each subject and with the CPU backend. Compares every level
// array and count, and prints a table. Returns true if all results are equal.
bool compare_with_cpu(const std::vector<Subject>& subjects, Comparison comparison);

struct BenchOptions {
  uint32_t grid_levels = 12;
  int64_t subvolume_edge = 0;  // in voxels; 0 for an eighth of the grid's edge
  unsigned workers = 2;        // threads of a subject, each with its own backend
  unsigned cpu_workers = 1;    // threads of the CPU backend
  uint64_t worker_bytes = uint64_t{8} << 30;
};

// Builds two large scenes subvolume by subvolume and prints voxels per second of wall time.
void bench(const std::vector<Subject>& subjects, BenchOptions options);

}  // namespace voxdag::selftest
