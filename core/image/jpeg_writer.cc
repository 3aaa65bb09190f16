#include "core/image/jpeg_writer.h"

#include "core/base/error.h"

#ifdef VOXDAG_HAS_IMAGES
#include <cstdio>
// <jpeglib.h> needs FILE.
#include <jpeglib.h>

#include <csetjmp>
#include <cstdlib>
#endif

namespace voxdag {

#ifdef VOXDAG_HAS_IMAGES
namespace {

constexpr int kJpegQuality = 92;

struct JpegEncoder {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX] = "";
  unsigned char* bytes = nullptr;  // allocated by the library
  unsigned long size = 0;

  JpegEncoder() = default;
  JpegEncoder(const JpegEncoder&) = delete;
  JpegEncoder& operator=(const JpegEncoder&) = delete;
  ~JpegEncoder() {
    jpeg_destroy_compress(&jpeg);
    std::free(bytes);
  }

  static void on_error(j_common_ptr jpeg) {
    auto& self = *static_cast<JpegEncoder*>(jpeg->client_data);
    (*jpeg->err->format_message)(jpeg, self.message);
    std::longjmp(self.jump, 1);
  }

  // Returns false after an error. The library reports errors by longjmp(), which skips destructors,
  // so this function has no objects to destroy.
  bool encode(uint32_t width, uint32_t height, const uint8_t* rgb, std::string_view comment) {
    jpeg.err = jpeg_std_error(&errors);
    errors.error_exit = on_error;
    jpeg.client_data = this;
    if (setjmp(jump)) return false;
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &bytes, &size);
    jpeg.image_width = width;
    jpeg.image_height = height;
    jpeg.input_components = 3;
    jpeg.in_color_space = JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, kJpegQuality, TRUE);
    // Stores chroma in full resolution, because voxels have sharp edges.
    jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = 1;
    jpeg.optimize_coding = TRUE;
    jpeg_start_compress(&jpeg, TRUE);
    jpeg_write_marker(&jpeg, JPEG_COM, reinterpret_cast<const JOCTET*>(comment.data()),
                      static_cast<unsigned>(comment.size()));
    while (jpeg.next_scanline < height) {
      auto* row = const_cast<JSAMPROW>(rgb + size_t{3} * width * jpeg.next_scanline);
      jpeg_write_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_compress(&jpeg);
    return true;
  }
};

}  // namespace

bool can_write_jpeg() { return true; }

std::string encode_jpeg(uint32_t width, uint32_t height, std::span<const uint8_t> rgb,
                        std::string_view comment) {
  JpegEncoder encoder;
  if (!encoder.encode(width, height, rgb.data(), comment))
    throw Error(ErrorCode::kOutOfMemory, "out of memory: libjpeg cannot write an image of " +
                                             std::to_string(width) + " x " +
                                             std::to_string(height) + " pixels (" +
                                             encoder.message + "): expected a smaller image");
  return {reinterpret_cast<const char*>(encoder.bytes), encoder.size};
}
#else
bool can_write_jpeg() { return false; }

std::string encode_jpeg(uint32_t, uint32_t, std::span<const uint8_t>, std::string_view) {
  throw Error(ErrorCode::kInvalidInput,
              "this build has no libjpeg (-DVOXDAG_IMAGES=OFF): expected a PNG file");
}
#endif

}  // namespace voxdag
