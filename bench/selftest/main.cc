// voxdag-gpu-selftest compares the GPU backend's results with the CPU backend's, and measures the
// speed of both. To build, it needs only a compiler (and CUDA). See docs/gpu.md.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "bench/selftest/run.h"
#include "core/base/error.h"

namespace voxdag::selftest {
namespace {

constexpr char kUsage[] =
    "usage: voxdag-gpu-selftest [--backend cuda|parallel-host] [--quick|--minimal] [--bench [R]]\n"
    "                           [--workers N] [--subvolume EDGE]\n"
    "Builds scenes by the backend's three methods and by the CPU backend and compares every level\n"
    "array. --quick: small scenes only. --minimal: the default method and cubes of 64^3 voxels "
    "only,\n"
    "for slow tools such as racecheck. --bench: measures instead, at R voxels per edge (default\n"
    "4096), with N concurrent backends (default 2).\n";

struct Options {
  bool cuda = true, bench = false;
  Comparison comparison = Comparison::kFull;
  BenchOptions sizes;
};

uint32_t log2_of(uint64_t edge) {
  uint32_t levels = 0;
  while (uint64_t{1} << levels < edge) ++levels;
  return levels;
}

bool parse(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const char* value = i + 1 < argc && argv[i + 1][0] != '-' ? argv[i + 1] : nullptr;
    const uint64_t number = value ? std::strtoull(value, nullptr, 10) : 0;
    if (word == "--quick") {
      options.comparison = Comparison::kQuick;
    } else if (word == "--minimal") {
      options.comparison = Comparison::kMinimal;
    } else if (word == "--bench") {
      options.bench = true;
      if (number >= 64) options.sizes.grid_levels = log2_of(number), ++i;
    } else if (word == "--backend" && value) {
      options.cuda = std::strcmp(value, "cuda") == 0;
      if (!options.cuda && std::strcmp(value, "parallel-host") != 0) return false;
      ++i;
    } else if (word == "--workers" && number > 0) {
      options.sizes.workers = static_cast<unsigned>(number), ++i;
    } else if (word == "--subvolume" && number >= 64) {
      options.sizes.subvolume_edge = static_cast<int64_t>(number), ++i;
    } else {
      return false;
    }
  }
  return true;
}

std::vector<Subject> subjects(bool cuda) {
  const auto open = [cuda](Method method) {
    return [cuda, method] {
      return cuda ? make_cuda_backend(method) : make_parallel_host_backend(method);
    };
  };
  const std::string name = cuda ? "cuda" : "host";
  return {{name + " fast", open(Method::kFast)},
          {name + " hashes", open(Method::kHashes)},
          {name + " pointers", open(Method::kPointers)}};
}

int run(int argc, char** argv) {
  Options options;
  if (!parse(argc, argv, options)) {
    std::fputs(kUsage, stderr);
    return 2;
  }
  if (options.cuda && !cuda_device_available())
    throw Error(ErrorCode::kDevice, cuda_device_problem());
  if (options.bench) {
    options.sizes.cpu_workers = std::max(1u, std::thread::hardware_concurrency());
    bench(subjects(options.cuda), options.sizes);
    return 0;
  }
  const bool equal = compare_with_cpu(subjects(options.cuda), options.comparison);
  std::puts(equal ? "ALL EQUAL" : "THERE ARE DIFFERENCES");
  return equal ? 0 : 1;
}

}  // namespace
}  // namespace voxdag::selftest

int main(int argc, char** argv) {
  try {
    return voxdag::selftest::run(argc, argv);
  } catch (const voxdag::Error& error) {
    std::fprintf(stderr, "voxdag-gpu-selftest: %s\n", error.what());
    return voxdag::exit_status(error.code());
  }
}
