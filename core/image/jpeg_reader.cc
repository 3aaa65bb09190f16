// Decodes JPEG images with libjpeg-turbo. The library reports errors by longjmp() to this file,
// which skips destructors. So functions that call the library must have no objects to destroy.
#include <cstdio>
// <jpeglib.h> needs FILE.
#include <jerror.h>
#include <jpeglib.h>

#include <csetjmp>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/image/readers.h"

namespace voxdag {
namespace {

constexpr uint64_t kJpegStateBytes = uint64_t{1} << 20;
// Max scans of an image. A file needs only a few bytes to repeat the scan of a large image, so
// without this limit a small file could cause much work.
constexpr int kMaxScans = 500;

class JpegReader : public ImageReader {
 public:
  JpegReader(std::unique_ptr<PeekedSource> source, MemoryBudget& budget, ImageUse use)
      : source_(std::move(source)), charge_(budget, kJpegStateBytes, "a JPEG image") {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = on_error;
    errors_.emit_message = on_message;
    jpeg_.client_data = this;
    progress_.progress_monitor = on_progress;
    input_.init_source = [](j_decompress_ptr) {};
    input_.fill_input_buffer = fill;
    input_.skip_input_data = skip;
    input_.resync_to_restart = jpeg_resync_to_restart;
    input_.term_source = [](j_decompress_ptr) {};
    try {
      if (!read_header()) fail();
      check_size(jpeg_.image_width, jpeg_.image_height);
      const J_COLOR_SPACE space = jpeg_.jpeg_color_space;
      if (space != JCS_GRAYSCALE && space != JCS_YCbCr && space != JCS_RGB)
        throw BrokenImage{"is a JPEG image with " + std::to_string(jpeg_.num_components) +
                          " channels that are neither gray nor YCbCr nor RGB (4 channels are CMYK "
                          "or YCCK), expected one of these three"};
      // Refuses images that not every version and build of the library decodes. In a lossless
      // image, Ss (in the header of the first scan) is the number of a predictor, which is not 0.
      // In all other images, Ss is 0, because the first scan begins with the mean of each block.
      if (jpeg_.arith_code)
        throw BrokenImage{"is a JPEG image with arithmetic coding, expected Huffman coding"};
      if (jpeg_.data_precision != 8)
        throw BrokenImage{"is a JPEG image of " + std::to_string(jpeg_.data_precision) +
                          " bits per channel, expected 8"};
      if (jpeg_.Ss != 0) throw BrokenImage{"is a lossless JPEG image, expected a lossy one"};
      if (use == ImageUse::kSize) return;
      charge_decoder(budget);
      if (!start()) fail();
    } catch (...) {
      jpeg_destroy_decompress(&jpeg_);
      throw;
    }
  }
  ~JpegReader() override { jpeg_destroy_decompress(&jpeg_); }

  void read_row(std::span<std::byte> row) override {
    if (!read_one(row.data())) fail();
  }

 private:
  static JpegReader& self(j_common_ptr jpeg) {
    return *static_cast<JpegReader*>(jpeg->client_data);
  }
  static void on_error(j_common_ptr jpeg) {
    const int code = jpeg->err->msg_code;
    if (code == JERR_OUT_OF_MEMORY || code == JERR_NO_BACKING_STORE)
      self(jpeg).lacks_memory_ = true;
    (*jpeg->err->format_message)(jpeg, self(jpeg).message_);
    std::longjmp(self(jpeg).jump_, 1);
  }
  // Treats warnings (level < 0) as errors, because they report damaged data. Ignores three harmless
  // warnings.
  static void on_message(j_common_ptr jpeg, int level) {
    const int code = jpeg->err->msg_code;
    if (level >= 0 || code == JWRN_EXTRANEOUS_DATA || code == JWRN_ADOBE_XFORM ||
        code == JWRN_JFIF_MAJOR)
      return;
    on_error(jpeg);
  }
  static void on_progress(j_common_ptr jpeg) {
    if (self(jpeg).source_->is_canceled()) std::longjmp(self(jpeg).jump_, 1);
    if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number <= kMaxScans) return;
    std::snprintf(self(jpeg).message_, JMSG_LENGTH_MAX, "over %d scans", kMaxScans);
    std::longjmp(self(jpeg).jump_, 1);
  }
  static boolean fill(j_decompress_ptr jpeg) {
    JpegReader& reader = self(reinterpret_cast<j_common_ptr>(jpeg));
    size_t size = reader.source_->read(reader.buffer_, sizeof reader.buffer_);
    // At the end of the bytes, supplies an end marker, which some files lack. If other data is also
    // missing, the library reports the image as damaged.
    if (size == 0) {
      reader.has_ended_ = true;
      reader.buffer_[0] = std::byte{0xff};
      reader.buffer_[1] = std::byte{JPEG_EOI};
      size = 2;
    }
    jpeg->src->next_input_byte = reinterpret_cast<const JOCTET*>(reader.buffer_);
    jpeg->src->bytes_in_buffer = size;
    return TRUE;
  }
  static void skip(j_decompress_ptr jpeg, long count) {
    JpegReader& reader = self(reinterpret_cast<j_common_ptr>(jpeg));
    while (count > 0) {
      if (jpeg->src->bytes_in_buffer == 0) fill(jpeg);
      if (reader.has_ended_) return;
      const size_t n = std::min(static_cast<size_t>(count), jpeg->src->bytes_in_buffer);
      jpeg->src->next_input_byte += n;
      jpeg->src->bytes_in_buffer -= n;
      count -= static_cast<long>(n);
    }
  }

  bool read_header() {
    if (setjmp(jump_)) return false;
    jpeg_create_decompress(&jpeg_);
    jpeg_.src = &input_;
    jpeg_.progress = &progress_;
    jpeg_read_header(&jpeg_, TRUE);
    return true;
  }
  // Charges the memory that the decoder allocates: rows of blocks before and after upsampling and,
  // if there are several scans, the coefficients of the complete image.
  void charge_decoder(MemoryBudget& budget) {
    uint64_t bytes = kJpegStateBytes, coefficients = 0;
    for (int i = 0; i < jpeg_.num_components; ++i) {
      const jpeg_component_info& c = jpeg_.comp_info[i];
      bytes += uint64_t{width_ + 64} * 16 * static_cast<uint64_t>(jpeg_.max_v_samp_factor);
      coefficients += uint64_t{c.width_in_blocks + 4} * (c.height_in_blocks + 4) * sizeof(JBLOCK);
    }
    is_whole_ = jpeg_has_multiple_scans(&jpeg_);
    if (is_whole_) bytes += coefficients;
    if (bytes > kMaxDecoderBytes)
      throw BrokenImage{"is a JPEG image of several scans that takes " +
                        std::to_string(bytes >> 20) + " MiB to decode, the limit is 2048 MiB"};
    charge_ = {};
    charge_ = MemoryCharge(budget, bytes, "decoding a JPEG image");
  }
  bool start() {
    if (setjmp(jump_)) return false;
    jpeg_.out_color_space = JCS_EXT_RGBA;
    jpeg_.dct_method = JDCT_ISLOW;
    jpeg_.do_fancy_upsampling = TRUE;
    jpeg_.do_block_smoothing = FALSE;
    jpeg_start_decompress(&jpeg_);
    return !(is_whole_ && has_ended_);
  }
  bool read_one(std::byte* row) {
    if (setjmp(jump_)) return false;
    JSAMPROW rows[] = {reinterpret_cast<JSAMPROW>(row)};
    return jpeg_read_scanlines(&jpeg_, rows, 1) == 1;
  }
  [[noreturn]] void fail() {
    source_->rethrow();
    if (lacks_memory_)
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the system has none left for a JPEG image: expected more free "
                  "memory on this machine");
    throw BrokenImage{std::string("is a broken JPEG image (") +
                      (message_[0] ? message_ : "it ends early") + ")"};
  }

  const std::unique_ptr<PeekedSource> source_;
  MemoryCharge charge_;
  jpeg_decompress_struct jpeg_{};
  jpeg_error_mgr errors_{};
  jpeg_source_mgr input_{};
  jpeg_progress_mgr progress_{};
  std::jmp_buf jump_;
  char message_[JMSG_LENGTH_MAX] = {};
  bool has_ended_ = false, is_whole_ = false, lacks_memory_ = false;
  std::byte buffer_[16384];
};

}  // namespace

std::unique_ptr<ImageReader> open_jpeg(std::unique_ptr<PeekedSource> source, MemoryBudget& budget,
                                       ImageUse use) {
  return std::make_unique<JpegReader>(std::move(source), budget, use);
}

}  // namespace voxdag
