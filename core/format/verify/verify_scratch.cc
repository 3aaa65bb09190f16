#include "core/format/verify/verify_scratch.h"

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"

namespace voxdag {
namespace {

TemporaryWork make_folder(VerifyScratch& scratch) {
  try {
    return {scratch.files(), scratch.prefix()};
  } catch (const Error& error) {
    throw Error(error.code(), error.message() + ": expected a folder for temporary files (" +
                                  option_text("work") + "), or a memory budget that needs none (" +
                                  option_text("memory") + ")");
  }
}

}  // namespace

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
      folder_(make_folder(scratch)),
      out_(scratch.files().create(folder_.path() + "/tables")),
      in_(scratch.files().open_own(folder_.path() + "/tables")) {
  folder_.remove();
}

}  // namespace voxdag
