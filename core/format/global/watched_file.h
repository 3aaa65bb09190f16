// Protects work on a mapped file. Without this protection, a truncated file or a failing disk would
// end the process with SIGBUS. While a WatchedFile exists, unreadable pages of the file read as
// zeros, and check_readable() reports them as an error.
#pragma once

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/watched_mapping.h"

namespace voxdag {

class WatchedFile {
 public:
  // `file` must outlive this object.
  explicit WatchedFile(const voxdag_reader::File& file)
      : file_(file), mapping_(file.data(), file.file_bytes()) {}

  // Throws Error{kIo} if a read of the file has failed since this object was created. The caller
  // must then discard all results computed from the file.
  void check_readable() const {
    if (mapping_.is_damaged())
      throw Error(ErrorCode::kIo,
                  file_.path() +
                      ": it became shorter, or its disk failed, while it was read: expected a file "
                      "that does not change");
  }

  // Returns the result of work(). If work() throws an Error, pages of zeros can be the cause. So
  // run() then calls check_readable(), whose error replaces the error of work(). If work() returns,
  // run() does not call check_readable(). So work() itself must call it before it publishes a
  // result.
  template <class Work>
  auto run(const Work& work) const {
    try {
      return work();
    } catch (const Error&) {
      check_readable();
      throw;
    }
  }

 private:
  const voxdag_reader::File& file_;
  const WatchedMapping mapping_;
};

}  // namespace voxdag
