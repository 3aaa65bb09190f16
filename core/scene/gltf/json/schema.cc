#include "core/scene/gltf/json/schema.h"

#include <utility>

#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {
namespace {

constexpr bool kRequired = true;

Schema object(std::vector<Member> members, Keep keep = Keep::kParsed) {
  return {JsonType::kObject, std::move(members), nullptr, keep};
}
Schema array_of(const Schema& elements, Keep keep = Keep::kParsed) {
  return {JsonType::kArray, {}, &elements, keep};
}
Schema map_of(const Schema& elements) { return {JsonType::kObject, {}, &elements, Keep::kParsed}; }
Schema scalar(JsonType type, Keep keep = Keep::kParsed) { return {type, {}, nullptr, keep}; }

const Schema kIndex = scalar(JsonType::kIndex);
const Schema kSize = scalar(JsonType::kSize);
const Schema kStride = scalar(JsonType::kStride);
const Schema kComponentType = scalar(JsonType::kComponentType);
const Schema kElementType = scalar(JsonType::kElementType);
const Schema kPrimitiveIndices = scalar(JsonType::kIndex, Keep::kIndices);
const Schema kString = scalar(JsonType::kString);
const Schema kBoolean = scalar(JsonType::kBoolean);
const Schema kNumber = scalar(JsonType::kNumber);
const Schema kNumbers = array_of(kNumber);
const Schema kIndices = array_of(kIndex);
const Schema kAccessorByName = map_of(kIndex);
const Schema kPresence = object({});

const Schema kHeaderString = scalar(JsonType::kString, Keep::kHeader);
const Schema kAsset =
    object({{"version", &kHeaderString, kRequired}, {"minVersion", &kHeaderString}}, Keep::kHeader);
const Schema kUsedName = scalar(JsonType::kString, Keep::kExtensionsUsed);
const Schema kUsedNames = array_of(kUsedName, Keep::kExtensionsUsed);
const Schema kRequiredName = scalar(JsonType::kString, Keep::kExtensionsRequired);
const Schema kRequiredNames = array_of(kRequiredName, Keep::kExtensionsRequired);

const Schema kBufferUri = scalar(JsonType::kString, Keep::kBuffer);
const Schema kBufferLength = scalar(JsonType::kSize, Keep::kBuffer);
const Schema kBuffer =
    object({{"uri", &kBufferUri}, {"byteLength", &kBufferLength, kRequired}}, Keep::kBuffer);
const Schema kBuffers = array_of(kBuffer, Keep::kBuffer);

const Schema kView = object({{"buffer", &kIndex, kRequired},
                             {"byteLength", &kSize, kRequired},
                             {"byteOffset", &kSize},
                             {"byteStride", &kStride}});
const Schema kViews = array_of(kView);

const Schema kSparseIndices = object({{"bufferView", &kIndex, kRequired},
                                      {"byteOffset", &kIndex},
                                      {"componentType", &kComponentType, kRequired}});
const Schema kSparseValues = object({{"bufferView", &kIndex, kRequired}, {"byteOffset", &kIndex}});
const Schema kSparse = object({{"count", &kIndex, kRequired},
                               {"indices", &kSparseIndices, kRequired},
                               {"values", &kSparseValues, kRequired}});
const Schema kAccessor = object({{"bufferView", &kIndex},
                                 {"byteOffset", &kSize},
                                 {"componentType", &kComponentType, kRequired},
                                 {"count", &kSize, kRequired},
                                 {"type", &kElementType, kRequired},
                                 {"normalized", &kBoolean},
                                 {"sparse", &kSparse},
                                 {"name", &kString}});
const Schema kAccessors = array_of(kAccessor);

const Schema kPrimitiveExtensions = object({{"KHR_draco_mesh_compression", &kPresence}});
const Schema kTargets = array_of(kAccessorByName);
const Schema kPrimitive = object({{"attributes", &kAccessorByName, kRequired},
                                  {"indices", &kPrimitiveIndices},
                                  {"mode", &kIndex},
                                  {"targets", &kTargets},
                                  {"extensions", &kPrimitiveExtensions}});
const Schema kPrimitives = array_of(kPrimitive);
const Schema kMesh =
    object({{"primitives", &kPrimitives, kRequired}, {"weights", &kNumbers}, {"name", &kString}});
const Schema kMeshes = array_of(kMesh);

const Schema kInstancing = object({{"attributes", &kAccessorByName, kRequired}});
const Schema kNodeExtensions = object({{"EXT_mesh_gpu_instancing", &kInstancing}});
const Schema kNode = object({{"name", &kString},
                             {"mesh", &kIndex},
                             {"skin", &kIndex},
                             {"children", &kIndices},
                             {"matrix", &kNumbers},
                             {"translation", &kNumbers},
                             {"rotation", &kNumbers},
                             {"scale", &kNumbers},
                             {"weights", &kNumbers},
                             {"extensions", &kNodeExtensions}});
const Schema kNodes = array_of(kNode);

const Schema kSkin = object(
    {{"joints", &kIndices, kRequired}, {"inverseBindMatrices", &kIndex}, {"name", &kString}});
const Schema kSkins = array_of(kSkin);

const Schema kScene = object({{"nodes", &kIndices}});
const Schema kScenes = array_of(kScene);

const Schema kRoot = object({{"asset", &kAsset, kRequired},
                             {"extensionsUsed", &kUsedNames},
                             {"extensionsRequired", &kRequiredNames},
                             {"buffers", &kBuffers},
                             {"bufferViews", &kViews},
                             {"accessors", &kAccessors},
                             {"meshes", &kMeshes},
                             {"skins", &kSkins},
                             {"nodes", &kNodes},
                             {"scenes", &kScenes},
                             {"scene", &kIndex}});

}  // namespace

const Schema& gltf_schema() { return kRoot; }

const char* type_name(JsonType type) {
  switch (type) {
    case JsonType::kObject:
      return "an object";
    case JsonType::kArray:
      return "an array";
    case JsonType::kIndex:
      return "a whole number from 0 to 2147483647";
    case JsonType::kSize:
      return "a whole number that is not negative";
    case JsonType::kStride:
      return "a multiple of 4 up to 252";
    case JsonType::kComponentType:
      return "a component type (5120 to 5123, 5125 or 5126)";
    case JsonType::kElementType:
      return "SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4";
    case JsonType::kNumber:
      return "a number";
    case JsonType::kString:
      return "a string";
    case JsonType::kBoolean:
      return "true or false";
  }
  return "";
}

bool is_whole_number_of(JsonType type, uint64_t value) {
  switch (type) {
    case JsonType::kIndex:
      return value <= INT32_MAX;
    case JsonType::kSize:
      return value <= INT64_MAX;
    case JsonType::kStride:
      return value <= 252 && value % 4 == 0;
    case JsonType::kComponentType:
      return value <= INT32_MAX && component_bytes(static_cast<int>(value)) > 0;
    default:
      return type == JsonType::kNumber;
  }
}

bool is_string_of(JsonType type, std::string_view value) {
  if (type == JsonType::kString) return true;
  return type == JsonType::kElementType &&
         (value == "SCALAR" || value == "VEC2" || value == "VEC3" || value == "VEC4" ||
          value == "MAT2" || value == "MAT3" || value == "MAT4");
}

}  // namespace voxdag::gltf
