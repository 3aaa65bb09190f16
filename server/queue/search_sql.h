// SQL conditions of a search for jobs (JobFilter). They are conditions on a row of the table `job`
// of job_queue.cc. A damaged request has no scenes and no labels.
#pragma once

#include <string>

namespace voxdag::server {

inline const std::string kRequestOrNone =
    "CASE WHEN json_valid(request) THEN request ELSE '{}' END";

// True if ?3 is empty, or occurs in the name, a scene or a label, or begins the id. ASCII letters
// match in both cases.
inline const std::string kHasWords =
    "(?3 = '' OR instr(lower(name), lower(?3)) > 0 OR instr(id, lower(?3)) = 1 OR "
    "EXISTS (SELECT 1 FROM json_tree(" +
    kRequestOrNone +
    ") AS t WHERE (t.fullkey GLOB '$.scene*' OR t.fullkey GLOB '$.labels*') AND "
    "t.type = 'text' AND instr(lower(t.value), lower(?3)) > 0))";

// True if ?4 is empty or a label.
inline const std::string kHasLabel = "(?4 = '' OR EXISTS (SELECT 1 FROM json_each(" +
                                     kRequestOrNone + ", '$.labels') AS l WHERE l.value = ?4))";

}  // namespace voxdag::server
