// The description of a build's options (core/fields/field.h). The command line, the service's job
// request and its schema, and the Python keywords and their checks derive from it.
// docs/architecture.md shows how to add an option. None of these interfaces offers a member of
// BuildSpec that has no description here.
#pragma once

#include <string>
#include <vector>

#include "core/base/process_limits.h"
#include "core/dag/space/cube_walk.h"
#include "core/fields/field.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

template <>
struct NameSetTraits<AttributeSet> {
  static std::vector<std::string> names(const AttributeSet& set) { return set.names(); }
  static std::vector<std::string> all() { return AttributeSet::all().names(); }
  static bool add(AttributeSet& set, std::string_view name) {
    for (const Attribute attribute : AttributeSet::all().list())
      if (name == name_of(attribute)) return set.add(attribute), true;
    return false;
  }
};

inline constexpr const char* kClusterHeading = "Cluster (docs/cluster.md)";
inline constexpr int64_t kMaxOptionThreads = 1024;
inline constexpr int64_t kMaxOptionEdge = int64_t{1} << 20;

inline constexpr Field kSceneField =
    Field("scene",
          "scene files (.glb, .gltf, .ply, .las, .obj, .stl, .xyz, .txt, .csv), together one scene")
        .required()
        .positional()
        .key(false);
inline constexpr Field kResolutionField = Field("resolution", "voxels per edge")
                                              .power_of_two(4, kMaxOptionEdge)
                                              .required()
                                              .with(&Field::shorthand, "-r")
                                              .key(true);

template <class Visitor>
void fields(Visitor& visit, GeometryOptions& g) {
  const auto option = [](const char* name, const char* help) {
    return Field(name, help).group("Geometry (decides the bytes of the result)");
  };
  visit(kSceneField, g.scenes);
  visit(kResolutionField, g.resolution);
  visit(option("hash_bits", "bits of a node's hash that count").range(4, 64).key(true),
        g.hash_bits);
  visit(option("order", "order of the nodes: hash, or first-parent for faster reading"), g.order);
  visit(option("solid", "fill the interior by this rule (docs/solid.md)")
            .unset_means("fill nothing")
            .or_unset(),
        g.solid);
  visit(option("seed", "with solid enclosed: fill only the enclosed space around this point")
            .with(&Field::parts, "X,Y,Z"),
        g.seed);
  visit(option("radius", "with solid enclosed: seal gaps of up to this many voxels")
            .range(0, kMaxRadius),
        g.radius);
  visit(option("skip_invalid", "drop and count invalid triangles").key(true), g.skip_invalid);
  visit(option("thin", "set fewer voxels: the thinnest surface without holes between faces"),
        g.thin);
  visit(option("cutouts", "leave out voxels whose surfaces are cut out by alpha, or keep them")
            .unset_means("skip with colors, otherwise keep")
            .or_unset()
            .key(g.cutouts == CutoutRule::kSkip),
        g.cutouts);
  visit(option("point_radius", "half edge of the cube that replaces each point, in scene units")
            .above_zero()
            .unset_means("a point sets one voxel"),
        g.point_radius);
  visit(option("columns", "columns of text files with points, such as x,y,z,_,r,g,b")
            .line(1024)
            .unset_means("the file's header line, or x,y,z and colors")
            .or_unset(),
        g.columns);
  visit(option("ignore_extension", "required extension of a glTF file to ignore; repeatable")
            .line(128)
            .items(64),
        g.ignore_extension);
  visit(option("bounds", "the grid's cube, by its low corner and edge")
            .with(&Field::parts, "X,Y,Z,EDGE")
            .above_zero(),
        g.bounds);
  visit(option("voxel_size",
               "edge of a voxel; the cube is centered on the scene; without a resolution, the "
               "smallest that fits")
            .above_zero()
            .excludes("bounds"),
        g.voxel_size);
  visit(option("color", "store the colors of the scene's materials").key(false),
        g.attributes[Attribute::kColor]);
  visit(option("color_resolution", "cells per edge of the color grid, at most the resolution")
            .power_of_two(4, kMaxOptionEdge)
            .unset_means("the resolution, 4096 at most")
            .or_unset()
            .key(g.attributes.any()),
        g.color_resolution);
  visit(option("attributes", "attributes to store for the cells of the color grid")
            .or_unset()
            .key(g.attributes.any() && g.attributes != AttributeSet{Attribute::kColor}),
        g.attributes);
}

template <class Visitor>
void fields(Visitor& visit, RunOptions& r) {
  const auto option = [](const char* name, const char* help) {
    return Field(name, help).group("Run (never changes the bytes of the result)");
  };
  const auto of_build = [&](const char* name, const char* help) {
    return option(name, help).from(Scope::kBuild);
  };
  visit(
      of_build("output", "the .vdag file to write").path().required().with(&Field::shorthand, "-o"),
      r.output);
  visit(option("memory", "memory budget")
            .at_least(static_cast<int64_t>(kMinMemory))
            .bytes()
            .unset_means("half the RAM"),
        r.memory_bytes);
  visit(option("threads", "worker threads")
            .range(1, kMaxOptionThreads)
            .unset_means("all cores")
            .or_unset(),
        r.threads);
  visit(option("subvolume", "edge of a subvolume in voxels")
            .power_of_two(64, kMaxOptionEdge)
            .unset_means("chosen by the build")
            .or_unset(),
        r.subvolume_edge);
  visit(option("backend", "device and pipeline that build subvolumes"), r.backend);
  visit(option("method", "algorithm of the backend; consing is the CPU's")
            .unset_means("the backend's fastest")
            .or_unset(),
        r.method);
  visit(option("work", "folder for temporary files")
            .path()
            .unset_means("OUT.work")
            .from(Scope::kPlan),
        r.work_folder);
  visit(option("strict", "treat warnings about the scene as errors"), r.strict);
  visit(option("allow_empty", "write a file without voxels if the scene sets none"), r.allow_empty);
  visit(of_build("cache", "folder in which builds share subvolumes").path(), r.cache_folder);
  visit(of_build("cache_size", "limit of the cache folder").bytes(), r.cache_bytes);
  visit(of_build("keep_work", "do not remove the work folder"), r.keep_work);
  visit(of_build("restart", "start over instead of resuming the work folder"), r.restart);
  visit(of_build("force",
                 "build even if the estimate says it cannot fit, and replace another scene's DAG"),
        r.force);
}

template <class Visitor>
void fields(Visitor& visit, ClusterOptions& c) {
  const auto option = [](const char* name, const char* help) {
    return Field(name, help).group(kClusterHeading);
  };
  const auto of_build = [&](const char* name, const char* help) {
    return option(name, help).from(Scope::kBuild);
  };
  visit(option("cluster", "engine of a cluster that builds").from(Scope::kPlan), c.engine);
  visit(option("cluster_tasks", "tasks")
            .at_least(1)
            .unset_means("by expected work")
            .from(Scope::kPlan),
        c.tasks);
  visit(of_build("cluster_running", "tasks of an array that run at a time")
            .at_least(1)
            .unset_means("as many as the cluster starts"),
        c.max_running);
  visit(of_build("cluster_options",
                 "options of sbatch, such as \"--partition=x --mem=8G --time=2:00:00\""),
        c.submit_options);
  visit(of_build("cluster_retries", "how often a batch that fails is submitted again"),
        c.max_retries);
  visit(of_build("cluster_grace", "seconds until a shared disk shows the files of a task"),
        c.grace_s);
}

template <class Visitor>
void fields(Visitor& visit, BuildSpec& spec) {
  fields(visit, spec.geometry);
  fields(visit, spec.run);
}

// Forwards to `visit` the fields for which keep(field) is true.
template <class Visitor, class Keep>
class FieldFilter {
 public:
  FieldFilter(Visitor& visit, Keep keep) : visit_(visit), keep_(keep) {}
  template <class T>
  void operator()(const Field& field, T& value) {
    if (keep_(field)) visit_(field, value);
  }

 private:
  Visitor& visit_;
  const Keep keep_;
};

// Visits the options of a job request. Scene and resolution are separate members of the request.
template <class Visitor>
void visit_job_options(Visitor& visit, BuildSpec& spec) {
  FieldFilter filter(visit, [](const Field& field) {
    return field.scope == Scope::kSubmit && !field.is_required;
  });
  fields(filter, spec);
}

// Throws FieldError for the first option that breaks a limit or is excluded by another option.
void check_options(const BuildSpec& spec);

}  // namespace voxdag
