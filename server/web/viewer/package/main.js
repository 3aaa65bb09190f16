// The page of `voxdag publish`.

import "./published.js";
import "../main.js";
