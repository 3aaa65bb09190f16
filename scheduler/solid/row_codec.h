// Compresses arrays with one integer per sample row (row_sums.h) as runs of equal integers. A run
// is encoded as two variable-length numbers: the difference from the previous run's integer, and
// the number of rows. Most rows have the same integer as their neighbor, so runs are long.
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
