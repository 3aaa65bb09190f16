#include "scheduler/spec/build_spec.h"

#include <set>

#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "scene/points/columns.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag {
namespace {

// Calls `action(field, value)` for every field. `value` is the option as JSON; null if the option
// is not set.
template <class Action>
class JsonVisitor {
 public:
  explicit JsonVisitor(const Action& action) : action_(action) {}
  template <class T>
  void operator()(const Field& field, T& value) {
    action_(field, json_fields::encode_value(value));
  }

 private:
  const Action& action_;
};

// Checks the options that differ from their defaults. Throws FieldError if such an option breaks a
// limit, or if it excludes another such option that was visited before.
class LimitChecker {
 public:
  explicit LimitChecker(const FieldJson& defaults) : defaults_(defaults) {}
  template <class T>
  void operator()(const Field& field, T& value) {
    const FieldJson given = json_fields::encode_value(value);
    if (given == defaults_.value(field.name, FieldJson())) return;
    if (!fits(field, value)) json_fields::refuse(field.name, expectation<T>(field), given);
    if (given_.contains(field.excluded))
      json_fields::refuse(field.name, std::string("no ") + field.excluded + " at the same time");
    given_.insert(field.name);
  }

 private:
  const FieldJson& defaults_;
  std::set<std::string> given_;
};

void check_radius(const GeometryOptions& g) {
  if (g.radius == 0) return;
  if (g.solid != SolidName::kEnclosed)
    json_fields::refuse("radius", "'solid' to be enclosed, because other rules have no radius");
  if (g.radius >= g.resolution)
    json_fields::refuse("radius", "less than the resolution, " + std::to_string(g.resolution) +
                                      ", not " + std::to_string(g.radius));
  if (g.resolution > kMaxRadiusResolution)
    json_fields::refuse("radius", "a resolution of at most " +
                                      std::to_string(kMaxRadiusResolution) + " with a radius");
}

}  // namespace

std::string geometry_json(const GeometryOptions& options) {
  const FieldJson defaults = record_json(GeometryOptions{});
  FieldJson key = FieldJson::object();
  const auto add = [&](const Field& field, const FieldJson& value) {
    const bool differs = value != defaults.value(field.name, FieldJson());
    if (field.in_key.value_or(differs)) key[field.name] = value;
  };
  GeometryOptions copy = options;
  JsonVisitor visitor(add);
  fields(visitor, copy);
  return exact_json_text(key);
}

void check_options(const BuildSpec& spec) {
  BuildSpec copy = spec;
  const FieldJson defaults = record_json(BuildSpec{});
  LimitChecker checker(defaults);
  fields(checker, copy);
  const GeometryOptions& g = spec.geometry;
  if (g.resolution == 0)
    json_fields::refuse(kResolutionField.name,
                        expectation<uint64_t>(kResolutionField) + ", or a voxel size instead");
  if (!g.columns.empty() && !points::Columns::parse(g.columns))
    json_fields::refuse("columns", points::Columns::kExpected, g.columns);
  if (g.solid != SolidName::kNone && g.attributes.any())
    json_fields::refuse("solid", "no color and no attributes at the same time");
  if (g.solid != SolidName::kNone && g.cutouts == CutoutRule::kSkip)
    json_fields::refuse(
        "solid", "cutouts other than skip, because skipped cutouts are holes in the surface");
  if (g.seed && g.solid != SolidName::kEnclosed)
    json_fields::refuse("seed", "'solid' to be enclosed, because other rules have no seed");
  check_radius(g);
  if (g.solid != SolidName::kNone && g.thin)
    json_fields::refuse("thin", "no solid at the same time");
  if (g.thin && g.attributes.any())
    json_fields::refuse("thin", "no color and no attributes at the same time");
  if (g.thin && g.cutouts == CutoutRule::kSkip)
    json_fields::refuse("thin", "cutouts other than skip");
  if (g.color_resolution && !g.attributes.any())
    json_fields::refuse("color_resolution", "color or attributes as well");
  if (g.color_resolution > g.resolution)
    json_fields::refuse("color_resolution", "at most the resolution, " +
                                                std::to_string(g.resolution) + ", not " +
                                                std::to_string(g.color_resolution));
}

}  // namespace voxdag
