// The only file that calls tinygltf's parser.
#include "scene/gltf/document/model_reader.h"

#include <algorithm>
#include <climits>
#include <exception>
#include <new>
#include <utility>

#include "scene/gltf/document/tinygltf.h"
#include "scene/gltf/uri/data_uri.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

using Json = JsonElement::Json;

constexpr size_t kMaxReasonBytes = 200;

// Memory of an entry of a std::map, with the allocations of its key and value.
constexpr uint64_t kBytesPerMember = 112;
// Copies of the text in memory during parsing: the section, which grows by doubling, the text of
// all sections, and the strings in tinygltf's JSON tree.
constexpr uint64_t kTextCopies = 4;
constexpr uint64_t kTreeBytesPerValue = 128;

// Returns the bytes that an element's values take in tinygltf's model. The model has a Value for
// each value in an extension, and a Parameter for each member of a material.
uint64_t model_bytes(const ElementText& element) {
  return element.values * 3 * sizeof(double) +
         element.values_in_extensions * 3 * sizeof(tinygltf::Value) +
         element.members * (kBytesPerMember + sizeof(tinygltf::Parameter)) + element.string_bytes;
}

std::string string_or_empty(const Json& object, const char* key) {
  const auto member = object.find(key);
  return member != object.end() && member->is_string() ? member->get<std::string>() : "";
}

}  // namespace

ModelReader::ModelReader(const std::string& scene_path, MemoryBudget& budget)
    : path_(scene_path),
      model_(std::make_shared<tinygltf::Model>()),
      model_charge_(budget, "the description of the materials in " + scene_path),
      parse_charge_(budget, "the description of the materials in " + scene_path) {}

void ModelReader::add(Section& section, const ElementText& element, uint64_t bytes) {
  // Charges `bytes` twice, because the old and the new array of a growing vector exist together.
  model_charge_.add(2 * bytes + model_bytes(element));
  parse_charge_.add(kTextCopies * element.text.size() + kTreeBytesPerValue * element.values);
  const auto warn = [&](const std::string& name, const std::string& message) {
    warnings_.add({"broken-material",
                   path_ + ": " + section.element + " " + numbered(section.count, name), message});
  };
  const std::string text = without_broken_members(section.kind, element, warn);
  section.text.append(section.count++ == 0 ? "" : ",").append(text);
}

void ModelReader::add_violation(const std::string& message) {
  warnings_.add({"unusable-materials", path_, message + "; it is ignored"});
}

void ModelReader::add_material(const ElementText& element) {
  add(materials_, element, sizeof(tinygltf::Material));
}
void ModelReader::add_texture(const ElementText& element) {
  add(textures_, element, sizeof(tinygltf::Texture));
}
void ModelReader::add_sampler(const ElementText& element) {
  add(samplers_, element, sizeof(tinygltf::Sampler));
}

void ModelReader::add_image(const JsonElement& element) {
  tinygltf::Image image;
  RawString uri;
  if (const Json& value = element.value(); value.is_object()) {
    image.name = string_or_empty(value, "name");
    image.mimeType = string_or_empty(value, "mimeType");
    image.uri = string_or_empty(value, "uri");
    if (!image.uri.empty()) uri = element.uri();
    if (is_data_uri(image.uri)) image.uri.resize(image.uri.find(',') + 1);
    const auto view = element.find("bufferView");
    const auto index = view ? view->whole_number() : std::nullopt;
    if (index && *index <= INT_MAX) image.bufferView = static_cast<int>(*index);
  }
  model_charge_.add(2 * (sizeof(image) + sizeof(uri)) + image.name.size() + image.uri.size() +
                    image.mimeType.size());
  model_->images.push_back(std::move(image));
  image_uris_.push_back(uri);
}

void ModelReader::parse(Document& document) {
  const std::string text = R"({"materials":[)" + std::exchange(materials_.text, {}) +
                           R"(],"textures":[)" + std::exchange(textures_.text, {}) +
                           R"(],"samplers":[)" + std::exchange(samplers_.text, {}) + "]}";
  std::string errors, warnings;
  bool is_loaded = false;
  std::vector<tinygltf::Image> images = std::move(model_->images);
  try {
    if (text.size() > INT_MAX)
      errors = "over 2 GiB of JSON";
    else
      is_loaded = tinygltf::TinyGLTF().LoadASCIIFromString(
          model_.get(), &errors, &warnings, text.data(), static_cast<unsigned>(text.size()), "",
          tinygltf::NO_REQUIRE);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: the system has none left for the materials of " + document.path +
                    ": expected more free memory on this machine");
  } catch (const std::exception& e) {
    errors = without_prefix(e.what());
  }
  if (!is_loaded) {
    model_->materials.clear();
    model_->textures.clear();
    model_->samplers.clear();
    warnings_.add({"unusable-materials", path_,
                   "its materials cannot be used (" + printable(errors, kMaxReasonBytes) +
                       "); all surfaces are white"});
  }
  model_->images = std::move(images);
  document.model = std::move(model_);
  document.image_uris = std::move(image_uris_);
  document.material_warnings = std::move(warnings_);
  document.model_charge = std::move(model_charge_);
  parse_charge_ = {};
}

}  // namespace voxdag::gltf
