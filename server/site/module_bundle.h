// Joins the JavaScript modules of a page into one module, so that a browser needs one request for
// them.
#pragma once

#include <functional>
#include <string>

namespace voxdag::server {

// Returns one module with the module `entry` and all modules that it imports. `source_of` returns
// the source of a module by its path, such as "viewer/main.js". Modules may have imports of the
// forms
//     import {a, b as c} from "./module.js";      import "./module.js";
// at the beginning of a line, and these exports:
//     export function f    export async function f    export class C    export const c
//     export {a, b};
// Leaves out lines with only a comment, and indentation. Throws std::logic_error for modules that
// import each other, and for other forms of imports and exports.
std::string bundle_modules(const std::string& entry,
                           const std::function<std::string(const std::string& path)>& source_of);

}  // namespace voxdag::server
