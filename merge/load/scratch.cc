#include "merge/load/scratch.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag {

void MergeScratch::remove_all_but(const std::set<std::string>& names) {
  const auto is_ours = [](const std::string& name) {
    return name.starts_with("merge-") || name.starts_with("segment-");
  };
  for (const DirectoryEntry& entry : files_.list(path_))
    if (!entry.is_directory && is_ours(entry.name) && !names.contains(entry.name))
      files_.remove(path_ + "/" + entry.name);
}

ScratchPath::~ScratchPath() {
  if (kept_) return;
  try {
    folder_.files().remove(path());
  } catch (const Error&) {
    // A file left over is garbage that the next merge there removes.
  }
}

ScratchFile::ScratchFile(MergeScratch& folder)
    : folder_(folder),
      record_{folder.take_id(), 0, {}},
      path_(std::make_shared<ScratchPath>(folder, name_of(record_.id))),
      out_(folder.files().create(path_->path())),
      in_(folder.files().open_read(path_->path())) {}

ScratchFile::ScratchFile(MergeScratch& folder, ScratchRecord record)
    : folder_(folder),
      record_(std::move(record)),
      path_(std::make_shared<ScratchPath>(folder, name_of(record_.id))),
      in_(folder.files().open_read(path_->path())) {}

void ScratchFile::write(uint64_t first_word, std::span<const uint32_t> words) {
  out_->write_at(first_word * sizeof(uint32_t), std::as_bytes(words));
  folder_.count_written(words.size_bytes());
  record_.words = std::max(record_.words, first_word + words.size());
  record_.sums.resize((record_.words + kBlockWords - 1) / kBlockWords);
  while (!words.empty()) {
    const auto part =
        words.first(std::min<uint64_t>(words.size(), kBlockWords - first_word % kBlockWords));
    record_.sums[first_word / kBlockWords] += indexed_sum(first_word, part);
    words = words.subspan(part.size());
    first_word += part.size();
  }
}

void ScratchFile::read(uint64_t first_word, std::span<uint32_t> words) const {
  if (first_word > record_.words || words.size() > record_.words - first_word)
    throw Error(ErrorCode::kCorrupt, path_->path() + " holds fewer words than are looked for");
  uint32_t block[kBlockWords];
  while (!words.empty()) {
    const uint64_t begin = first_word / kBlockWords * kBlockWords;
    const std::span<uint32_t> whole(block, std::min(kBlockWords, record_.words - begin));
    in_->read_at(begin * sizeof(uint32_t), std::as_writable_bytes(whole));
    if (indexed_sum(begin, whole) != record_.sums[begin / kBlockWords])
      throw Error(ErrorCode::kCorrupt, path_->path() + " at byte " +
                                           std::to_string(begin * sizeof(uint32_t)) +
                                           " is not what was written");
    const auto wanted = whole.subspan(first_word - begin);
    const size_t count = std::min(words.size(), wanted.size());
    std::copy_n(wanted.begin(), count, words.begin());
    words = words.subspan(count);
    first_word += count;
  }
}

}  // namespace voxdag
