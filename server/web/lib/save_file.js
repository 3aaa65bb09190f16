// Saves a file of the API on the disk of the user.

import {request, token} from "./api.js";
import {h} from "./dom.js";
import {sizeText} from "./format.js";

const kMaxInMemoryBytes = 2 ** 30;

// Saves the file {href, name, bytes}. Without a token, the browser downloads the link itself and
// can resume the download. A link cannot carry a token. So with a token, the bytes are streamed to
// a file if the browser supports this; otherwise they are held in memory.
export async function saveFile({href, name, bytes}) {
  if (!token.get()) return clickLink(href, name);
  if (window.showSaveFilePicker) {
    const handle = await window.showSaveFilePicker({suggestedName: name}).catch(() => null);
    if (!handle) return;
    const response = await request("GET", href);
    await response.body.pipeTo(await handle.createWritable());
    return;
  }
  if (bytes > kMaxInMemoryBytes)
    throw {
      code: "too_large",
      detail: `This browser cannot save ${
          sizeText(bytes)} with a token: use the command \`voxdag download\`.`
    };
  const url = URL.createObjectURL(await (await request("GET", href)).blob());
  clickLink(url, name);
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}

function clickLink(href, name) {
  const link = h("a", {href, download: name});
  document.body.append(link);
  link.click();
  link.remove();
}
