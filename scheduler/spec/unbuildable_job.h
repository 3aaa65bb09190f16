// The error of a job that fails in the same way in every run, because of its geometry options and
// its scene.
#pragma once

#include "core/base/error.h"

namespace voxdag {

// Thrown only after the work folder's job was compared with the requested job. The work folder of
// such a job has nothing to resume, so it is removed: only a job with other geometry options or
// another scene can succeed.
class UnbuildableJob : public Error {
 public:
  using Error::Error;
};

}  // namespace voxdag
