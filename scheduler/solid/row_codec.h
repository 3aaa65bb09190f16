// Compresses the numbers of sample rows as runs of equal numbers: each run is the difference from
// the previous run's number and the run's length, both as variable-length integers. Most rows have
// the number of their neighbor.
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
