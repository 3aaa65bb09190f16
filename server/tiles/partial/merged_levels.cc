#include "server/tiles/partial/merged_levels.h"

#include <cstring>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/global_layout.h"
#include "core/io/framed_mapping.h"
#include "scheduler/state/work_folder.h"

namespace voxdag::server {
namespace {

using namespace global_layout;

// The largest frame has 8 bytes for each 64 KiB of the file.
constexpr uint64_t kMaxFrameBytes = uint64_t{1} << 30;

std::string frame_path(const JobFolder& folder) { return WorkFolder::frame_path(folder.work()); }

// The mapped levels with their frame. `bytes` refers to `mapping`.
struct FramedLevels {
  FramedLevels(const std::string& path, std::span<const std::byte> frame, uint64_t table_offset)
      : mapping(path, frame.first(kPageBytes), table_offset, frame.subspan(kPageBytes)),
        bytes(mapping.data(), mapping.size()) {}
  const FramedMapping mapping;
  const voxdag_reader::Bytes bytes;
};

}  // namespace

MergedLevels::MergedLevels(FileSystem& files, const JobFolder& folder, const FileIdentity& frame,
                           std::shared_ptr<const voxdag_reader::Bytes> bytes, uint64_t inode)
    : FileTileSource(folder.result() + ".partial", frame, std::move(bytes)),
      files_(files),
      folder_(folder),
      inode_(inode) {}

std::shared_ptr<MergedLevels> MergedLevels::open(FileSystem& files, const JobFolder& folder,
                                                 uint32_t grid_levels) {
  const std::string path = frame_path(folder);
  if (!files.exists(path)) return nullptr;
  try {
    const auto file = files.open_own(path);
    if (file->size() < kPageBytes || file->size() > kMaxFrameBytes) return nullptr;
    std::vector<std::byte> frame(file->size());
    file->read_at(0, frame);
    uint64_t table_offset = 0;
    std::memcpy(&table_offset, frame.data() + kTableOffsetAt, sizeof table_offset);
    const auto levels =
        std::make_shared<const FramedLevels>(folder.result() + ".partial", frame, table_offset);
    const std::shared_ptr<const voxdag_reader::Bytes> bytes(levels, &levels->bytes);
    std::shared_ptr<MergedLevels> merged(
        new MergedLevels(files, folder, file->identity(), bytes, levels->mapping.inode()));
    const bool is_expected = !merged->dag().empty() && merged->dag().grid_levels() == grid_levels;
    return is_expected ? merged : nullptr;
  } catch (const Error&) {
    // The job's process may be writing or removing one of the two files.
    return nullptr;
  }
}

bool MergedLevels::was_overwritten() const {
  const auto open = [&](const std::string& path) -> FileIdentity {
    try {
      return files_.open_own(path)->identity();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
      return {};
    }
  };
  return open(frame_path(folder_)) != identity() &&
         open(folder_.result() + ".partial").inode == inode_;
}

}  // namespace voxdag::server
