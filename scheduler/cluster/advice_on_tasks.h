#pragma once

#include <string>

#include "core/base/options/option_text.h"

namespace voxdag {

// Returns how the users of this process follow the tasks of a canceled build, or stop them: a
// clause for the end of an error message.
inline std::string advice_on_tasks() {
  const std::string stop = command_text("stop-tasks");
  return repeat_text() + " to follow them" + (stop.empty() ? "" : ", or stop them with " + stop);
}

}  // namespace voxdag
