// Images for tests: pyramids (an image and its smaller levels) in memory that show waves, noise and
// transparent stripes, made from a seed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "tests/oracle/scenes.h"

namespace voxdag {

struct TestLevel {
  uint32_t width = 0, height = 0;
  std::vector<std::array<uint16_t, 4>> texels;
  const std::array<uint16_t, 4>& at(uint32_t x, uint32_t y) const { return texels[y * width + x]; }
};

// Images with the functions that RegionBaker calls on its images.
class TestImages {
 public:
  // Adds an image of smooth waves with some noise. Alpha is 0 in stripes.
  void add(uint32_t width, uint32_t height, uint64_t seed) {
    oracle::Random random(seed);
    TestLevel image{width, height, {}};
    const double wave = static_cast<double>(random.between(3, 9));
    for (uint32_t y = 0; y < height; ++y)
      for (uint32_t x = 0; x < width; ++x) {
        std::array<uint16_t, 4> texel;
        for (int c = 0; c < 3; ++c) {
          // Triangle waves instead of sines: the mathematical libraries of machines compute
          // different sines, but BakeRegion.GoldenDigest must be the same on all machines.
          const double phase = wave * (c + 1) * x / width + (wave - c) * y / height;
          const double up = phase - std::floor(phase);
          texel[static_cast<size_t>(c)] =
              static_cast<uint16_t>(static_cast<double>(random.between(0, 8000)) +
                                    57000 * (up < 0.5 ? 2 * up : 2 - 2 * up));
        }
        texel[3] = (x * 8 / width) % 3 == 0 ? 0 : static_cast<uint16_t>(20000 + 40000 * y / height);
        image.texels.push_back(texel);
      }
    add(std::move(image));
  }

  // Adds an image as add() does. Alpha is 0 in the stripes, and otherwise full.
  void add_cut(uint32_t width, uint32_t height, uint64_t seed) {
    add(width, height, seed);
    TestLevel image = std::move(pyramids_.back().front());
    pyramids_.pop_back();
    for (auto& texel : image.texels)
      if (texel[3] != 0) texel[3] = 65535;
    add(std::move(image));
  }

  // Adds an opaque white image of one texel.
  void add_white() { pyramids_.push_back({{1, 1, {{65535, 65535, 65535, 65535}}}}); }

  uint32_t levels(uint32_t image) const { return static_cast<uint32_t>(pyramids_[image].size()); }
  uint32_t width(uint32_t image, uint32_t level) const { return pyramids_[image][level].width; }
  uint32_t height(uint32_t image, uint32_t level) const { return pyramids_[image][level].height; }
  struct View {
    const TestLevel& level;
    uint32_t width() const { return level.width; }
    uint32_t height() const { return level.height; }
    uint64_t texel(uint32_t x, uint32_t y) const {
      const auto& t = level.at(x, y);
      return t[0] | uint64_t{t[1]} << 16 | uint64_t{t[2]} << 32 | uint64_t{t[3]} << 48;
    }
    void prefetch(uint32_t, uint32_t) const {}
  };
  View view(uint32_t image, uint32_t level) const { return {pyramids_[image][level]}; }
  const TestLevel& image(uint32_t index) const { return pyramids_[index][0]; }

 private:
  void add(TestLevel image) {
    pyramids_.emplace_back().push_back(std::move(image));
    while (pyramids_.back().back().width > 1 || pyramids_.back().back().height > 1)
      pyramids_.back().push_back(halved(pyramids_.back().back()));
  }

  static TestLevel halved(const TestLevel& fine) {
    TestLevel coarse{std::max(1u, fine.width / 2), std::max(1u, fine.height / 2), {}};
    for (uint32_t y = 0; y < coarse.height; ++y)
      for (uint32_t x = 0; x < coarse.width; ++x) {
        std::array<uint16_t, 4> texel;
        for (size_t c = 0; c < 4; ++c) {
          uint32_t sum = 2;
          for (uint32_t i = 0; i < 4; ++i)
            sum += fine.at(std::min(2 * x + (i & 1), fine.width - 1),
                           std::min(2 * y + i / 2, fine.height - 1))[c];
          texel[c] = static_cast<uint16_t>(sum / 4);
        }
        coarse.texels.push_back(texel);
      }
    return coarse;
  }

  std::vector<std::vector<TestLevel>> pyramids_;
};

}  // namespace voxdag
