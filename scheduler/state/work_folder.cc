#include "scheduler/state/work_folder.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/format/artifact/segment_writer.h"
#include "core/io/host_name.h"
#include "scheduler/state/build_locks.h"

namespace voxdag {
namespace {

constexpr std::string_view kLockName = "lock";
constexpr std::string_view kScratchName = "merge";
constexpr std::string_view kClusterName = "cluster";
// Maximum number of threads that remove files. A thread takes 0.5 s per GB of a cached file.
constexpr size_t kMaxRemovers = 4;
constexpr size_t kFilesPerRemover = 4;

// Returns the id in "segment-<id>.vdseg".
std::optional<uint32_t> segment_id(std::string_view name) {
  constexpr std::string_view kBefore = "segment-", kAfter = ".vdseg";
  if (!name.starts_with(kBefore) || !name.ends_with(kAfter)) return std::nullopt;
  uint32_t id = 0;
  const char* const end = name.data() + name.size() - kAfter.size();
  const auto [rest, failure] = std::from_chars(name.data() + kBefore.size(), end, id);
  if (failure != std::errc{} || rest != end) return std::nullopt;
  return id;
}

bool is_scratch(const DirectoryEntry& entry) {
  return !entry.is_directory && !entry.is_special &&
         (segment_id(entry.name) || entry.name.starts_with("merge-"));
}

// NFS gives such a name to a removed file that a process still has open.
bool is_left_by_nfs(std::string_view name) { return name.starts_with(".nfs"); }

// True for a file or folder of a cluster build (slurm/files/cluster_folder.h). Any entry, even a
// folder or a pipe, can have the name of a record; the build warns about it.
bool is_of_cluster(const DirectoryEntry& entry) {
  const std::string_view name = entry.name;
  if (name.starts_with("batch-") && name.ends_with(".json")) return true;
  if (entry.is_special) return false;
  if (entry.is_directory) return name.starts_with("attempt-");
  if (is_left_by_nfs(name)) return true;
  const auto is = [&](std::string_view begin, std::string_view end) {
    return name.starts_with(begin) && (name.ends_with(end) || name.ends_with(".partial"));
  };
  return is("batch-", ".vdbatch") || is("batch-", ".json") || is("log-", ".txt") ||
         is("cluster.json", "cluster.json");
}

bool is_ours(const DirectoryEntry& entry) {
  if (entry.is_special) return false;
  const std::string_view name = entry.name;
  if (is_left_by_nfs(name)) return true;
  if (entry.is_directory) return name == kScratchName || name == kClusterName;
  return name == kLockName || name == "job.db" || name == "job.db-wal" || name == "job.db-shm" ||
         name == "job.db-journal" || name.ends_with(".vdspill") || name.ends_with(".vddurable") ||
         name.ends_with(".vddurable.partial") || name == "merged.vdag.partial" ||
         segment_id(name).has_value();
}

}  // namespace

WorkFolder::WorkFolder(const BuildContext& context, std::string path, double max_wait_s)
    : files_(context.files), path_(std::move(path)) {
  const std::string lock_path = path_ + "/" + std::string(kLockName);
  // A build that is ending removes the folder, so each try creates the folder again if it is
  // missing.
  const auto try_lock = [&]() -> std::unique_ptr<FileLock> {
    files_.make_directories(parent_directory(path_));
    files_.make_directory(path_);
    inspect();
    try {
      return files_.try_lock(lock_path);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
      return nullptr;
    }
  };
  lock_ = wait_for_lock(try_lock, "the work folder " + path_, max_wait_s, context);
  if (!lock_)
    throw Error(ErrorCode::kIo, "the work folder " + path_ + " is in use by " +
                                    read_own_file(files_, lock_path, 1 << 12) +
                                    ": expected no other build in this folder");
  const std::string holder = "process " + std::to_string(getpid()) + " on " + host_name();
  // create() empties the file, because the previous holder's text can be longer.
  files_.create(lock_path)->write_at(0, std::as_bytes(std::span(holder)));
}

void WorkFolder::inspect() {
  const auto refuse = [&](const std::string& name) {
    const std::string option = option_text("work");
    throw Error(ErrorCode::kInvalidInput,
                "the work folder " + path_ + " holds " + name +
                    ", which was not created by voxdag: expected an empty "
                    "folder or the folder of an earlier build" +
                    (option.empty() ? "" : " (" + option + ")"));
  };
  const std::vector<DirectoryEntry> entries = files_.list(path_);
  const auto has = [&](std::string_view name) {
    return std::ranges::find(entries, name, &DirectoryEntry::name) != entries.end();
  };
  for (const DirectoryEntry& entry : entries)
    if (!is_ours(entry)) refuse(entry.name);
  const auto check_folder = [&](std::string_view name, bool (*is_known)(const DirectoryEntry&)) {
    if (!has(name)) return;
    const std::string folder = path_ + "/" + std::string(name);
    for (const DirectoryEntry& entry : files_.list(folder))
      if (!is_known(entry)) refuse(std::string(name) + "/" + entry.name);
  };
  check_folder(kScratchName, is_scratch);
  check_folder(kClusterName, is_of_cluster);
  existed_before_ = has(kLockName);
  was_empty_ = entries.empty();
}

std::string WorkFolder::holder(FileSystem& files, const std::string& folder) {
  const std::string lock_path = folder + "/" + std::string(kLockName);
  if (!files.exists(lock_path) || !files.is_locked(lock_path)) return "";
  return read_own_file(files, lock_path, 1 << 12);
}

std::vector<std::string> WorkFolder::files_in(FileSystem& files, const std::string& folder) {
  std::vector<std::string> paths;
  const std::string scratch = folder + "/" + std::string(kScratchName);
  try {
    for (const std::string& from : {folder, scratch})
      for (const DirectoryEntry& entry : files.list(from))
        if (from == scratch ? is_scratch(entry) : is_ours(entry) && !entry.is_directory)
          paths.push_back(from + "/" + entry.name);
  } catch (const Error& error) {
    // A build that is ending removes the folder.
    if (error.code() != ErrorCode::kNotFound) throw;
  }
  return paths;
}

std::unique_ptr<ReadableFile> WorkFolder::open_segment(uint32_t id) const {
  return files_.open_own(segment_path(path_, id));
}

uint32_t WorkFolder::next_segment_id() const {
  uint32_t next = 0;
  for (const DirectoryEntry& entry : files_.list(path_))
    if (const auto id = segment_id(entry.name); id && *id < kFirstClusterSegment)
      next = std::max(next, *id + 1);
  return next;
}

uint64_t WorkFolder::bytes() const {
  uint64_t bytes = 0;
  for (const std::string& folder : {path_, scratch_path(), cluster_path()}) {
    if (!files_.exists(folder)) continue;
    for (const DirectoryEntry& entry : files_.list(folder))
      if (!entry.is_directory) bytes += std::min(entry.bytes, entry.disk_bytes);
  }
  return bytes;
}

void WorkFolder::remove_garbage(const std::function<bool(uint32_t segment)>& is_named) {
  for (const DirectoryEntry& entry : files_.list(path_)) {
    const auto id = segment_id(entry.name);
    if (id && !is_named(*id)) files_.remove(path_ + "/" + entry.name);
  }
}

// Removes the files, and the folder if it is then empty. Running tasks can add files at any time.
// Then the folder remains.
void WorkFolder::remove_cluster_files() {
  if (!files_.exists(cluster_path())) return;
  for (const DirectoryEntry& entry : files_.list(cluster_path())) {
    if (!is_of_cluster(entry)) continue;
    const std::string path = cluster_path() + "/" + entry.name;
    if (!entry.is_directory) {
      remove_silently(path);
      continue;
    }
    // The attempt's task can remove the folder at the same time.
    try {
      for (const DirectoryEntry& inner : files_.list(path))
        if (segment_id(inner.name)) remove_silently(path + "/" + inner.name);
    } catch (const Error&) {
      continue;
    }
    remove_if_empty(path);
  }
  remove_if_empty(cluster_path());
}

void WorkFolder::release(const SegmentRange& range) {
  std::unique_ptr<WritableFile>& file = released_[range.segment];
  if (!file) file = files_.open_write(segment_path(path_, range.segment));
  file->release(range.offset, range.bytes);
}

void WorkFolder::empty_scratch() {
  for (const std::string& path : scratch_files()) files_.remove(path);
}

void WorkFolder::sync_names() {
  files_.sync_directory(parent_directory(path_));
  files_.sync_directory(path_);
}

std::vector<std::string> WorkFolder::scratch_files() const {
  std::vector<std::string> paths;
  if (!files_.exists(scratch_path())) return paths;
  for (const DirectoryEntry& entry : files_.list(scratch_path()))
    if (is_scratch(entry)) paths.push_back(scratch_path() + "/" + entry.name);
  return paths;
}

void WorkFolder::remove_if_empty(const std::string& folder) {
  try {
    files_.remove_directory(folder);
  } catch (const Error&) {
    // The folder has files of other programs, or new files of a running task.
  }
}

void WorkFolder::write_frame(std::span<const std::byte> header, std::span<const std::byte> table) {
  try {
    const auto file = files_.create(frame_path());
    file->write_at(0, header);
    file->write_at(header.size(), table);
  } catch (const Error&) {
    remove_frame();
  }
}

void WorkFolder::remove_silently(const std::string& path) {
  try {
    if (files_.exists(path)) files_.remove(path);
  } catch (const Error&) {
    // A remaining file costs space; the next build in this folder removes it.
  }
}

void WorkFolder::remove() {
  released_.clear();
  try {
    // The lock file is removed last, so that no other build uses the folder before it is empty. The
    // sample rows of a solid are removed after the job store: a build that resumes with this store
    // needs them for its report.
    const std::vector<DirectoryEntry> entries = files_.list(path_);
    const auto has = [&](const std::string& path) {
      return std::ranges::any_of(
          entries, [&](const DirectoryEntry& entry) { return path_ + "/" + entry.name == path; });
    };
    const bool has_scratch = has(scratch_path());
    std::vector<std::string> others;
    if (has_scratch) others = scratch_files();
    for (const DirectoryEntry& entry : entries)
      if (is_ours(entry) && !entry.is_directory && entry.name != kLockName &&
          path_ + "/" + entry.name != rows_path())
        others.push_back(path_ + "/" + entry.name);
    const size_t removers = std::min(others.size() / kFilesPerRemover, kMaxRemovers);
    parallel_for(static_cast<unsigned>(removers), others.size(),
                 [&](unsigned, size_t i) { files_.remove(others[i]); });
    if (has(rows_path())) remove_rows();
    if (has(cluster_path())) remove_cluster_files();
    if (has_scratch) files_.remove_directory(scratch_path());
    files_.remove(path_ + "/" + std::string(kLockName));
    files_.remove_directory(path_);
  } catch (const Error&) {
    // Remaining files only cost space.
  }
}

}  // namespace voxdag
