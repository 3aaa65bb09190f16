#include "core/io/watched_mapping.h"

#include <signal.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <mutex>

namespace voxdag {
namespace {

// A watched mapping. The signal handler reads the slots without a lock, so all members are atomic.
struct Slot {
  std::atomic<bool> taken{false};
  std::atomic<uintptr_t> begin{0}, end{0};  // `end` is 0 while `begin` changes
  std::atomic<bool> damaged{false};
};
Slot g_slots[WatchedMapping::kMaxWatched];
static_assert(std::atomic<uintptr_t>::is_always_lock_free &&
              std::atomic<bool>::is_always_lock_free);

uintptr_t g_page_bytes = 4096;
struct sigaction g_before;

// Handles SIGBUS. For an address in a watched mapping, maps a page of zeros at the address; when
// the handler returns, the read is repeated and succeeds.
void on_bus_error(int number, siginfo_t* info, void* context) {
  const auto address = reinterpret_cast<uintptr_t>(info->si_addr);
  if (info->si_code == BUS_ADRERR) {
    for (Slot& slot : g_slots) {
      const uintptr_t begin = slot.begin, end = slot.end;
      // Reads `begin` and `end` a second time. If both are unchanged, they belong to the same
      // mapping, even if another mapping took the slot in between.
      if (address < begin || address >= end || slot.begin != begin || slot.end != end) continue;
      slot.damaged = true;
      void* page = reinterpret_cast<void*>(address / g_page_bytes * g_page_bytes);
      if (mmap(page, g_page_bytes, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) !=
          page)
        break;
      return;
    }
  }
  // The fault is outside all watched mappings, so the previous handler of SIGBUS handles it.
  if (g_before.sa_flags & SA_SIGINFO) return g_before.sa_sigaction(number, info, context);
  if (g_before.sa_handler != SIG_DFL && g_before.sa_handler != SIG_IGN)
    return g_before.sa_handler(number);
  // There is no previous handler, so SIGBUS must end the process. After this handler returns, the
  // access is repeated and fails again, now with the default action. A signal that was not caused
  // by an access of this thread would not occur again, so the handler raises it again.
  signal(SIGBUS, SIG_DFL);
  const bool was_sent = info->si_code <= 0 || info->si_code == BUS_MCEERR_AO;
  if (was_sent) raise(number);
}

void install_handler() {
  static std::once_flag once;
  std::call_once(once, [] {
    g_page_bytes = static_cast<uintptr_t>(sysconf(_SC_PAGESIZE));
    struct sigaction action = {};
    action.sa_sigaction = on_bus_error;
    action.sa_flags = SA_SIGINFO | SA_NODEFER;
    sigemptyset(&action.sa_mask);
    sigaction(SIGBUS, &action, &g_before);
  });
}

}  // namespace

WatchedMapping::WatchedMapping(const void* begin, uint64_t bytes) {
  install_handler();
  for (int i = 0; i < kMaxWatched && slot_ < 0; ++i)
    if (!g_slots[i].taken.exchange(true)) slot_ = i;
  if (slot_ < 0) return;
  Slot& slot = g_slots[slot_];
  slot.damaged = false;
  slot.begin = reinterpret_cast<uintptr_t>(begin);
  slot.end = reinterpret_cast<uintptr_t>(begin) + bytes;
}

WatchedMapping::~WatchedMapping() {
  if (slot_ < 0) return;
  Slot& slot = g_slots[slot_];
  slot.end = 0;
  slot.taken = false;
}

bool WatchedMapping::is_damaged() const { return slot_ >= 0 && g_slots[slot_].damaged; }

}  // namespace voxdag
