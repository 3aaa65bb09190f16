#include "scene/import/assimp_scene.h"

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>

#include <algorithm>
#include <cmath>
#include <new>

#include "scene/messages.h"

namespace voxdag {
namespace {

// Parts of a scene that import_scene() does not write to the .glb.
constexpr int kRemoved = aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS |
                         aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS | aiComponent_LIGHTS |
                         aiComponent_CAMERAS;

// Records which files assimp opens.
class RecordingFiles : public Assimp::DefaultIOSystem {
 public:
  explicit RecordingFiles(std::set<std::string>& opened) : opened_(opened) {}
  Assimp::IOStream* Open(const char* path, const char* mode) override {
    Assimp::IOStream* const stream = DefaultIOSystem::Open(path, mode);
    if (stream) opened_.insert(path);
    return stream;
  }

 private:
  std::set<std::string>& opened_;
};

}  // namespace

AssimpScene::AssimpScene(const std::string& path) : path_(path) {
  importer_.SetIOHandler(new RecordingFiles(opened_));  // the importer deletes it
  importer_.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  importer_.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, kRemoved);
  scene_ = importer_.ReadFile(path, 0);
  if (!scene_) refuse_file();
  add_losses();
  // Removes the parts in kRemoved. Computes texture coordinates for materials that define a
  // projection, such as a sphere. Applies transforms of texture coordinates. Keeps positions.
  scene_ = importer_.ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_GenUVCoords |
                                         aiProcess_TransformUVCoords);
  if (!scene_) refuse_file();
}

// Returns the extensions of the formats that assimp reads: ".3ds, .dae".
std::string AssimpScene::extensions() const {
  aiString patterns;
  importer_.GetExtensionList(patterns);
  std::string list;
  for (const char c : text_of(patterns))
    if (c == ';')
      list += ", ";
    else if (c != '*')
      list += c;
  return list;
}

void AssimpScene::refuse_file() {
  const std::string reason = importer_.GetErrorString();
  if (reason.find("bad_alloc") != reason.npos) throw std::bad_alloc();
  std::string message = "cannot be imported: " + printable(reason, 200);
  if (reason.find("No suitable reader") != reason.npos) {
    message = "has a format that cannot be imported, expected one of " + extensions();
  }
  refuse(path_, message);
}

void AssimpScene::add_losses() {
  const auto add = [&](const char* code, const char* message, uint64_t count) {
    if (count > 0) losses_.add({code, path_, message, count});
  };
  add("ignored-animations", "animations are left out", scene_->mNumAnimations);
  add("ignored-cameras-and-lights", "cameras and lights are left out",
      uint64_t{scene_->mNumCameras} + scene_->mNumLights);
  const auto count_meshes = [&](const auto& has) {
    return std::count_if(scene_->mMeshes, scene_->mMeshes + scene_->mNumMeshes,
                         [&](const aiMesh* mesh) { return has(*mesh); });
  };
  add("ignored-skins", "the skin of a mesh is left out; the mesh keeps its bind pose",
      count_meshes([](const aiMesh& mesh) { return mesh.HasBones(); }));
  add("ignored-morph-targets", "the morph targets of a mesh are left out",
      count_meshes([](const aiMesh& mesh) { return mesh.mNumAnimMeshes > 0; }));
}

// Returns the length of the unit of an FBX file in meters; 1 for other files.
double AssimpScene::meters_per_unit() const {
  constexpr const char* kCentimeters = "UnitScaleFactor";
  const aiMetadata* const facts = scene_->mMetaData;
  float as_float = 0;
  double as_double = 0;
  if (facts && facts->Get(kCentimeters, as_float)) as_double = double{as_float};
  if (facts && as_double == 0) facts->Get(kCentimeters, as_double);
  return as_double > 0 && as_double < HUGE_VAL ? as_double / 100 : 1;
}

// Returns the axes of an FBX file that point right, up and to the front. Returns x, y and z for
// other files, for files without valid metadata of their axes, and if assimp has already rotated
// the scene (its root node then has a transformation).
std::array<AssimpScene::Axis, 3> AssimpScene::axes() const {
  const std::array<Axis, 3> standard = {Axis{0, 1}, Axis{1, 1}, Axis{2, 1}};
  if (!scene_->mMetaData || scene_->mRootNode->mTransformation != aiMatrix4x4()) return standard;
  std::array<Axis, 3> axes = standard;
  constexpr const char* kNames[] = {"CoordAxis", "UpAxis", "FrontAxis"};
  unsigned seen = 0;
  for (size_t i = 0; i < axes.size(); ++i) {
    int32_t number = 0, sign = 0;
    if (!scene_->mMetaData->Get(kNames[i], number) ||
        !scene_->mMetaData->Get(std::string(kNames[i]) + "Sign", sign))
      return standard;
    if (number < 0 || number > 2 || (sign != 1 && sign != -1)) return standard;
    axes[i] = {static_cast<unsigned>(number), sign};
    seen |= 1u << number;
  }
  return seen == 7 ? axes : standard;
}

std::array<double, 16> AssimpScene::to_gltf() const {
  const double scale = meters_per_unit();
  std::array<double, 16> columns{};
  const auto all = axes();
  for (size_t row = 0; row < 3; ++row) columns[4 * all[row].number + row] = all[row].sign * scale;
  columns[15] = 1;
  return columns;
}

}  // namespace voxdag
