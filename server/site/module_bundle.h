// Joins all JavaScript modules of a page into one module, so that a browser needs only one request
// to load them.
#pragma once

#include <functional>
#include <string>

namespace voxdag::server {

// Returns the source of one module that contains the module `entry` and all modules that it
// imports, directly or through others. source_of(path) returns the source of a module, such as
// "viewer/main.js". Imports must begin a line and have one of these forms:
//
//     import {a, b as c} from "./module.js";      import "./module.js";
//
// Exports must begin a line and have one of these forms:
//
//     export function f    export async function f    export class C    export const c
//     export {a, b};
//
// Leaves out indentation, and lines that only have a comment. Throws std::logic_error if modules
// import each other in a cycle, or if an import or export has another form.
std::string bundle_modules(const std::string& entry,
                           const std::function<std::string(const std::string& path)>& source_of);

}  // namespace voxdag::server
