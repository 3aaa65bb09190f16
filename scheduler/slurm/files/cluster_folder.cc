#include "scheduler/slurm/files/cluster_folder.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "core/base/error.h"
#include "core/format/artifact/segment_writer.h"

namespace voxdag {
namespace {

// Removes the number at the beginning of `text` and returns it. Returns nullopt if `text` does not
// begin with a number below kMaxBatches.
std::optional<uint32_t> parse_number(std::string_view& text) {
  uint32_t number = 0;
  const auto [rest, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failure != std::errc{} || number >= kMaxBatches) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(rest - text.data()));
  return number;
}

bool consume_prefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

// Calls `remove` and ignores its errors. It is possible that another process has already removed
// the file, or is still writing it. A remaining file costs only space.
template <class Remove>
void try_to_remove(const Remove& remove) {
  try {
    remove();
  } catch (const Error&) {
    // A remaining file is removed with the work folder.
  }
}

}  // namespace

std::string ClusterFolder::accepted_segment_path(uint32_t batch) const {
  return segment_path(work_folder_, segment_of(batch));
}

ClusterFolder::Entry parse_cluster_name(const std::string& name) {
  using Kind = ClusterFolder::Kind;
  ClusterFolder::Entry entry;
  std::string_view rest = name;
  const bool is_attempt = consume_prefix(rest, "attempt-");
  if (!is_attempt && !consume_prefix(rest, "batch-")) return entry;
  const auto batch = parse_number(rest);
  if (!batch) return entry;
  entry.batch = *batch;
  if (is_attempt) {
    if (!consume_prefix(rest, "-") || rest.empty()) return entry;
    entry.kind = Kind::kAttempt;
    entry.attempt = rest;
    return entry;
  }
  if (rest == ".vdbatch") {
    entry.kind = Kind::kBatch;
    return entry;
  }
  const Kind kind = consume_prefix(rest, ".record-")    ? Kind::kRecord
                    : consume_prefix(rest, ".failure-") ? Kind::kFailure
                                                        : Kind::kOther;
  if (kind == Kind::kOther || !rest.ends_with(".json")) return entry;
  entry.kind = kind;
  entry.attempt = rest.substr(0, rest.size() - 5);
  return entry;
}

std::vector<ClusterFolder::Entry> ClusterFolder::list(FileSystem& files) const {
  std::vector<Entry> entries;
  try {
    for (const DirectoryEntry& found : files.list(path_)) {
      entries.push_back(parse_cluster_name(found.name));
      entries.back().path = path_ + "/" + found.name;
    }
  } catch (const Error& error) {
    // The folder does not exist, or a finished build is removing it.
    if (error.code() != ErrorCode::kNotFound) throw;
  }
  std::ranges::sort(entries, {}, &Entry::path);
  return entries;
}

void ClusterFolder::remove_attempt(FileSystem& files, uint32_t batch,
                                   const std::string& attempt) const {
  const std::string folder = attempt_folder(batch, attempt);
  for (const std::string& path : {record_path(batch, attempt), failure_path(batch, attempt),
                                  segment_path(folder, segment_of(batch))})
    try_to_remove([&] { files.remove(path); });
  try_to_remove([&] { files.remove_directory(folder); });
}

}  // namespace voxdag
