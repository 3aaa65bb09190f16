// Makes the texts in JSON printable, for answers that contain texts of scenes or of other programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace voxdag::server {

// Makes all texts in the JSON printable, including the names of members. Defined for nlohmann::json
// and nlohmann::ordered_json.
template <class Json>
void make_printable(Json& value);

// Returns the JSON with printable texts. The text is parsed only if it may need a change.
std::string printable_json_text(const std::string& json);

}  // namespace voxdag::server
