#include "scene/gltf/compressed/decoded_buffers.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/base/process_limits.h"
#include "scene/gltf/compressed/codecs.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// If a decoder used more bytes than this, its freed memory is returned to the system.
constexpr uint64_t kTrimBytes = uint64_t{4} << 20;

std::string name_of(const BufferSource& buffer) {
  return buffer.draco ? buffer.draco->where
                      : std::string(buffer.meshopt->extension) + " of " +
                            std::to_string(buffer.meshopt->count) + " elements in buffer " +
                            std::to_string(buffer.meshopt->from.buffer) + " from byte " +
                            std::to_string(buffer.meshopt->from.byte_offset);
}

}  // namespace

DecodedBuffers::DecodedBuffers(FileSystem& files, std::string scratch_path,
                               const Document& document, MemoryBudget& budget)
    : files_(files),
      scratch_path_(std::move(scratch_path)),
      document_(document),
      budget_(budget),
      charge_(budget, "the compressed parts of " + document.path) {
  const auto is_decoded = [](const BufferSource& b) {
    return b.kind == BufferSource::Kind::kDecoded;
  };
  first_ = static_cast<size_t>(std::ranges::find_if(document.buffers, is_decoded) -
                               document.buffers.begin());
  charge_.add((document.buffers.size() - first_) * sizeof(Decoded));
  for (size_t i = first_; i < document.buffers.size(); ++i) decoded_.emplace_back();
}

void DecodedBuffers::read(int index, uint64_t offset, std::span<std::byte> out,
                          const ReadFile& read_file) {
  Decoded& decoded = decoded_[static_cast<size_t>(index) - first_];
  if (!decoded.is_there.load(std::memory_order_acquire)) {
    const std::lock_guard lock(decoded.mutex);
    if (!decoded.is_there.load(std::memory_order_relaxed)) {
      const BufferSource& buffer = document_.buffers[static_cast<size_t>(index)];
      decoded.begin = reserve(buffer.byte_length);
      decode_within_budget(buffer, decoded.begin, read_file);
      decoded.is_there.store(true, std::memory_order_release);
    }
  }
  reader_->read_at(decoded.begin + offset, out);
}

// Decodes the buffer. If this fails because memory is short while other threads decode, decodes the
// buffer again while no other thread decodes.
void DecodedBuffers::decode_within_budget(const BufferSource& buffer, uint64_t begin,
                                          const ReadFile& read_file) {
  const std::string where = document_.path + ": " + name_of(buffer) + ": ";
  try {
    try {
      const std::shared_lock lock(decoding_);
      return decode(buffer, begin, read_file);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kOutOfMemory) throw;
    }
    const std::unique_lock lock(decoding_);
    decode(buffer, begin, read_file);
  } catch (const BrokenData& broken) {
    throw Error(ErrorCode::kInvalidInput, where + broken.message);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
    throw Error(ErrorCode::kOutOfMemory,
                where + error.message() +
                    "; give it more memory, or decompress the file first (gltf-transform copy)");
  }
}

void DecodedBuffers::decode(const BufferSource& buffer, uint64_t begin, const ReadFile& read_file) {
  const CompressedBytes& from = buffer.meshopt ? buffer.meshopt->from : buffer.draco->from;
  PageBuffer<std::byte> compressed(budget_, static_cast<size_t>(from.byte_length),
                                   "compressed geometry");
  const std::span<std::byte> bytes(compressed.data(), compressed.size());
  read_file(from.buffer, from.byte_offset, bytes);
  if (buffer.meshopt) {
    PageBuffer<std::byte> out(budget_, static_cast<size_t>(buffer.byte_length), "decoded geometry");
    const std::span<std::byte> decoded(out.data(), out.size());
    decode_meshopt(*buffer.meshopt, bytes, decoded);
    writer_->write_at(begin, decoded);
    return;
  }
  uint64_t charged = 0;
  {
    MemoryCharge charge(budget_, 0, "Draco");
    uint64_t at = begin;
    decode_draco(*buffer.draco, bytes, charge, [&](std::span<const std::byte> piece) {
      writer_->write_at(at, piece);
      at += piece.size();
    });
    charged = charge.bytes();
  }
  if (charged > kTrimBytes) trim_heap();
}

// Reserves `bytes` in the temporary file, which the first call creates. Returns their offset.
uint64_t DecodedBuffers::reserve(uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  if (!reader_) open_scratch();
  const uint64_t begin = end_;
  end_ += bytes;
  return begin;
}

void DecodedBuffers::open_scratch() {
  const bool is_own = scratch_path_.empty();
  FileSystem& files = is_own ? system_files() : files_;
  const std::string folder =
      is_own ? make_temporary_folder(temporary_parent() + "/voxdag-scene-") : "";
  const std::string path = is_own ? folder + "/decoded" : scratch_path_;
  writer_ = files.create(path);
  reader_ = files.open_read(path);
  // A file without a name disappears when the process ends, even after a crash.
  files.remove(path);
  if (is_own) files.remove_directory(folder);
}

}  // namespace voxdag::gltf
