// The part of a scene file that tinygltf reads: materials, textures and samplers. ModelReader
// collects their text, and tinygltf parses it once. ModelReader itself puts the images into
// tinygltf's model, because tinygltf would load them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/warning.h"
#include "scene/gltf/document/document.h"
#include "scene/gltf/json/element_text.h"
#include "scene/gltf/json/json_element.h"
#include "scene/gltf/json/material_members.h"

namespace voxdag::gltf {

class ModelReader {
 public:
  ModelReader(const std::string& scene_path, MemoryBudget& budget);

  // Each function adds an element: add_image() to the images, the others to the JSON text that
  // parse() passes to tinygltf. The functions omit members that break a rule of glTF, with a
  // warning in Document::material_warnings for each. They throw Error{kOutOfMemory} if the model
  // would not fit in the budget.
  void add_material(const ElementText& element);
  void add_texture(const ElementText& element);
  void add_sampler(const ElementText& element);
  void add_image(const JsonElement& element);

  // Adds a warning that a section cannot be read.
  void add_violation(const std::string& message);

  // Sets the model of the document, its image_uris and its material_warnings. Materials, textures
  // and samplers that tinygltf refuses are left out with a warning. Call parse() once, after all
  // elements were added.
  void parse(Document& document);

 private:
  struct Section {
    MaterialSection kind;
    const char* element;  // "material"
    std::string text;     // elements with commas between them
    int count = 0;
  };

  // Appends the element to `section`. `bytes` is its size in the array of tinygltf's model.
  void add(Section& section, const ElementText& element, uint64_t bytes);

  const std::string path_;
  Section materials_{MaterialSection::kMaterials, "material", {}};
  Section textures_{MaterialSection::kTextures, "texture", {}};
  Section samplers_{MaterialSection::kSamplers, "sampler", {}};
  WarningList warnings_;
  std::shared_ptr<tinygltf::Model> model_;
  std::vector<RawString> image_uris_;
  GrowingCharge model_charge_;
  GrowingCharge parse_charge_;
};

}  // namespace voxdag::gltf
