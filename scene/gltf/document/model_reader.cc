// The only file that calls tinygltf's parser.
#include "scene/gltf/document/model_reader.h"

#include <algorithm>
#include <climits>
#include <exception>
#include <new>

#include "scene/gltf/document/tinygltf.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

using Json = JsonElement::Json;

constexpr size_t kMaxReasonBytes = 200;

// Memory of an entry of a std::map, with the allocations of its key and value.
constexpr uint64_t kBytesPerMember = 112;
// Copies of the text in memory during parsing: text_ grows by doubling, and the strings in
// tinygltf's JSON tree are copies of its parts.
constexpr uint64_t kTextCopies = 4;
constexpr uint64_t kTreeBytesPerValue = 128;

// Returns the bytes that `value` and the values in it take in tinygltf's model. The model has a
// Value for each value in an extension, and a Parameter for each member of a material. Adds the
// number of these values to `values`.
uint64_t model_bytes(const Json& value, bool is_in_extensions, uint64_t& values) {
  ++values;
  uint64_t bytes = is_in_extensions ? 3 * sizeof(tinygltf::Value) : 3 * sizeof(double);
  if (value.is_string()) bytes += value.get_ref<const std::string&>().size();
  for (auto m = value.begin(); value.is_structured() && m != value.end(); ++m) {
    bool inside = is_in_extensions;
    if (value.is_object()) {
      inside = inside || m.key() == "extensions";
      bytes += kBytesPerMember + m.key().size() + sizeof(tinygltf::Parameter);
    }
    bytes += model_bytes(*m, inside, values);
  }
  return bytes;
}

// Returns the bytes of an element in the model's array for `section`. A growing vector needs this
// memory twice.
uint64_t element_bytes(std::string_view section) {
  if (section == "materials") return 2 * sizeof(tinygltf::Material);
  if (section == "textures") return 2 * sizeof(tinygltf::Texture);
  if (section == "samplers") return 2 * sizeof(tinygltf::Sampler);
  return 2 * sizeof(std::string) + kBytesPerMember;
}

void check(const JsonElement& element) {
  if (element.key() == "asset") {
    element.at("version").as_string();
    if (const auto minimum = element.find("minVersion")) minimum->as_string();
  } else if (element.key().starts_with("extensions")) {
    element.as_string();
  }
}

std::string string_or_empty(const Json& object, const char* key) {
  const auto member = object.find(key);
  return member != object.end() && member->is_string() ? member->get<std::string>() : "";
}

}  // namespace

ModelReader::ModelReader(const std::string& scene_path, MemoryBudget& budget)
    : model_(std::make_shared<tinygltf::Model>()),
      model_charge_(budget, "the description of the materials in " + scene_path),
      parse_charge_(budget, "the description of the materials in " + scene_path) {}

void ModelReader::add(const JsonElement& element) {
  check(element);
  uint64_t values = 0;
  model_charge_.add(element_bytes(element.key()) + model_bytes(element.value(), false, values));
  const std::string text = element.value().dump();
  parse_charge_.add(kTextCopies * text.size() + kTreeBytesPerValue * values);
  if (element.key() == section_) {
    text_ += ',';
  } else {
    if (section_is_open_) text_ += ']';
    section_ = element.key();
    section_is_open_ = element.is_in_array();
    text_.append(text_.size() > 1 ? "," : "").append(Json(section_).dump()).append(":");
    if (section_is_open_) text_ += '[';
  }
  text_ += text;
}

void ModelReader::add_image(const JsonElement& element) {
  tinygltf::Image image;
  RawString uri;
  if (const Json& value = element.value(); value.is_object()) {
    image.name = string_or_empty(value, "name");
    image.mimeType = string_or_empty(value, "mimeType");
    image.uri = string_or_empty(value, "uri");
    if (!image.uri.empty()) uri = element.uri();
    if (image.uri.starts_with("data:")) image.uri.resize(image.uri.find(',') + 1);
    const auto view = value.find("bufferView");
    if (view != value.end() && view->is_number_unsigned() && view->get<uint64_t>() <= INT_MAX)
      image.bufferView = view->get<int>();
  }
  model_charge_.add(2 * (sizeof(image) + sizeof(uri)) + image.name.size() + image.uri.size() +
                    image.mimeType.size());
  model_->images.push_back(std::move(image));
  image_uris_.push_back(uri);
}

void ModelReader::parse(Document& document) {
  // Padded, because tinygltf refuses texts of less than four characters.
  text_ += section_is_open_ ? "]}  " : "}  ";
  std::string errors, warnings;
  bool is_loaded = false;
  std::vector<tinygltf::Image> images = std::move(model_->images);
  try {
    if (text_.size() > INT_MAX)
      errors = "over 2 GiB of JSON";
    else
      is_loaded = tinygltf::TinyGLTF().LoadASCIIFromString(
          model_.get(), &errors, &warnings, text_.data(), static_cast<unsigned>(text_.size()), "",
          tinygltf::NO_REQUIRE);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: the system has none left for the materials of " + document.path);
  } catch (const std::exception& e) {
    errors = without_prefix(e.what());
  }
  if (!is_loaded) {
    model_->materials.clear();
    model_->textures.clear();
    model_->samplers.clear();
    document.warn("unusable-materials", "",
                  "its materials cannot be used: " + printable(errors, kMaxReasonBytes));
  }
  model_->images = std::move(images);
  document.model = std::move(model_);
  document.image_uris = std::move(image_uris_);
  document.model_charge = std::move(model_charge_);
  text_ = {};
  parse_charge_ = {};
}

}  // namespace voxdag::gltf
