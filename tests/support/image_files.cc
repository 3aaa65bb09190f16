#include "tests/support/image_files.h"

#include <cstdio>
// <jpeglib.h> needs FILE.
#include <jpeglib.h>
#include <zlib.h>

#include <cstdlib>

namespace voxdag::test {
namespace {

std::string packed(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string out(size, '\0');
  compress(reinterpret_cast<Bytef*>(out.data()), &size,
           reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()));
  out.resize(size);
  return out;
}

// Returns the rows of the seven passes of Adam7, each after its filter byte.
std::string interlaced_rows(const PngFormat& f, const std::string& pixels, size_t pixel_bytes) {
  constexpr uint32_t kPasses[7][4] = {{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                      {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
  std::string rows;
  for (const auto& [x0, y0, dx, dy] : kPasses) {
    if (x0 >= f.width) continue;
    for (uint32_t y = y0; y < f.height; y += dy) {
      rows += '\0';
      for (uint32_t x = x0; x < f.width; x += dx)
        rows += pixels.substr(pixel_bytes * (f.width * y + x), pixel_bytes);
    }
  }
  return rows;
}

}  // namespace

std::string big_endian(uint32_t value) {
  std::string bytes(4, '\0');
  for (size_t i = 0; i < 4; ++i) bytes[i] = static_cast<char>(value >> (24 - 8 * i));
  return bytes;
}

std::string png_chunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const uLong crc =
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return big_endian(static_cast<uint32_t>(data.size())) + body +
         big_endian(static_cast<uint32_t>(crc));
}

std::string png_file(const PngFormat& f, const std::string& pixels) {
  std::string rows;
  if (f.is_interlaced) {
    rows = interlaced_rows(f, pixels, pixels.size() / f.width / f.height);
  } else {
    const size_t row = pixels.size() / f.height;
    for (size_t y = 0; y < f.height; ++y) rows += '\0' + pixels.substr(row * y, row);
  }
  const std::string format = {static_cast<char>(f.depth), static_cast<char>(f.color_type), 0, 0,
                              static_cast<char>(f.is_interlaced)};
  return "\x89PNG\r\n\x1a\n" +
         png_chunk("IHDR", big_endian(f.width) + big_endian(f.height) + format) + f.chunks +
         png_chunk("IDAT", packed(rows)) + png_chunk("IEND", "");
}

namespace {

// Returns a JPEG file. prepare(jpeg) can change settings such as the scans before the compression
// begins.
template <class Prepare>
std::string compressed(uint32_t width, uint32_t height, int components, const std::string& pixels,
                       const Prepare& prepare) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &bytes, &size);
  jpeg.image_width = width;
  jpeg.image_height = height;
  jpeg.input_components = components;
  jpeg.in_color_space = components == 1 ? JCS_GRAYSCALE : components == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 95, TRUE);
  prepare(jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  std::string copy = pixels;
  const size_t row_bytes = static_cast<size_t>(components) * width;
  for (size_t y = 0; y < height; ++y) {
    JSAMPROW rows[] = {reinterpret_cast<JSAMPROW>(&copy[row_bytes * y])};
    jpeg_write_scanlines(&jpeg, rows, 1);
  }
  jpeg_finish_compress(&jpeg);
  std::string out(reinterpret_cast<char*>(bytes), size);
  jpeg_destroy_compress(&jpeg);
  std::free(bytes);
  return out;
}

}  // namespace

std::string jpeg_file(uint32_t width, uint32_t height, int components, const std::string& pixels,
                      bool is_progressive) {
  return compressed(width, height, components, pixels, [&](jpeg_compress_struct& jpeg) {
    if (is_progressive) jpeg_simple_progression(&jpeg);
  });
}

std::string jpeg_of_scans(uint32_t width, uint32_t height, const std::string& pixels, int repeats) {
  jpeg_scan_info scans[3] = {};
  for (int i = 0; i < 3; ++i) scans[i] = {1, {i}, 0, 63, 0, 0};
  std::string file = compressed(width, height, 3, pixels, [&](jpeg_compress_struct& jpeg) {
    jpeg.scan_info = scans;
    jpeg.num_scans = 3;
  });
  const size_t last = file.rfind("\xff\xda"), end = file.size() - 2;
  std::string repeated;
  for (int i = 1; i < repeats; ++i) repeated += file.substr(last, end - last);
  return file.insert(end, repeated);
}

}  // namespace voxdag::test
