// The members of glTF 2.0's JSON that voxdag reads, and the type each must have. All the rest
// (materials, images, animations, cameras, extras, unknown extensions) is dropped unread.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace voxdag::gltf {

enum class JsonType {
  kObject,
  kArray,
  kIndex,   // a whole number from 0 to 2^31 - 1
  kSize,    // a whole number from 0 to 2^63 - 1
  kStride,  // 0, or a multiple of 4 up to 252
  kComponentType,
  kNumber,  // any number
  kString,
  kElementType,  // "SCALAR", "VEC2" ... "MAT4"
  kBoolean,
};

// What is done with a value that was found where the schema has it.
enum class Keep {
  kParsed,  // handed on to tinygltf
  kHeader,  // asset: its strings are noted
  kExtensionsUsed,
  kExtensionsRequired,
  kBuffer,   // noted and never handed on: tinygltf would load it
  kIndices,  // of a primitive; likewise: tinygltf refuses some that are right
};

struct Schema;

struct Member {
  std::string_view name;
  const Schema* schema = nullptr;
  bool required = false;
};

struct Schema {
  JsonType type = JsonType::kObject;
  std::vector<Member> members;       // of an object, 64 at most
  const Schema* elements = nullptr;  // of an array; of an object's members that are not named
  Keep keep = Keep::kParsed;

  const Member* find(std::string_view name) const {
    for (const Member& member : members)
      if (member.name == name) return &member;
    return nullptr;
  }
};

// The root object.
const Schema& gltf_schema();

// "an array", for messages.
const char* type_name(JsonType type);

// Whether a value of JSON is of a type.
bool is_whole_number_of(JsonType type, uint64_t value);
bool is_string_of(JsonType type, std::string_view value);

}  // namespace voxdag::gltf
