#include "core/format/verify/verify_scratch.h"

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {

void VerifyScratch::require_space(uint64_t bytes, const std::string& what) const {
  const std::string folder = parent_directory(prefix_);
  const uint64_t free = files_.free_space(folder);
  if (bytes <= free) return;
  throw Error(ErrorCode::kNoSpace,
              what + ": the temporary files need " + size_text(bytes) + " of disk space, but " +
                  folder + " has only " + size_text(free) +
                  " free: expected more free space, another folder (" + option_text("work") +
                  ") or a larger memory budget (" + option_text("memory") + ")");
}

UnnamedFile::UnnamedFile(VerifyScratch& scratch)
    : scratch_(scratch),
      folder_(scratch),
      out_(scratch.files().create(folder_.path() + "/tables")),
      in_(scratch.files().open_own(folder_.path() + "/tables")) {
  folder_.remove();
}

UnnamedFile::Folder::Folder(VerifyScratch& scratch)
    : files_(scratch.files()),
      path_([&] {
        try {
          return make_temporary_folder(scratch.prefix());
        } catch (const Error& error) {
          throw Error(error.code(), error.message() + ": expected a folder for temporary files (" +
                                        option_text("work") +
                                        "), or a memory budget that needs none (" +
                                        option_text("memory") + ")");
        }
      }()),
      registered_(std::make_unique<TemporaryPath>(path_)) {}

void UnnamedFile::Folder::remove() {
  if (!registered_) return;
  try {
    remove_tree(files_, path_);
    registered_.reset();
  } catch (const Error&) {
    // This error is ignored, because the destructor tries again.
  }
}

}  // namespace voxdag
