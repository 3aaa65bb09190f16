// A digest of a set of cells: the number of cells, and two sums of 64-bit hashes of their
// positions. The digest does not depend on the order of the cells, so files of any size can be
// compared without sorting their cells or holding them in memory. A missing, duplicate or misplaced
// cell changes the digest, except with a probability of 2^-128.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace voxdag::test {

// Prints a message and ends the program: the file breaks the rules of its format.
[[noreturn]] inline void fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  std::exit(1);
}
inline void expect(bool right, const char* what) {
  if (!right) fail(std::string("expected ") + what);
}

class Digest {
 public:
  // Adds the cell (x, y, z) if `face` is 0, otherwise one of the cell's six faces (1 to 6).
  void add(int64_t x, int64_t y, int64_t z, uint64_t face = 0) {
    if ((x | y | z) >> 20 != 0) fail("a cell outside the grid");
    const uint64_t key = face << 60 | static_cast<uint64_t>(x) << 40 |
                         static_cast<uint64_t>(y) << 20 | static_cast<uint64_t>(z);
    ++count_;
    sum_ += mix(key);
    other_sum_ += mix(~key * 0x9e3779b97f4a7c15u);
  }
  uint64_t count() const { return count_; }
  void print() const {
    std::printf("%llu %016llx%016llx\n", static_cast<unsigned long long>(count_),
                static_cast<unsigned long long>(sum_), static_cast<unsigned long long>(other_sum_));
  }

 private:
  // The finalizer of SplitMix64.
  static uint64_t mix(uint64_t bits) {
    bits += 0x9e3779b97f4a7c15u;
    bits = (bits ^ bits >> 30) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ bits >> 27) * 0x94d049bb133111ebu;
    return bits ^ bits >> 31;
  }
  uint64_t count_ = 0, sum_ = 0, other_sum_ = 0;
};

}  // namespace voxdag::test
