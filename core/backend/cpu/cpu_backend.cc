// The CPU backend; subvolume_build.h describes how a subvolume is built.
#include <memory>

#include "core/backend/backend.h"
#include "core/backend/cpu/subvolume_build.h"

namespace voxdag {
namespace {

class CpuBackend : public Backend {
 public:
  explicit CpuBackend(const cpu::Kernels& kernels) : kernels_(kernels) {}

  std::string_view name() const override { return "cpu"; }

  BuildOutcome build(const SubvolumeTask& task, TriangleStream& triangles, MemoryBudget& budget,
                     const CancelToken& cancel, SubDagSink& sink, SubDagSummary& summary) override {
    PooledMemory memory{budget, pages_};
    try {
      const auto build =
          std::make_unique<cpu::SubvolumeBuild>(task, kernels_, memory, cancel, table_sizes_);
      summary = build->run(triangles, sink);
      table_sizes_ = build->table_sizes();
      return BuildOutcome::kBuilt;
    } catch (const OutOfBudget&) {
      return BuildOutcome::kNeedsSplit;
    }
  }

 private:
  const cpu::Kernels& kernels_;
  PagePool pages_;
  TableSizes table_sizes_;  // sizes of the last subvolume's tables
};

}  // namespace

bool cpu_supports(Simd simd) {
  return simd == Simd::kNone || (simd == Simd::kAvx2 && cpu::avx2_kernels()) ||
         (simd == Simd::kAvx512 && cpu::avx512_kernels());
}

std::unique_ptr<Backend> make_cpu_backend(Simd max_simd) {
  const cpu::Kernels* kernels = max_simd >= Simd::kAvx512 ? cpu::avx512_kernels() : nullptr;
  if (!kernels && max_simd >= Simd::kAvx2) kernels = cpu::avx2_kernels();
  return std::make_unique<CpuBackend>(kernels ? *kernels : cpu::portable_kernels());
}

}  // namespace voxdag
