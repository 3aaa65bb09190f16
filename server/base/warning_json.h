// The JSON of warnings, in messages, job records and answers.
#pragma once

#include <nlohmann/json.hpp>

#include "core/base/warning.h"

namespace voxdag {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Warning, code, place, message, count)

}  // namespace voxdag
