#include "core/base/warning.h"

#include <algorithm>

namespace voxdag {

std::string Warning::text() const {
  std::string text = place.empty() ? message : place + ": " + message;
  if (count > 1) text += " (" + std::to_string(count) + " times)";
  return text;
}

void WarningList::add(const Warning& warning) {
  const auto known = std::ranges::find_if(list_, [&](const Warning& other) {
    return other.code == warning.code && other.message == warning.message;
  });
  if (known != list_.end())
    known->count += warning.count;
  else if (list_.size() < kMaxWarnings - 1)
    list_.push_back(warning);
  else if (list_.size() < kMaxWarnings)
    list_.push_back(
        {"further-warnings", warning.place,
         "further warnings; at most " + std::to_string(kMaxWarnings - 1) + " kinds are listed",
         warning.count});
  else
    list_.back().count += warning.count;
}

void WarningList::add(std::span<const Warning> warnings) {
  for (const Warning& warning : warnings) add(warning);
}

}  // namespace voxdag
