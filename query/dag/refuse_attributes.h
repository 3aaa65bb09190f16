// Refuses files with attributes, for commands that read only the voxels.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/open_global.h"

namespace voxdag::query {

// Throws Error{kInvalidInput} if the file has colors or other attributes. The message ends with
// `reason`, a clause that begins with "which".
inline void refuse_attributes(const voxdag_reader::File& file, std::string_view reason) {
  const std::vector<Attribute> attributes = attributes_of(file).list();
  if (!attributes.empty())
    throw Error(ErrorCode::kInvalidInput,
                file.path() + " has " + traits_of(attributes[0]).plural +
                    ": expected a file without colors and other attributes, " +
                    std::string(reason));
}

}  // namespace voxdag::query
