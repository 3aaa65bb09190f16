// Sets the audience of this process during the life of the guard.
#pragma once

#include "core/base/options/option_text.h"

namespace voxdag::test {

class AudienceGuard {
 public:
  explicit AudienceGuard(const Audience& audience) { set_audience(audience); }
  ~AudienceGuard() { set_audience(kCommandLineUsers); }
  AudienceGuard(const AudienceGuard&) = delete;
  AudienceGuard& operator=(const AudienceGuard&) = delete;
};

// Users who can neither set an option nor run a command.
inline std::string spell_nothing(std::string_view, std::string_view) { return ""; }
inline std::string spell_no_command(std::string_view, std::string_view, std::string_view) {
  return "";
}
inline constexpr Audience kOtherUsers{&spell_nothing, &spell_no_command, "try again"};

}  // namespace voxdag::test
