// Makes the page show a package. Only pages that `voxdag publish` has written load this module.

import {cameraTexts} from "../camera_text.js";
import {setPublished} from "../page_source.js";

import {EmbeddedFiles} from "./embedded_files.js";
import {PackageFiles} from "./package_files.js";
import {PackageSource} from "./package_source.js";

// The URL of the folder of the package, relative to the page. The folder may be on another server.
// If the page itself contains the package, the URL is "".
const kUrl = document.querySelector("meta[name=voxdag-package]").content;

// The poster shows the view with which the page begins. If the address of the page has a camera,
// the page begins with another view, so the poster is removed.
if (cameraTexts(new URLSearchParams(location.hash.slice(1))))
  document.getElementById("poster")?.remove();

setPublished(
    () => new PackageSource(
        kUrl === "" ? new EmbeddedFiles() : new PackageFiles(new URL(kUrl, location.href).href)));
