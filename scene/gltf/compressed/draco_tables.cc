#include "scene/gltf/compressed/draco_tables.h"

#ifdef VOXDAG_HAS_DRACO

#include <draco/compression/config/compression_shared.h>
#include <draco/compression/entropy/rans_symbol_coding.h>
#include <draco/compression/entropy/symbol_decoding.h>

#include <algorithm>
#include <span>

namespace voxdag::gltf {
namespace {

thread_local DracoTables* tables_of_thread = nullptr;

// The memory of the tables that DecodeSymbols() would make from these bytes: a scheme, with raw
// symbols their largest number of bits, and the size of the alphabet, seven bits per byte, the
// lowest first.
uint64_t table_bytes(std::span<const char> data) {
  if (data.empty()) return 0;
  constexpr int kTagBits = 5;
  const bool is_raw = data[0] == draco::SYMBOL_CODING_RAW;
  size_t at = is_raw ? 2 : 1;
  uint64_t symbols = 0;
  for (unsigned shift = 0; at < data.size() && shift < 35; shift += 7) {
    const auto byte = static_cast<uint8_t>(data[at++]);
    symbols |= uint64_t{byte & 0x7fu} << shift;
    if (byte < 0x80) break;
  }
  // Draco refuses more than the data can have, without allocating them.
  symbols = std::min(symbols, 64 * uint64_t{data.size()} + 63);
  const int bits = is_raw && data.size() > 1 ? static_cast<uint8_t>(data[1]) : kTagBits;
  const int precision_bits =
      draco::ComputeRAnsPrecisionFromUniqueSymbolsBitLength(std::min(bits, 18));
  return symbols * (sizeof(uint32_t) + sizeof(draco::rans_sym)) +
         (sizeof(uint32_t) << precision_bits);
}

}  // namespace

DracoTables::DracoTables(MemoryCharge& charge) : charge_(charge) { tables_of_thread = this; }
DracoTables::~DracoTables() { tables_of_thread = nullptr; }

bool DracoTables::admit(uint64_t bytes) {
  bytes_before_ = charge_.bytes();
  if (charge_.try_resize(bytes_before_ + bytes)) return true;
  refused_bytes_ = bytes_before_ + bytes;
  return false;
}
void DracoTables::release() { charge_.try_resize(bytes_before_); }

}  // namespace voxdag::gltf

// draco::DecodeSymbols(), and what the linker makes of it.
#define VOXDAG_DECODE_SYMBOLS "_ZN5draco13DecodeSymbolsEjiPNS_13DecoderBufferEPj"
bool draco_decode_symbols(uint32_t values, int components, draco::DecoderBuffer* from,
                          uint32_t* out) __asm__("__real_" VOXDAG_DECODE_SYMBOLS);
bool charged_decode_symbols(uint32_t values, int components, draco::DecoderBuffer* from,
                            uint32_t* out) __asm__("__wrap_" VOXDAG_DECODE_SYMBOLS);

bool charged_decode_symbols(uint32_t values, int components, draco::DecoderBuffer* from,
                            uint32_t* out) {
  voxdag::gltf::DracoTables* const tables = voxdag::gltf::tables_of_thread;
  if (!tables || values == 0) return draco_decode_symbols(values, components, from, out);
  const std::span<const char> data(from->data_head(), static_cast<size_t>(from->remaining_size()));
  if (!tables->admit(voxdag::gltf::table_bytes(data))) return false;
  const bool done = draco_decode_symbols(values, components, from, out);
  tables->release();
  return done;
}

#endif
