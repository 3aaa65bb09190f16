// Reads PNG images with libpng. The library reports errors by longjmp() to this file, which skips
// destructors. So functions that call the library must have no objects to destroy.
#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <new>
#include <utility>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/image/readers.h"

namespace voxdag {
namespace {

// Memory that libpng allocates: zlib's window and states, and buffers.
constexpr uint64_t kPngStateBytes = uint64_t{1} << 20;

class PngReader : public ImageReader {
 public:
  PngReader(std::unique_ptr<PeekedSource> source, MemoryBudget& budget, ImageUse use)
      : source_(std::move(source)), state_charge_(budget, kPngStateBytes, "a PNG image") {
    png_ = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, this, on_error, on_warning, this,
                                    on_allocate, on_release);
    if (png_) info_ = png_create_info_struct(png_);
    if (!info_) {
      destroy();
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the system has none left for a PNG image: expected more free "
                  "memory on this machine");
    }
    try {
      if (!read_header()) fail();
      check_size(png_get_image_width(png_, info_), png_get_image_height(png_, info_));
      if (!set_format()) fail();
      bits_ = png_get_bit_depth(png_, info_);
      const uint64_t row = png_get_rowbytes(png_, info_);
      if (row != uint64_t{4} * width_ * static_cast<uint64_t>(bits_) / 8)
        throw BrokenImage{"has decoded rows of " + std::to_string(row) + " bytes, expected " +
                          std::to_string(uint64_t{4} * width_ * static_cast<uint64_t>(bits_) / 8)};
      row_charge_ = MemoryCharge(budget, 4 * row, "rows of a PNG image");
      if (is_interlaced_ && use == ImageUse::kPixels) read_all(row, budget);
    } catch (...) {
      destroy();
      throw;
    }
  }
  ~PngReader() override { destroy(); }

  void read_row(std::span<std::byte> row) override {
    if (is_interlaced_)
      std::memcpy(row.data(), &all_[next_row_ * row.size()], row.size());
    else if (!read_one(row.data()))
      fail();
    ++next_row_;
    // After the last row, reads to the end of the file, so that libpng verifies the checksums.
    if (next_row_ == height_ && !read_end()) fail();
  }

 private:
  static void on_error(png_structp png, png_const_charp message) {
    auto& self = *static_cast<PngReader*>(png_get_error_ptr(png));
    std::strncpy(self.message_, message, sizeof self.message_ - 1);
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp, png_const_charp) {}
  static png_voidp on_allocate(png_structp png, png_alloc_size_t size) {
    void* const memory = std::malloc(size);
    if (!memory) static_cast<PngReader*>(png_get_mem_ptr(png))->lacks_memory_ = true;
    return memory;
  }
  static void on_release(png_structp, png_voidp memory) { std::free(memory); }
  static void on_read(png_structp png, png_bytep out, size_t size) {
    auto& self = *static_cast<PngReader*>(png_get_io_ptr(png));
    if (self.source_->read(reinterpret_cast<std::byte*>(out), size) < size)
      png_error(png, "it ends early");
  }

  bool read_header() {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_set_read_fn(png_, this, on_read);
    // Allows any size, because check_size() refuses images that are too large.
    png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    // Skips texts, profiles and similar chunks of any size.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_set_chunk_malloc_max(png_, 0);
    png_read_info(png_, info_);
    return true;
  }
  bool set_format() {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_set_expand(png_);
    png_set_gray_to_rgb(png_);
    png_set_add_alpha(png_, 0xffff, PNG_FILLER_AFTER);
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
    is_interlaced_ = png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE;
    passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }
  bool read_one(std::byte* row) {
    if (source_->is_canceled()) return false;
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_row(png_, reinterpret_cast<png_bytep>(row), nullptr);
    return true;
  }
  bool read_end() {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_end(png_, nullptr);
    return true;
  }
  void read_all(uint64_t row, MemoryBudget& budget) {
    if (row * height_ > kMaxDecoderBytes)
      throw BrokenImage{"is an interlaced PNG image that takes " +
                        std::to_string((row * height_) >> 20) +
                        " MiB to decode, the limit is 2048 MiB"};
    all_ = PageBuffer<std::byte>(budget, static_cast<size_t>(row * height_),
                                 "an interlaced PNG image");
    for (int pass = 0; pass < passes_; ++pass)
      for (uint64_t y = 0; y < height_; ++y)
        if (!read_one(&all_[static_cast<size_t>(y * row)])) fail();
  }
  [[noreturn]] void fail() {
    source_->rethrow();
    if (lacks_memory_)
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the system has none left for a PNG image: expected more free "
                  "memory on this machine");
    throw BrokenImage{std::string("is a broken PNG image (") + message_ + ")"};
  }
  void destroy() { png_destroy_read_struct(&png_, &info_, nullptr); }

  const std::unique_ptr<PeekedSource> source_;
  MemoryCharge state_charge_, row_charge_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  bool is_interlaced_ = false, lacks_memory_ = false;
  int passes_ = 1;
  PageBuffer<std::byte> all_;  // all rows of an interlaced image
  uint64_t next_row_ = 0;
  char message_[96] = {};
};

}  // namespace

std::unique_ptr<ImageReader> open_png(std::unique_ptr<PeekedSource> source, MemoryBudget& budget,
                                      ImageUse use) {
  return std::make_unique<PngReader>(std::move(source), budget, use);
}

}  // namespace voxdag
