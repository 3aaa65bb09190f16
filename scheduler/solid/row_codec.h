// Compresses the numbers of sample rows (row_sums.h) as runs of equal numbers. A run is encoded as
// the difference from the previous run's number and the run's length, both as variable-length
// integers. Most rows have the same number as their neighbor, so runs are long.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxdag {

void encode_rows(std::span<const int32_t> numbers, std::vector<std::byte>& out);
// Decodes `bytes` into `out`. Returns false unless they decode to exactly out.size() numbers.
bool decode_rows(std::span<const std::byte> bytes, std::span<int32_t> out);

}  // namespace voxdag
