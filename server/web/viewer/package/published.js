// Makes the page show the package that `voxdag publish` has written together with the page.

import {setPublished} from "../page_source.js";

import {EmbeddedFiles} from "./embedded_files.js";
import {PackageFiles} from "./package_files.js";
import {PackageSource} from "./package_source.js";

// The URL of the package's folder, relative to the page. It may be on another server. "" if the
// page contains the package.
const kUrl = document.querySelector("meta[name=voxdag-package]").content;

setPublished(
    () => new PackageSource(
        kUrl === "" ? new EmbeddedFiles() : new PackageFiles(new URL(kUrl, location.href).href)));
