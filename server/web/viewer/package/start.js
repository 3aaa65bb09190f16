// Starts the viewer of a package. Many web servers do not compress files, so `voxdag publish`
// writes the module of the viewer twice: compressed and plain. A page that contains its package has
// only the compressed module.

const kTooOld =
    "This browser is too old: the viewer needs DecompressionStream, which browsers have since 2023.";

function start() {
  // Without DecompressionStream, the page could decompress neither the module nor the package.
  if (!window.DecompressionStream) return showTooOld();
  const embedded = document.querySelector("script[data-module]");
  return embedded ? startEmbedded(embedded) : startFile();
}

async function startFile() {
  const names = document.querySelector("meta[name=voxdag-viewer]").content.split(" ");
  const [compressed, plain] = names.map((name) => new URL(name, location.href).href);
  const module = await permitsBlobs() ? await compressedModule(compressed) : null;
  await import(module === null ? plain : blobUrl(module));
}

// True if the page may import a module from a blob: URL. Its content security policy can forbid
// this.
async function permitsBlobs() {
  try {
    await import(blobUrl(""));
    return true;
  } catch {
    return false;
  }
}

function blobUrl(module) {
  return URL.createObjectURL(new Blob([module], {type: "text/javascript"}));
}

// Resolves to the source of the module; to null if it cannot be loaded.
async function compressedModule(url) {
  try {
    const response = await fetch(url);
    return response.ok ? await decompressed(response.body) : null;
  } catch {
    return null;
  }
}

function decompressed(stream) {
  return new Response(stream.pipeThrough(new DecompressionStream("gzip"))).text();
}

// Runs the module as an element of the page, because browsers restrict the blob: URLs of pages that
// are local files.
async function startEmbedded(embedded) {
  const bytes = Uint8Array.from(atob(embedded.textContent), (each) => each.charCodeAt(0));
  embedded.remove();  // frees the memory of the text
  const script = document.createElement("script");
  script.type = "module";
  script.textContent = await decompressed(new Blob([bytes]).stream());
  document.body.append(script);
}

function showTooOld() {
  const message = document.getElementById("message");
  message.hidden = false;
  message.textContent = kTooOld;
}

start();
