#include "scene/gltf/mesh_data/accessor_reader.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

constexpr uint64_t kSparseWindow = 1024;

// Layout of elements in a window of bytes.
struct Layout {
  int component_type;
  int components;
  bool normalized;
  size_t stride;
};

template <class From, class To>
void decode_as(const std::byte* bytes, const Layout& layout, size_t count, To* out) {
  for (size_t i = 0; i < count; ++i, bytes += layout.stride) {
    for (int c = 0; c < layout.components; ++c) {
      From value;
      std::memcpy(&value, bytes + static_cast<size_t>(c) * sizeof(From), sizeof(From));
      *out++ = static_cast<To>(value);
    }
  }
  if constexpr (std::is_integral_v<From> && std::is_floating_point_v<To>) {
    if (!layout.normalized) return;
    const size_t n = count * static_cast<size_t>(layout.components);
    for (To* v = out - n; v != out; ++v)
      *v = std::max(*v / static_cast<To>(std::numeric_limits<From>::max()), To{-1});
  }
}

template <class To>
void decode(const std::byte* bytes, const Layout& layout, size_t count, To* out) {
  switch (layout.component_type) {
    case kByte:
      return decode_as<int8_t>(bytes, layout, count, out);
    case kUnsignedByte:
      return decode_as<uint8_t>(bytes, layout, count, out);
    case kShort:
      return decode_as<int16_t>(bytes, layout, count, out);
    case kUnsignedShort:
      return decode_as<uint16_t>(bytes, layout, count, out);
    case kUnsignedInt:
      return decode_as<uint32_t>(bytes, layout, count, out);
    default:
      return decode_as<float>(bytes, layout, count, out);
  }
}

size_t stride_of(const BufferView& view, size_t element) {
  return view.byte_stride ? static_cast<size_t>(view.byte_stride) : element;
}

// Reads `count` elements, the first at `offset` of the view, window by window.
template <class To>
void read_elements(const BufferView& view, BufferReader& buffers, const Layout& layout,
                   size_t element, uint64_t offset, size_t count, To* out) {
  const size_t at_once = (BufferReader::kWindowBytes - element) / layout.stride + 1;
  while (count > 0) {
    const size_t n = std::min(count, at_once);
    const auto bytes =
        buffers.window(view.buffer, view.byte_offset + offset, (n - 1) * layout.stride + element);
    decode(bytes.data(), layout, n, out);
    out += n * static_cast<size_t>(layout.components);
    offset += n * layout.stride;
    count -= n;
  }
}

}  // namespace

AccessorReader::AccessorReader(const Document& document, BufferReader& buffers, int accessor)
    : document_(document),
      buffers_(buffers),
      accessor_(document.accessors[static_cast<size_t>(accessor)]),
      index_(accessor) {
  if (accessor_.is_sparse) check_sparse_indices();
}

template <class T>
void AccessorReader::read(uint64_t first, size_t count, T* out) {
  const size_t element = static_cast<size_t>(element_bytes(accessor_));
  if (accessor_.view < 0) {
    std::fill_n(out, count * static_cast<size_t>(accessor_.components), T{0});
  } else {
    const BufferView& view = document_.views[static_cast<size_t>(accessor_.view)];
    const size_t stride = stride_of(view, element);
    const Layout layout{accessor_.component_type, accessor_.components, accessor_.normalized,
                        stride};
    read_elements(view, buffers_, layout, element, accessor_.byte_offset + first * stride, count,
                  out);
  }
  if (accessor_.is_sparse) replace_sparse(first, count, out);
}
template void AccessorReader::read(uint64_t first, size_t count, double* out);
template void AccessorReader::read(uint64_t first, size_t count, uint32_t* out);

template <class T>
void AccessorReader::replace_sparse(uint64_t first, size_t count, T* out) {
  const size_t element = static_cast<size_t>(element_bytes(accessor_));
  const Layout layout{accessor_.component_type, accessor_.components, accessor_.normalized,
                      element};
  const BufferView& view = document_.views[static_cast<size_t>(accessor_.sparse.value_view)];
  const auto after = std::ranges::upper_bound(sparse_directory_, first);
  const auto windows_before = after - sparse_directory_.begin();
  uint64_t k = windows_before > 0 ? (static_cast<uint64_t>(windows_before) - 1) * kSparseWindow : 0;
  for (; k < accessor_.sparse.count; k += kSparseWindow) {
    const size_t n = static_cast<size_t>(std::min(kSparseWindow, accessor_.sparse.count - k));
    read_sparse_indices(k, n);
    for (size_t i = 0; i < n; ++i) {
      const uint64_t index = sparse_indices_[i];
      if (index < first) continue;
      if (index >= first + count) return;
      read_elements(view, buffers_, layout, element,
                    accessor_.sparse.value_offset + (k + i) * stride_of(view, element), 1,
                    out + (index - first) * static_cast<size_t>(accessor_.components));
    }
  }
}

void AccessorReader::read_sparse_indices(uint64_t first, size_t count) {
  const Sparse& sparse = accessor_.sparse;
  const auto bytes = static_cast<size_t>(component_bytes(sparse.index_type));
  sparse_indices_.resize(count);
  const BufferView& view = document_.views[static_cast<size_t>(sparse.index_view)];
  const size_t stride = stride_of(view, bytes);
  read_elements(view, buffers_, Layout{sparse.index_type, 1, false, stride}, bytes,
                sparse.index_offset + first * stride, count, sparse_indices_.data());
}

void AccessorReader::check_sparse_indices() {
  const std::string where = document_.name_accessor(index_) + ": its sparse index ";
  const uint64_t windows = (accessor_.sparse.count + kSparseWindow - 1) / kSparseWindow;
  directory_charge_ = MemoryCharge(buffers_.budget(), windows * sizeof(uint32_t),
                                   document_.path + ": " + document_.name_accessor(index_));
  sparse_directory_.reserve(static_cast<size_t>(windows));
  uint64_t next = 0;  // smallest allowed next index
  for (uint64_t k = 0; k < accessor_.sparse.count; k += kSparseWindow) {
    read_sparse_indices(k,
                        static_cast<size_t>(std::min(kSparseWindow, accessor_.sparse.count - k)));
    sparse_directory_.push_back(sparse_indices_.front());
    for (uint32_t index : sparse_indices_) {
      if (index < next)
        refuse(document_.path, where + std::to_string(index) + " follows " +
                                   std::to_string(next - 1) + ", expected a larger index");
      if (index >= accessor_.count)
        refuse(document_.path, where + std::to_string(index) + ", expected less than " +
                                   std::to_string(accessor_.count) + ", the number of elements");
      next = uint64_t{index} + 1;
    }
  }
}

}  // namespace voxdag::gltf
