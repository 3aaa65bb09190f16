#include "scene/gltf/json/material_members.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>

#include "core/fields/json_text.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

using MemberJson = nlohmann::json;

enum class Shape {
  kObject,
  kString,
  kNumber,
  kIndex,
  kPair,
  kColor,
  kColorAndAlpha,
  kAlphaMode,
  kWrapMode
};

struct MemberRule {
  const char* key;
  Shape shape;
  std::span<const MemberRule> members = {};  // rules for the members of an object
  bool is_required = false;
};

constexpr MemberRule kTransform[] = {{"offset", Shape::kPair},
                                     {"rotation", Shape::kNumber},
                                     {"scale", Shape::kPair},
                                     {"texCoord", Shape::kIndex}};
constexpr MemberRule kUseExtensions[] = {{"KHR_texture_transform", Shape::kObject, kTransform}};
constexpr MemberRule kTextureUse[] = {{"index", Shape::kIndex, {}, true},
                                      {"texCoord", Shape::kIndex},
                                      {"extensions", Shape::kObject, kUseExtensions}};
constexpr MemberRule kMetallicRoughness[] = {{"baseColorFactor", Shape::kColorAndAlpha},
                                             {"baseColorTexture", Shape::kObject, kTextureUse}};
constexpr MemberRule kGlossiness[] = {{"diffuseFactor", Shape::kColorAndAlpha},
                                      {"diffuseTexture", Shape::kObject, kTextureUse}};
constexpr MemberRule kStrength[] = {{"emissiveStrength", Shape::kNumber}};
constexpr MemberRule kMaterialExtensions[] = {
    {"KHR_materials_pbrSpecularGlossiness", Shape::kObject, kGlossiness},
    {"KHR_materials_emissive_strength", Shape::kObject, kStrength},
    {"KHR_materials_unlit", Shape::kObject}};
constexpr MemberRule kMaterial[] = {{"name", Shape::kString},
                                    {"pbrMetallicRoughness", Shape::kObject, kMetallicRoughness},
                                    {"emissiveFactor", Shape::kColor},
                                    {"emissiveTexture", Shape::kObject, kTextureUse},
                                    {"alphaMode", Shape::kAlphaMode},
                                    {"alphaCutoff", Shape::kNumber},
                                    {"extensions", Shape::kObject, kMaterialExtensions}};

constexpr MemberRule kImageOfExtension[] = {{"source", Shape::kIndex}};
constexpr MemberRule kTextureExtensions[] = {
    {"EXT_texture_webp", Shape::kObject, kImageOfExtension},
    {"EXT_texture_avif", Shape::kObject, kImageOfExtension},
    {"KHR_texture_basisu", Shape::kObject, kImageOfExtension},
    {"MSFT_texture_dds", Shape::kObject, kImageOfExtension}};
constexpr MemberRule kTexture[] = {{"name", Shape::kString},
                                   {"source", Shape::kIndex},
                                   {"sampler", Shape::kIndex},
                                   {"extensions", Shape::kObject, kTextureExtensions}};
constexpr MemberRule kSampler[] = {
    {"name", Shape::kString}, {"wrapS", Shape::kWrapMode}, {"wrapT", Shape::kWrapMode}};

std::span<const MemberRule> rules_of(MaterialSection section) {
  if (section == MaterialSection::kMaterials) return kMaterial;
  if (section == MaterialSection::kTextures) return kTexture;
  return kSampler;
}

const char* expected_by(Shape shape) {
  switch (shape) {
    case Shape::kObject:
      return "an object";
    case Shape::kString:
      return "a string";
    case Shape::kNumber:
      return "a number";
    case Shape::kIndex:
      return "a whole number from 0 to 2147483647";
    case Shape::kPair:
      return "an array of two numbers";
    case Shape::kColor:
      return "an array of three numbers";
    case Shape::kColorAndAlpha:
      return "an array of four numbers";
    case Shape::kAlphaMode:
      return "OPAQUE, MASK or BLEND";
    case Shape::kWrapMode:
      return "33071, 33648 or 10497";
  }
  return "";
}

bool is_index(const MemberJson& value) {
  if (!value.is_number()) return false;
  const double number = value.get<double>();
  return number >= 0 && number <= INT32_MAX && number == std::floor(number);
}

bool are_numbers(const MemberJson& value, size_t count) {
  return value.is_array() && value.size() == count &&
         std::ranges::all_of(value, [](const MemberJson& v) { return v.is_number(); });
}

bool has_shape(const MemberJson& value, Shape shape) {
  switch (shape) {
    case Shape::kObject:
      return value.is_object();
    case Shape::kString:
      return value.is_string();
    case Shape::kNumber:
      return value.is_number();
    case Shape::kIndex:
      return is_index(value);
    case Shape::kPair:
      return are_numbers(value, 2);
    case Shape::kColor:
      return are_numbers(value, 3);
    case Shape::kColorAndAlpha:
      return are_numbers(value, 4);
    case Shape::kAlphaMode:
      return value == "OPAQUE" || value == "MASK" || value == "BLEND";
    case Shape::kWrapMode:
      return value == 33071 || value == 33648 || value == 10497;
  }
  return false;
}

// Returns a text that shows a member's value in an error message.
std::string shown(const MemberJson& value) {
  if (value.is_object()) return "an object";
  if (value.is_string()) return '"' + printable(value.get_ref<const std::string&>()) + '"';
  if (!value.is_array()) return exact_json_text(value);
  const bool are_all = are_numbers(value, value.size());
  return "an array of " + std::to_string(value.size()) + (are_all ? " numbers" : " values") +
         (are_all ? "" : " that are not all numbers");
}

// Removes the members of `object` that break a rule in `rules`, and reports them and missing
// required members. `path` is the object's place in the element; it is empty or ends with a dot.
template <class Report>
void remove_broken(MemberJson& object, std::span<const MemberRule> rules, const std::string& path,
                   const Report& report) {
  for (const MemberRule& rule : rules) {
    const auto member = object.find(rule.key);
    const std::string place = path + rule.key;
    if (member == object.end()) {
      if (rule.is_required) report(place + " is missing, but glTF requires it");
    } else if (!has_shape(*member, rule.shape)) {
      report(place + " is " + shown(*member) + ", expected " + expected_by(rule.shape) +
             "; it is ignored");
      object.erase(member);
    } else {
      remove_broken(*member, rule.members, place + ".", report);
    }
  }
}

}  // namespace

std::string without_broken_members(MaterialSection section, const ElementText& element,
                                   const ReportMember& report) {
  MemberJson value = parse_json<MemberJson>(element.text);
  if (!value.is_object()) {
    report("", "is " + shown(value) + ", expected an object; it is ignored");
    return "{}";
  }
  const auto name = value.find("name");
  const std::string given =
      name != value.end() && name->is_string() ? name->get<std::string>() : std::string();
  bool is_broken = false;
  remove_broken(value, rules_of(section), "", [&](const std::string& message) {
    is_broken = true;
    report(given, message);
  });
  return is_broken ? exact_json_text(value) : element.text;
}

}  // namespace voxdag::gltf
