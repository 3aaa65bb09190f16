#include "merge/scratch.h"

#include "core/base/error.h"

namespace voxdag {

ScratchFile::ScratchFile(MergeScratch& folder)
    : folder_(folder),
      path_(folder.path() + "/merge-" + std::to_string(folder.next_file_id()) + ".tmp"),
      out_(folder.files().create(path_)),
      in_(folder.files().open_read(path_)) {}

ScratchFile::~ScratchFile() {
  out_.reset();
  in_.reset();
  try {
    folder_.files().remove(path_);
  } catch (const Error&) {
    // A file left over is garbage in the work folder, which is cleared as a whole.
  }
}

void ScratchFile::write(uint64_t first_word, std::span<const uint32_t> words) {
  out_->write_at(first_word * sizeof(uint32_t), std::as_bytes(words));
  folder_.count_written(words.size_bytes());
}

void ScratchFile::read(uint64_t first_word, std::span<uint32_t> words) const {
  in_->read_at(first_word * sizeof(uint32_t), std::as_writable_bytes(words));
}

}  // namespace voxdag
