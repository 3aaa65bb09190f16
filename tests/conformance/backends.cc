// The backends that run on this machine.
#include <utility>

#include "tests/conformance/harness.h"

namespace voxdag {

std::vector<BackendUnderTest> backends_under_test() {
  std::vector<BackendUnderTest> all = {
      {"cpu", [] { return make_cpu_backend(); }},
      {"cpu_avx512", [] { return make_cpu_backend(Simd::kAvx512); }, Simd::kAvx512},
      {"cpu_avx2", [] { return make_cpu_backend(Simd::kAvx2); }, Simd::kAvx2},
      {"cpu_portable", [] { return make_cpu_backend(Simd::kNone); }},
      {"parallel_host_fast", [] { return make_parallel_host_backend(Method::kFast, 2); }},
      {"parallel_host_hashes", [] { return make_parallel_host_backend(Method::kHashes); }},
      {"parallel_host_pointers", [] { return make_parallel_host_backend(Method::kPointers); }}};
  if (cuda_device_available())
    for (const auto& [name, method] : {std::pair{"cuda_fast", Method::kFast},
                                       {"cuda_hashes", Method::kHashes},
                                       {"cuda_pointers", Method::kPointers}})
      all.push_back({name, [method = method] { return make_cuda_backend(method); }});
  return all;
}

}  // namespace voxdag
