// SQL conditions for the search for jobs (JobFilter). They apply to a row of the table `job` of
// job_queue.cc. If the JSON text in the column `request` is damaged, the job is searched as if it
// had no scenes and no labels.
#pragma once

#include <string>

namespace voxdag::server {

inline const std::string kRequestOrNone =
    "CASE WHEN json_valid(request) THEN request ELSE '{}' END";

// True if the parameter ?3 is empty, or is contained in the name, a scene or a label, or is the
// beginning of the id. Case does not matter for ASCII letters; ids have only lowercase letters.
inline const std::string kHasWords =
    "(?3 = '' OR instr(lower(name), lower(?3)) > 0 OR instr(id, lower(?3)) = 1 OR "
    "EXISTS (SELECT 1 FROM json_tree(" +
    kRequestOrNone +
    ") AS t WHERE (t.fullkey GLOB '$.scene*' OR t.fullkey GLOB '$.labels*') AND "
    "t.type = 'text' AND instr(lower(t.value), lower(?3)) > 0))";

// True if the parameter ?4 is empty or equals a label of the job.
inline const std::string kHasLabel = "(?4 = '' OR EXISTS (SELECT 1 FROM json_each(" +
                                     kRequestOrNone + ", '$.labels') AS l WHERE l.value = ?4))";

}  // namespace voxdag::server
