// A client's request to build a scene: the body of POST /jobs.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "scheduler/spec/build_fields.h"

namespace voxdag::server {

struct JobRequest {
  std::string name;
  std::vector<std::string> labels;  // for searches
  std::string webhook;              // URL that is notified when the job has ended; "": none
  int priority = 0;
  std::vector<std::string> scenes;  // names of uploads or absolute paths
  BuildSpec spec;                   // without scenes, output and work folder
  std::string text;  // JSON with the submitted scene, resolution, options, labels, webhook
};

inline constexpr Field kLabelsField = Field("labels", "texts to find the job by")
                                          .line(64)
                                          .items(16)
                                          .with(&Field::shorthand, "--label");
inline constexpr Field kPriorityField = Field("priority", "higher runs earlier").range(-100, 100);

template <class Visitor>
void fields(Visitor& visit, JobRequest& request) {
  visit(kSceneField.line(4096).items(64), request.scenes);
  visit(kResolutionField, request.spec.geometry.resolution);
  visit(Field("name", "name of the job, for people").line(200).omit_empty(), request.name);
  visit(kLabelsField, request.labels);
  visit(Field("webhook", "URL to notify when the job has ended").line(1024).omit_empty(),
        request.webhook);
  visit(kPriorityField, request.priority);
  visit.object("options", [&](auto& options) { visit_job_options(options, request.spec); });
}

// Parses the body of POST /jobs. Throws RequestError{kInvalid} with the member that is unknown,
// missing or has a wrong value.
JobRequest parse_job_request(std::string_view body);

// The body of PATCH /jobs/{id}.
struct JobPatch {
  int priority = 0;
};

template <class Visitor>
void fields(Visitor& visit, JobPatch& patch) {
  visit(kPriorityField.required(), patch.priority);
}

// Throws RequestError{kInvalid}.
JobPatch parse_job_patch(std::string_view body);

}  // namespace voxdag::server
