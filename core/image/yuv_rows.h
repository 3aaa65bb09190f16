// Converts decoded planes of luma and chroma (ITU-T H.273) to rows of RGBA, in doubles with a fixed
// order of operations. So the result is the same on every machine.
//
// Chroma of halved resolution is interpolated linearly between the centers of its samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxdag {

// A plane of 8-bit numbers, or of 16-bit numbers if YuvPlanes::bits is above 8.
struct Plane {
  const uint8_t* bytes = nullptr;
  size_t row_bytes = 0;
};

struct YuvPlanes {
  uint32_t width = 0, height = 0;
  int bits = 8;
  bool is_limited = false;        // with 8 bits, luma is in 16..235, chroma in 16..240
  bool is_premultiplied = false;  // colors are multiplied by alpha
  int matrix = 0;                 // MatrixCoefficients of H.273
  bool halves_width = false, halves_height = false;  // chroma has half the width, half the height
  std::array<Plane, 3> color{};  // luma and both chromas; gray if the chromas are missing
  Plane alpha{};                 // opaque if missing; always of full range
};

class YuvRows {
 public:
  // The memory of the planes must outlive this object. Throws BrokenImage if the matrix is unknown.
  explicit YuvRows(const YuvPlanes& planes);
  // Converts row `y`: red, green, blue and alpha of each pixel. A channel has 8 bits, or 16 bits if
  // the planes have more than 8.
  void read(uint32_t y, std::span<std::byte> out);

 private:
  enum class Kind { kWeights, kIdentity, kYcgco };
  double sample(const Plane& plane, size_t x, size_t y) const;
  void read_chroma(const Plane& plane, uint32_t y, std::vector<double>& out) const;
  std::array<double, 3> rgb_at(size_t x, uint32_t y) const;

  const YuvPlanes planes_;
  Kind kind_ = Kind::kWeights;
  double red_ = 0, blue_ = 0;  // weights of red and blue in luma
  double max_ = 255;           // largest number of a plane
  double luma_low_ = 0, luma_range_ = 255, chroma_range_ = 255;
  std::vector<double> chroma_[2];  // chroma of the current row, from -0.5 to 0.5
};

}  // namespace voxdag
