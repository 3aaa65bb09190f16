#include "core/format/global/page_limit.h"

#include "core/base/process_limits.h"

namespace voxdag {

void PageLimit::check() const {
  if (resident_bytes() > limit_bytes_) file_.release_pages();
}

}  // namespace voxdag
