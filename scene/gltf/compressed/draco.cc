// Calls Draco's decoders through a derived class that checks the memory of each step before Draco
// allocates it. Only this file and draco_tables.cc include Draco.
#include "scene/gltf/compressed/codecs.h"

#ifdef VOXDAG_HAS_DRACO
#include <draco/attributes/attribute_quantization_transform.h>
#include <draco/compression/config/decoder_options.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <array>
#include <exception>
#include <new>
#include <stdexcept>
#include <vector>

#include "core/base/error.h"
#include "scene/gltf/compressed/draco_header.h"
#include "scene/gltf/compressed/draco_tables.h"
#include "scene/gltf/document/document.h"
#include "scene/messages.h"
#endif

namespace voxdag::gltf {

#ifdef VOXDAG_HAS_DRACO

namespace {

// Upper bounds of Draco 1.5's allocations in bytes, derived from its code. Measured allocations are
// about half of these bounds. The bounds cover the tables of corners and vertices, and a smaller
// table for each attribute with its own connectivity. For each vertex of an attribute, they cover
// two copies of the value (as integers, and in its final form) and two map entries.
constexpr uint64_t kBytesPerFace = 128;
constexpr uint64_t kBytesPerFaceOfTable = 64;
constexpr uint64_t kMapBytesPerValue = 16;
constexpr uint64_t kBytesPerAttribute = 1024;  // for the objects of an attribute and of its decoder

constexpr size_t kWriteElements = 16384;

constexpr const char* kTooMuchMemory =
    "its Draco data declare more elements than fit in memory: expected undamaged data, or a "
    "machine "
    "with more memory";

// Thrown by BoundedDecoder if the caller needs only the number of vertices. It stops the decoding
// as soon as this number is known.
struct VertexCount {
  uint64_t vertices;
};
constexpr uint64_t kCountVertices = UINT64_MAX;

void charge_more(MemoryCharge& charge, uint64_t bytes) {
  const uint64_t total = charge.bytes() + bytes;
  if (!charge.try_resize(total))
    throw Error(ErrorCode::kOutOfMemory, "decoding its Draco data takes " +
                                             std::to_string(total >> 20) + " MiB, more than " +
                                             "the memory budget leaves");
}

// A Draco decoder that checks its memory before each step. No exception passes through Draco: a
// failed check stores its exception in `refusal`, and the caller of Decode() throws it.
template <class Decoder>
class BoundedDecoder : public Decoder {
 public:
  // `vertices` is the maximum number of vertices. If it is kCountVertices, the decoder only counts
  // the vertices: it stops before it decodes their attributes, and stores the count in `refusal` as
  // a VertexCount.
  BoundedDecoder(const DracoHeader& header, uint64_t vertices, MemoryCharge& charge)
      : header_(header), vertices_(vertices), charge_(charge) {}

  std::exception_ptr refusal;

 protected:
  bool DecodeConnectivity() override {
    return admit([&] { check_connectivity(); }) && Decoder::DecodeConnectivity();
  }
  bool DecodePointAttributes() override {
    attributes_ = *this->buffer();
    return admit([&] { charge_attributes(); }) && Decoder::DecodePointAttributes();
  }
  bool DecodeAllAttributes() override {
    return admit([&] { check_attributes(); }) && Decoder::DecodeAllAttributes();
  }

 private:
  template <class Check>
  bool admit(const Check& check) {
    try {
      check();
      return true;
    } catch (...) {
      refusal = std::current_exception();
      return false;
    }
  }

  void check_connectivity() {
    if (!header_.is_edgebreaker)
      check_index_tables(*this->buffer(), admit_table_);
    else if (header_.has_valences)
      check_valence_tables(*this->buffer(), admit_table_);
  }

  // Charges the memory for the objects of all attributes. Draco makes these objects before it calls
  // DecodeAllAttributes(), so the charge cannot wait until then.
  void charge_attributes() {
    const uint64_t attributes = count_attributes(attributes_, *this);
    charge_more(charge_, attributes * kBytesPerAttribute);
  }

  void check_attributes() {
    const draco::PointCloud& mesh = *this->point_cloud();
    if (vertices_ == kCountVertices) throw VertexCount{mesh.num_points()};
    if (mesh.num_points() > vertices_)
      throw BrokenData{"its Draco data have " + std::to_string(mesh.num_points()) +
                       " vertices, expected at most " + std::to_string(vertices_) +
                       ", the count of its accessors"};
    uint64_t bytes_per_vertex = 0;
    for (int i = 0; i < mesh.num_attributes(); ++i) {
      const draco::PointAttribute& a = *mesh.attribute(i);
      bytes_per_vertex += 2 * static_cast<uint64_t>(a.byte_stride()) + kMapBytesPerValue +
                          sizeof(int32_t) * static_cast<uint64_t>(a.num_components());
    }
    charge_more(charge_, mesh.num_points() * bytes_per_vertex);
    // The charge above fits the budget, so the number of values that this check reads is bounded.
    check_attribute_tables(attributes_, *this, admit_table_);
  }

  const DracoHeader& header_;
  const uint64_t vertices_;
  MemoryCharge& charge_;
  uint64_t table_bytes_ = 0;  // bytes charged for the largest table so far
  const AdmitTable admit_table_ = [this](uint64_t bytes) {
    if (bytes <= table_bytes_) return;
    charge_more(charge_, bytes - table_bytes_);
    table_bytes_ = bytes;
  };
  draco::DecoderBuffer attributes_;  // start of the attribute section
};

template <class Decoder>
void decode_as(const DracoHeader& header, std::span<const std::byte> data, MemoryCharge& charge,
               uint64_t max_vertices, draco::Mesh& mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  // Makes Draco leave quantized values as integers, because write_dequantized() converts them with
  // operations that give the same result on every machine.
  draco::DecoderOptions options;
  for (const auto type : {draco::GeometryAttribute::POSITION, draco::GeometryAttribute::GENERIC})
    options.SetAttributeBool(type, "skip_attribute_transform", true);
  BoundedDecoder<Decoder> decoder(header, max_vertices, charge);
  const draco::Status status = decoder.Decode(options, &buffer, &mesh);
  if (decoder.refusal) std::rethrow_exception(decoder.refusal);
  if (!status.ok())
    throw BrokenData{"its Draco data are damaged" +
                     (status.error_msg_string().empty()
                          ? ""
                          : " (" + printable(status.error_msg_string()) + ")")};
}

// Decodes Draco data into `mesh`. `compressed` includes the header. `max_vertices` is the maximum
// number of vertices. If it is kCountVertices, decode_mesh() only counts the vertices: it stops
// before it decodes their attributes, and throws the count as a VertexCount.
void decode_mesh(std::span<std::byte> compressed, const DracoHeader& header, MemoryCharge& charge,
                 uint64_t max_vertices, draco::Mesh& mesh) {
  charge_more(charge,
              header.faces * (kBytesPerFace + kBytesPerFaceOfTable * header.attribute_tables));
  const std::span<const std::byte> data = compressed.subspan(header.begin);
  if (header.is_edgebreaker)
    decode_as<draco::MeshEdgebreakerDecoder>(header, data, charge, max_vertices, mesh);
  else
    decode_as<draco::MeshSequentialDecoder>(header, data, charge, max_vertices, mesh);
}

// Collects elements and writes them in pieces.
template <class T>
class Writer {
 public:
  using Write = std::function<void(std::span<const std::byte>)>;
  explicit Writer(const Write& write) : write_(write) { values_.reserve(kWriteElements + 4); }

  void add(T value) { values_.push_back(value); }
  void flush_if_full() {
    if (values_.size() >= kWriteElements) flush();
  }
  void flush() {
    if (!values_.empty()) write_(std::as_bytes(std::span(values_)));
    values_.clear();
  }

 private:
  const Write& write_;
  std::vector<T> values_;
};

void write_faces(const DracoPart& part, const draco::Mesh& mesh,
                 const Writer<uint32_t>::Write& write) {
  Writer<uint32_t> out(write);
  const uint64_t faces = mesh.num_faces(), triangles = part.corners / 3;
  // A strip can declare more triangles than the Draco data have faces, because it counts degenerate
  // triangles. The last face is repeated for the missing triangles.
  for (uint64_t i = 0; i < triangles; ++i) {
    const draco::Mesh::Face& face =
        mesh.face(draco::FaceIndex(static_cast<uint32_t>(std::min(i, faces - 1))));
    for (const draco::PointIndex& corner : face) {
      if (corner.value() >= mesh.num_points())
        throw BrokenData{"index " + std::to_string(corner.value()) +
                         " of its Draco data does not exist, expected less than " +
                         std::to_string(mesh.num_points()) + ", the number of vertices"};
      out.add(corner.value());
    }
    out.flush_if_full();
  }
  out.flush();
}

// Writes zeros for the vertices that the part declares but the data do not have. `points` is the
// number of vertices in the data.
template <class T>
void pad(const DracoPart& part, const DracoPart::Attribute& wanted, uint32_t points,
         Writer<T>& out) {
  for (uint64_t v = points; v < part.vertices; ++v) {
    for (int c = 0; c < wanted.components; ++c) out.add(T{0});
    out.flush_if_full();
  }
}

// Writes the values of all vertices, each `wanted.components` numbers of type T. `points` is the
// number of vertices in the data.
template <class T>
void write_values(const DracoPart& part, const DracoPart::Attribute& wanted, uint32_t points,
                  const draco::PointAttribute& found, const typename Writer<T>::Write& write) {
  Writer<T> out(write);
  std::array<T, 16> value{};
  for (uint32_t v = 0; v < points; ++v) {
    const draco::AttributeValueIndex index = found.mapped_index(draco::PointIndex(v));
    if (index.value() >= found.size() ||
        !found.ConvertValue<T>(index, static_cast<int8_t>(wanted.components), value.data()))
      throw BrokenData{"its Draco attribute " + wanted.name + " cannot be read as " +
                       component_name(wanted.component_type)};
    for (int c = 0; c < wanted.components; ++c) out.add(value[static_cast<size_t>(c)]);
    out.flush_if_full();
  }
  pad(part, wanted, points, out);
  out.flush();
}

// Writes integer * (range / max integer) + minimum, in floats, as Draco's decoders compute it.
void write_dequantized(const DracoPart& part, const DracoPart::Attribute& wanted, uint32_t points,
                       const draco::PointAttribute& found,
                       const draco::AttributeQuantizationTransform& transform,
                       const Writer<float>::Write& write) {
  const float largest = static_cast<float>((uint64_t{1} << transform.quantization_bits()) - 1);
  const float step = transform.range() / largest;
  Writer<float> out(write);
  std::array<int32_t, 16> value{};
  for (uint32_t v = 0; v < points; ++v) {
    const draco::AttributeValueIndex index = found.mapped_index(draco::PointIndex(v));
    if (index.value() >= found.size() ||
        !found.ConvertValue<int32_t>(index, static_cast<int8_t>(wanted.components), value.data()))
      throw BrokenData{"its Draco attribute " + wanted.name + " cannot be read as integers"};
    for (int c = 0; c < wanted.components; ++c)
      out.add(static_cast<float>(value[static_cast<size_t>(c)]) * step + transform.min_value(c));
    out.flush_if_full();
  }
  pad(part, wanted, points, out);
  out.flush();
}

void write_attribute(const DracoPart& part, const DracoPart::Attribute& wanted,
                     const draco::Mesh& mesh, const Writer<float>::Write& write) {
  const int id = mesh.GetAttributeIdByUniqueId(static_cast<uint32_t>(wanted.id));
  if (id < 0)
    throw BrokenData{"its Draco data have no attribute with the id " + std::to_string(wanted.id) +
                     ", expected " + wanted.name + " there"};
  const draco::PointAttribute& found = *mesh.attribute(id);
  if (found.num_components() != wanted.components)
    throw BrokenData{"its Draco attribute " + wanted.name + " has " +
                     std::to_string(found.num_components()) + " components, expected " +
                     std::to_string(wanted.components) + ", as in its accessor"};
  const uint32_t points = mesh.num_points();
  draco::AttributeQuantizationTransform transform;
  if (transform.InitFromAttribute(found)) {
    if (wanted.component_type != kFloat)
      throw BrokenData{"its Draco attribute " + wanted.name + " has floats, expected the type " +
                       component_name(wanted.component_type) + ", as in its accessor"};
    return write_dequantized(part, wanted, points, found, transform, write);
  }
  switch (wanted.component_type) {
    case kByte:
      return write_values<int8_t>(part, wanted, points, found, write);
    case kUnsignedByte:
      return write_values<uint8_t>(part, wanted, points, found, write);
    case kShort:
      return write_values<int16_t>(part, wanted, points, found, write);
    case kUnsignedShort:
      return write_values<uint16_t>(part, wanted, points, found, write);
    case kUnsignedInt:
      return write_values<uint32_t>(part, wanted, points, found, write);
    default:
      return write_values<float>(part, wanted, points, found, write);
  }
}

void check_faces(const DracoPart& part, uint64_t faces) {
  const uint64_t triangles = part.corners / 3;
  const bool fits = part.is_strip
                        ? faces <= triangles && triangles <= kMaxStripTrianglesPerFace * faces
                        : faces == triangles;
  if (!fits)
    throw BrokenData{"its Draco data have " + std::to_string(faces) + " faces, expected " +
                     std::to_string(triangles) + ", the number of triangles of its indices" +
                     (part.is_strip ? ", or fewer (at least an eighth)" : "")};
}

}  // namespace

void decode_draco(const DracoPart& part, std::span<std::byte> compressed, MemoryCharge& charge,
                  const std::function<void(std::span<const std::byte>)>& write) {
  const DracoHeader header = read_draco_header(compressed);
  check_faces(part, header.faces);
  try {
    draco::Mesh mesh;
    decode_mesh(compressed, header, charge, part.vertices, mesh);
    check_faces(part, mesh.num_faces());
    if (part.has_indices) write_faces(part, mesh, write);
    for (const DracoPart::Attribute& attribute : part.attributes)
      write_attribute(part, attribute, mesh, write);
  } catch (const std::bad_alloc&) {
    throw BrokenData{kTooMuchMemory};
  } catch (const std::length_error&) {
    throw BrokenData{kTooMuchMemory};
  }
}

uint64_t count_draco_vertices(std::span<std::byte> compressed, MemoryCharge& charge) {
  const DracoHeader header = read_draco_header(compressed);
  try {
    draco::Mesh mesh;
    decode_mesh(compressed, header, charge, kCountVertices, mesh);
    return mesh.num_points();
  } catch (const VertexCount& count) {
    return count.vertices;
  } catch (const std::exception&) {
    throw BrokenData{kTooMuchMemory};
  }
}

#else

void decode_draco(const DracoPart&, std::span<std::byte>, MemoryCharge&,
                  const std::function<void(std::span<const std::byte>)>&) {
  throw BrokenData{"voxdag was built without libdraco: expected a decompressed file"};
}
uint64_t count_draco_vertices(std::span<std::byte>, MemoryCharge&) {
  throw BrokenData{"voxdag was built without libdraco: expected a decompressed file"};
}

#endif

}  // namespace voxdag::gltf
