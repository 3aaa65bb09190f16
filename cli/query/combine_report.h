// The report of `voxdag combine` and `voxdag edit`, as text or as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "cli/run_times.h"
#include "query/combine/combine.h"

namespace voxdag::cli {

// Prints the report of the file `output` as text.
void print_combined(const std::string& output, const query::CombineReport& report,
                    const RunTimes& times);
nlohmann::ordered_json combined_json(const std::string& output, const query::CombineReport& report,
                                     const RunTimes& times);

}  // namespace voxdag::cli
