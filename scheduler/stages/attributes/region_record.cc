#include "scheduler/stages/attributes/region_record.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/options/option_text.h"

namespace voxdag {
namespace {

// Calls field(value) for each number that has a fixed position in the record.
template <class Region, class Field>
void for_each_number(Region& region, const Field& field) {
  field(region.morton);
  for (auto& count : region.counts) field(count);
  for (auto& sum : region.total.seen) field(sum);
  field(region.total.seen_weight);
  for (auto& sum : region.total.plain) field(sum);
  field(region.total.weight);
}

}  // namespace

void append_region(const EncodedRegion& region, std::vector<std::byte>& out) {
  ByteSink sink(out);
  for_each_number(region, [&](const auto& value) { sink.put(value); });
  sink.put(static_cast<uint32_t>(region.blocks.size()));
  sink.put(static_cast<uint32_t>(region.prefix.size()));
  sink.put_bytes(region.blocks);
  sink.put_bytes(std::as_bytes(std::span(region.prefix)));
}

std::optional<EncodedRegion> RegionRecords::next() {
  if (in_.ok() && in_.left() == 0) return std::nullopt;
  EncodedRegion region;
  for_each_number(region, [&]<class T>(T& value) { value = in_.get<T>(); });
  const uint32_t block_bytes = in_.get<uint32_t>(), prefixes = in_.get<uint32_t>();
  const auto blocks = in_.take(block_bytes);
  const auto prefix = in_.take(prefixes * sizeof(uint32_t));
  if (!in_.ok())
    throw Error(ErrorCode::kCorrupt,
                path_ + ": record " + std::to_string(count_) +
                    " of the stored attributes is cut off: expected a complete region; start over "
                    "with " +
                    option_text("restart"));
  ++count_;
  region.blocks.assign(blocks.begin(), blocks.end());
  region.prefix.resize(prefixes);
  std::ranges::copy(prefix, std::as_writable_bytes(std::span(region.prefix)).begin());
  return region;
}

}  // namespace voxdag
