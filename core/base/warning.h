// Warnings about the input of a build: faults that do not stop it. docs/scenes.md lists the codes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace voxdag {

struct Warning {
  std::string code;     // the kind, such as "ignored-extension"
  std::string place;    // the first place: the scene file, and the element of the file; can be ""
  std::string message;  // one sentence about this place
  uint64_t count = 1;   // number of places

  // Returns `place` and `message`, and the number of places if there are several.
  std::string text() const;
  bool operator==(const Warning&) const = default;
};

template <class Visitor>
void fields(Visitor& visit, Warning& warning) {
  visit("code", warning.code);
  visit("place", warning.place);
  visit("message", warning.message);
  visit("count", warning.count);
}

// Collects warnings. Warnings that have the same code and message are counted together, and only
// the first place is kept. The list has at most kMaxWarnings entries; the last one counts all
// further warnings.
class WarningList {
 public:
  static constexpr size_t kMaxWarnings = 64;

  void add(const Warning& warning);
  void add(std::span<const Warning> warnings);
  const std::vector<Warning>& list() const { return list_; }

 private:
  std::vector<Warning> list_;
};

}  // namespace voxdag
