// Small programs for the simulated device. Each broken program breaks one rule of CUDA; the others
// are correct. They are compiled like the backend's sources, so that the memory accesses of their
// kernels are checked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace voxdag::cuda_sim {

struct BrokenProgram {
  const char* name;
  void (*run)();          // ends the process with a message
  const char* violation;  // part of this message
};
std::vector<BrokenProgram> broken_programs();

// Every thread of the blocks writes its number in the block to a word of shared memory, passes a
// barrier, and reads its neighbor's word. Returns the words that the threads read.
std::vector<uint32_t> exchange_with_neighbors(uint32_t blocks, uint32_t threads);

// The values of a host word that a download writes: `before` and `after` the host waits for the
// stream.
struct DownloadedWord {
  uint32_t before = 0, after = 0;
};
DownloadedWord download_word(uint32_t value);

// Uploads a value with the backend's CudaSpace, and changes the value immediately after the call.
// Returns the value that arrived on the device.
uint64_t upload_then_change(uint64_t value);

// Returns the address of device memory, after removing the access rights of the host.
const volatile uint32_t* words_of_the_device();

// Allocates 100 bytes of device memory. Returns the bytes in use after all other memory was
// released. Releases the 100 bytes before it returns.
uint64_t forget_an_allocation();

}  // namespace voxdag::cuda_sim
