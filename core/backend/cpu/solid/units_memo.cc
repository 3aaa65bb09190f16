#include "core/backend/cpu/solid/units_memo.h"

#include <bit>

#include "core/backend/backend_memory.h"

namespace voxdag::cpu {
namespace {

constexpr uint64_t kMaxUnitsSlots = uint64_t{1} << 14;
constexpr uint64_t kMinUnitsSlots = 256;

}  // namespace

UnitsMemo::UnitsMemo(PooledMemory& memory) {
  constexpr uint64_t kSlotBytes = sizeof(VoxelBlock) + sizeof(Units);
  const uint64_t max_bytes = BackendMemory::block_memo_bytes(memory.budget.available());
  uint64_t slots = kMaxUnitsSlots;
  while (slots >= kMinUnitsSlots && slots * kSlotBytes > max_bytes) slots /= 2;
  if (slots < kMinUnitsSlots) return;
  blocks_ = PooledArray<VoxelBlock>(memory, slots, PooledArray<VoxelBlock>::kZero);
  units_ = PooledArray<Units>(memory, slots);
  slots_ = slots;
  shift_ = 64 - std::countr_zero(slots);
}

}  // namespace voxdag::cpu
