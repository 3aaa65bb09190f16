#include "merge/load/scratch_file.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag {

void ScratchFolder::make() { files_.make_directories(path_); }

void ScratchFolder::remove_all_but(const std::set<std::string>& names) {
  if (!files_.exists(path_)) return;
  const auto is_ours = [](const std::string& name) {
    return name.starts_with("merge-") || name.starts_with("segment-");
  };
  for (const DirectoryEntry& entry : files_.list(path_))
    if (!entry.is_directory && is_ours(entry.name) && !names.contains(entry.name))
      files_.remove(path_ + "/" + entry.name);
}

ScratchPath::~ScratchPath() {
  if (retained_) return;
  try {
    folder_.files().remove(path());
  } catch (const Error&) {
    // This error is ignored, because the next merge in this folder removes the file.
  }
}

ScratchFile::ScratchFile(ScratchFolder& folder)
    : folder_(folder),
      state_{folder.next_id(), 0, {}},
      path_(std::make_shared<ScratchPath>(folder, name_of(state_.id))) {
  folder.make();
  out_ = folder.files().create(path_->path());
  in_ = folder.files().open_own(path_->path());
}

ScratchFile::ScratchFile(ScratchFolder& folder, ScratchFileState state)
    : folder_(folder),
      state_(std::move(state)),
      path_(std::make_shared<ScratchPath>(folder, name_of(state_.id))),
      in_(folder.files().open_own(path_->path())) {}

void ScratchFile::write(uint64_t first_word, std::span<const uint32_t> words) {
  out_->write_at(first_word * sizeof(uint32_t), std::as_bytes(words));
  folder_.count_written(words.size_bytes());
  state_.words = std::max(state_.words, first_word + words.size());
  state_.checksums.resize((state_.words + kBlockWords - 1) / kBlockWords);
  while (!words.empty()) {
    const auto part =
        words.first(std::min<uint64_t>(words.size(), kBlockWords - first_word % kBlockWords));
    state_.checksums[first_word / kBlockWords] += indexed_checksum(first_word, part);
    words = words.subspan(part.size());
    first_word += part.size();
  }
}

void ScratchFile::read(uint64_t first_word, std::span<uint32_t> words) const {
  if (first_word > state_.words || words.size() > state_.words - first_word)
    throw Error(ErrorCode::kCorrupt, path_->path() + ": expected at least " +
                                         std::to_string(first_word + words.size()) +
                                         " words, found " + std::to_string(state_.words));
  uint32_t block[kBlockWords];
  while (!words.empty()) {
    const uint64_t begin = first_word / kBlockWords * kBlockWords;
    const std::span<uint32_t> whole(block, std::min(kBlockWords, state_.words - begin));
    in_->read_at(begin * sizeof(uint32_t), std::as_writable_bytes(whole));
    if (indexed_checksum(begin, whole) != state_.checksums[begin / kBlockWords])
      throw Error(ErrorCode::kCorrupt,
                  path_->path() + ": bytes " + std::to_string(begin * sizeof(uint32_t)) + " to " +
                      std::to_string((begin + whole.size()) * sizeof(uint32_t) - 1) +
                      " fail their checksum");
    const auto tail = whole.subspan(first_word - begin);
    const size_t count = std::min(words.size(), tail.size());
    std::copy_n(tail.begin(), count, words.begin());
    words = words.subspan(count);
    first_word += count;
  }
}

}  // namespace voxdag
