// The error of a job that fails in the same way in every run, because of its options and its scene.
#pragma once

#include "core/base/error.h"

namespace voxdag {

// The work folder of such a job has nothing to resume, so it is removed: a work folder belongs to
// one job, and only a job with other options or another scene can succeed.
class UnbuildableJob : public Error {
 public:
  using Error::Error;
};

}  // namespace voxdag
