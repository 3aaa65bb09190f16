// Lets the OpenVDB library write to an ExportFile.
#pragma once

#include <algorithm>
#include <exception>
#include <streambuf>
#include <string_view>

#include "query/export/export_file.h"
#include "query/export/export_job.h"

namespace voxdag::query {

// A stream buffer that writes to an ExportFile. A C++ stream catches the exceptions of its buffer
// and only sets a flag, and the error that the library then reports does not contain the reason. So
// the buffer keeps the first exception, and check() rethrows it.
class FileBuffer : public std::streambuf {
 public:
  // `total_bytes` is an estimate of the bytes that will be written. The stage must have this total.
  FileBuffer(ExportFile& file, ExportStage& stage, uint64_t total_bytes)
      : file_(file), stage_(stage), left_bytes_(total_bytes) {}
  // Advances the stage to its total, because the library can write fewer bytes than estimated.
  void finish() { advance(left_bytes_); }
  void check() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 protected:
  std::streamsize xsputn(const char* bytes, std::streamsize count) override {
    // A single call can pass a complete grid. Writes it in pieces, and checks for cancellation and
    // reports progress after each.
    constexpr size_t kPieceBytes = 1 << 20;
    const bool done = attempt([&] {
      std::string_view rest(bytes, static_cast<size_t>(count));
      while (!rest.empty()) {
        const std::string_view piece = rest.substr(0, kPieceBytes);
        file_.write(piece);
        advance(piece.size());
        if (piece.size() == kPieceBytes) stage_.report();
        rest.remove_prefix(piece.size());
      }
      at_ += count;
    });
    return done ? count : 0;
  }
  int_type overflow(int_type byte) override {
    const char c = traits_type::to_char_type(byte);
    return xsputn(&c, 1) == 1 ? byte : traits_type::eof();
  }
  pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override {
    if (from == std::ios_base::cur) offset += at_;
    if (from == std::ios_base::end) offset += static_cast<off_type>(file_.size());
    if (offset == at_) return at_;
    return attempt([&] { file_.seek(static_cast<uint64_t>(at_ = offset)); }) ? pos_type(at_)
                                                                             : pos_type(-1);
  }
  pos_type seekpos(pos_type at, std::ios_base::openmode mode) override {
    return seekoff(at, std::ios_base::beg, mode);
  }

 private:
  // Advances the stage, at most to its total.
  void advance(uint64_t bytes) {
    bytes = std::min(bytes, left_bytes_);
    left_bytes_ -= bytes;
    stage_.advance(bytes);
  }
  template <class Work>
  bool attempt(const Work& work) {
    if (failure_) return false;
    try {
      work();
      return true;
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
  }

  ExportFile& file_;
  ExportStage& stage_;
  uint64_t left_bytes_;
  off_type at_ = 0;
  std::exception_ptr failure_;
};

}  // namespace voxdag::query
