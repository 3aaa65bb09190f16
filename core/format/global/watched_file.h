// A mapped file while somebody works on it. One that is truncated, or whose disk fails, would end
// the process by SIGBUS; watched, what cannot be read is zeros, and the work is an error.
#pragma once

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/watched_mapping.h"

namespace voxdag {

class WatchedFile {
 public:
  // `file` must outlive this.
  explicit WatchedFile(const voxdag_reader::File& file)
      : file_(file), mapping_(file.data(), file.file_bytes()) {}

  // Throws Error{kIo} if a part of the file could not be read since then: what was made from it is
  // to be thrown away.
  void expect_whole() const {
    if (mapping_.is_damaged())
      throw Error(ErrorCode::kIo,
                  file_.path() + ": it became shorter, or its disk failed, while it was read");
  }

  // Returns what work() returns, which has to ask expect_whole() before it shows what it has made.
  // Its own errors may follow from zeros.
  template <class Work>
  auto run(const Work& work) const {
    try {
      return work();
    } catch (const Error&) {
      expect_whole();
      throw;
    }
  }

 private:
  const voxdag_reader::File& file_;
  const WatchedMapping mapping_;
};

}  // namespace voxdag
