// The two digests of our files: XXH64 against damage (short, and simple enough that the header-only
// reader carries its own), SHA-256 to name contents.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace voxdag {

// XXH64 with seed 0.
uint64_t checksum64(std::span<const std::byte> bytes);

// A running XXH64.
class Checksum64 {
 public:
  Checksum64();
  Checksum64(Checksum64&&) noexcept;
  Checksum64& operator=(Checksum64&&) noexcept;
  ~Checksum64();
  void add(std::span<const std::byte> bytes);
  // Of what was added so far.
  uint64_t value() const;
  // As if nothing had been added.
  void reset();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// A sum over 32-bit words, each weighted by its index, modulo 2^64: the parts of a whole may be
// summed in any order, by any number of threads, and added up. `first` is the index of words[0].
uint64_t indexed_sum(uint64_t first, std::span<const uint32_t> words);

// A running SHA-256.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  void add(std::span<const std::byte> bytes);
  // 64 lower-case hex digits; nothing may be added afterwards.
  std::string finish();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};
// The SHA-256 of a text: 64 lower-case hex digits.
std::string sha256_hex(std::string_view text);

}  // namespace voxdag
