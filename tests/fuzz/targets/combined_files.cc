// Combines two global files (query/combine). An input has one byte with the operation and options,
// three bytes with the offset of the second file, four bytes with the size of the first file's
// input, and the inputs of the two files, which global_bytes.h describes. If the two files are
// valid, the result is valid and has the voxels that the operation selects.
#include <array>
#include <string>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/combine/combine.h"
#include "tests/fuzz/support/fuzz_target.h"
#include "tests/fuzz/support/global_bytes.h"
#include "tests/fuzz/support/memory_folder.h"

namespace voxdag {
namespace {

constexpr size_t kOptionBytes = 4;
constexpr uint64_t kBudgetBytes = uint64_t{64} << 20;
// Lists of this size make files of a few nodes use scratch files.
constexpr uint64_t kListBytes = 256;
// Grids with at most this edge are compared voxel by voxel.
constexpr int64_t kComparedEdge = 16;

bool has_voxel(const voxdag_reader::File& file, const std::array<int64_t, 3>& at) {
  for (const int64_t i : at)
    if (i < 0 || i >= file.resolution()) return false;
  return file.voxel(at[0], at[1], at[2]);
}

bool apply(query::Operation operation, bool a, bool b) {
  switch (operation) {
    case query::Operation::kUnion:
      return a || b;
    case query::Operation::kMinus:
      return a && !b;
    case query::Operation::kAnd:
      return a && b;
    case query::Operation::kXor:
      return a != b;
  }
  return false;
}

void compare_voxels(const voxdag_reader::File& a, const voxdag_reader::File& b,
                    const query::CombineSpec& spec, const voxdag_reader::File& result) {
  const int64_t edge = a.resolution();
  if (edge > kComparedEdge) return;
  const auto offset = spec.offset.value_or(std::array<int64_t, 3>{});
  for (int64_t x = 0; x < edge; ++x)
    for (int64_t y = 0; y < edge; ++y)
      for (int64_t z = 0; z < edge; ++z)
        fuzz::require(has_voxel(result, {x, y, z}) ==
                          apply(spec.operation, has_voxel(a, {x, y, z}),
                                has_voxel(b, {x - offset[0], y - offset[1], z - offset[2]})),
                      "the result has the voxels that the operation selects");
}

query::CombineSpec spec_of(std::span<const std::byte> options) {
  const auto bits = std::to_integer<unsigned>(options[0]);
  const auto distance = [&](size_t axis) {
    return static_cast<int64_t>(static_cast<int8_t>(options[1 + axis]));
  };
  query::CombineSpec spec;
  spec.operation = static_cast<query::Operation>(bits & 3);
  if (bits & 4) spec.offset = {distance(0), distance(1), distance(2)};
  spec.clip = bits & 8;
  spec.attributes = !(bits & 16);
  if (bits & 32) spec.fill_color = {20, 200, 90};
  if (bits & 64) spec.list_bytes = kListBytes;
  spec.replace = true;
  spec.memory_bytes = kBudgetBytes;
  spec.output = fuzz::memory_folder() + "/result.vdag";
  return spec;
}

void combine_files(const voxdag_reader::File& a, const voxdag_reader::File& b,
                   query::CombineSpec spec) {
  spec.narrow_words = std::min(fuzz::narrow_words_of(a), fuzz::narrow_words_of(b));
  const bool are_sound = fuzz::is_sound(a) && fuzz::is_sound(b);
  NoProgress progress;
  try {
    query::combine(a, b, spec, system_files(), progress, CancelToken());
    if (!are_sound) return;
    const auto result = open_global_file(spec.output);
    MemoryBudget budget(kBudgetBytes);
    verify_global_file(*result, 1, budget, progress, CancelToken(), spec.narrow_words);
    compare_voxels(a, b, spec, *result);
  } catch (const Error& error) {
    const bool is_refused =
        error.code() == ErrorCode::kInvalidInput || error.code() == ErrorCode::kLimit;
    fuzz::require(is_refused || !are_sound, "valid files can be combined");
    fuzz::require(is_refused || error.is_corruption(), "a bad file is an error of kind corrupt");
  }
}

}  // namespace
}  // namespace voxdag

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const auto input = fuzz::bytes_of(data, size);
  if (size < kOptionBytes + sizeof(uint32_t)) return 0;
  const auto files = input.subspan(kOptionBytes + sizeof(uint32_t));
  const size_t first = std::min<size_t>(fuzz::get<uint32_t>(input, kOptionBytes), files.size());
  const fuzz::NamelessFile a(fuzz::make_file(files.first(first))),
      b(fuzz::make_file(files.subspan(first)));
  try {
    combine_files(voxdag_reader::File(a.path()), voxdag_reader::File(b.path()),
                  spec_of(input.first(kOptionBytes)));
  } catch (const voxdag_reader::Error&) {
  }
  return 0;
}
