#include "core/base/page_buffer.h"

#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"

namespace voxdag {

namespace {

// Arrays of at most kSmallBytes use the general allocator.
constexpr size_t kSmallBytes = size_t{128} << 10;
constexpr size_t kAlignment = 64;  // a cache line, and the widest vector register

bool is_small(size_t bytes) { return bytes <= kSmallBytes; }

void* check_pages(void* pages, size_t bytes, std::string_view what) {
  if (pages == MAP_FAILED)
    throw Error(ErrorCode::kOutOfMemory, "out of memory: the system refused " + size_text(bytes) +
                                             " for " + std::string(what) + ": " +
                                             errno_text(errno) +
                                             ": expected more free memory on this machine");
  // Random access to a large table needs far fewer address translations with huge pages. No huge
  // page extends beyond the mapping, so resident memory does not exceed the charge.
  if (bytes >= (size_t{2} << 20)) madvise(pages, bytes, MADV_HUGEPAGE);
  return pages;
}

}  // namespace

void* allocate_pages(size_t bytes, std::string_view what) {
  if (!is_small(bytes))
    return check_pages(
        mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0), bytes,
        what);
  const size_t rounded = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  void* const memory = std::aligned_alloc(kAlignment, rounded);
  if (!memory) return check_pages(MAP_FAILED, bytes, what);
  return std::memset(memory, 0, rounded);
}

void* grow_pages(void* pages, size_t bytes, size_t new_bytes, std::string_view what) {
#if defined(__SANITIZE_THREAD__)
  // ThreadSanitizer does not see mremap(), and attributes memory at the new address to the thread
  // that used this address before. So copy the bytes instead.
  const bool copies = true;
#else
  const bool copies = is_small(bytes) || is_small(new_bytes);
#endif
  if (!copies) return check_pages(mremap(pages, bytes, new_bytes, MREMAP_MAYMOVE), new_bytes, what);
  void* const grown = allocate_pages(new_bytes, what);
  std::memcpy(grown, pages, std::min(bytes, new_bytes));
  free_pages(pages, bytes);
  return grown;
}

void free_pages(void* pages, size_t bytes) {
  if (is_small(bytes))
    std::free(pages);
  else
    munmap(pages, bytes);
}

void refuse_growth(size_t bytes, std::string_view what) {
  throw Error(ErrorCode::kOutOfMemory,
              "out of memory: " + std::string(what) + " needs " + size_text(bytes) +
                  ", more than the memory budget has left: expected a larger budget (" +
                  option_text("memory") + ")");
}

}  // namespace voxdag
