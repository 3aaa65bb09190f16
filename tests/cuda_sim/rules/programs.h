// Small programs for the simulated device: broken ones, each of which breaks one rule of CUDA, and
// their sound counterparts. Compiled as the backend's sources are, so that what their kernels touch
// is checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace voxdag::cuda_sim {

struct BrokenProgram {
  const char* name;
  void (*run)();          // does not return
  const char* violation;  // required part of the message
};
std::vector<BrokenProgram> broken_programs();

// Every thread of some blocks writes a word of shared memory, passes a barrier and reads its
// neighbor's word. Returns the words that were read: the neighbor's number in the block.
std::vector<uint32_t> exchange_with_neighbors(uint32_t blocks, uint32_t threads);

// The mailbox of a download as the host sees it: before and after the wait for the stream.
struct DownloadedWord {
  uint32_t before = 0, after = 0;
};
DownloadedWord download_word(uint32_t value);

// Uploads a value with the backend's CudaSpace, changes it immediately, and returns the value that
// arrived.
uint64_t upload_then_change(uint64_t value);

// Device memory, which has no access rights when this returns.
const volatile uint32_t* words_of_the_device();

// Allocates without a release, and returns the bytes that remain in use.
uint64_t forget_an_allocation();

}  // namespace voxdag::cuda_sim
