// Helpers for WebGL2: programs with uniforms that are set by name, and render targets.

import {kQuad} from "./picture_shaders.js";

export class WebGLUnavailable extends Error {}

// Returns the WebGL2 context of a canvas; null if the browser cannot create one.
export function createContext(canvas) {
  return canvas.getContext("webgl2", {
    alpha: false,
    antialias: false,
    depth: false,
    powerPreference: "high-performance",
    preserveDrawingBuffer: true
  });
}

export class Program {
  // Compilation runs in the background until finish().
  constructor(gl, name, fragment) {
    this.gl = gl;
    this.name = name;
    this.program = gl.createProgram();
    this.shaders =
        [[gl.VERTEX_SHADER, kQuad], [gl.FRAGMENT_SHADER, fragment]].map(([kind, text]) => {
          const shader = gl.createShader(kind);
          gl.shaderSource(shader, text);
          gl.compileShader(shader);
          gl.attachShader(this.program, shader);
          return shader;
        });
    gl.linkProgram(this.program);
    this.uniforms = null;
  }

  // True if the compilation has finished, or if the browser cannot report whether it has.
  // `parallel` is the extension KHR_parallel_shader_compile; null if the browser lacks it.
  done(parallel) {
    return !parallel || this.gl.getProgramParameter(this.program, parallel.COMPLETION_STATUS_KHR);
  }

  finish() {
    const {gl} = this;
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) {
      const logs = this.shaders.map((shader) => gl.getShaderInfoLog(shader) || "").join("\n");
      throw new WebGLUnavailable(
          `The shader "${this.name}" does not compile: ` +
          `${gl.getProgramInfoLog(this.program) || ""}\n${logs}`);
    }
    for (const shader of this.shaders) gl.deleteShader(shader);
    this.uniforms = new Map();
    let unit = 0;
    gl.useProgram(this.program);
    for (let i = 0; i < gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS); ++i) {
      const {name, type} = gl.getActiveUniform(this.program, i);
      const location = gl.getUniformLocation(this.program, name);
      const sampler = type === gl.SAMPLER_2D || type === gl.UNSIGNED_INT_SAMPLER_2D;
      const entry = {location, type, unit: sampler ? unit++ : -1};
      if (sampler) gl.uniform1i(location, entry.unit);
      this.uniforms.set(name, entry);
    }
  }

  // Draws one pixel to a target of these formats, because most drivers finish a compilation only at
  // the first draw. The textures `words` and `floats` are placeholders.
  warmUp(formats, words, floats) {
    const {gl} = this, target = new Target(gl, 1, 1, formats);
    gl.useProgram(this.program);
    for (const {type, unit} of this.uniforms.values()) {
      if (unit < 0) continue;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, type === gl.SAMPLER_2D ? floats : words);
    }
    gl.activeTexture(gl.TEXTURE0);
    gl.viewport(0, 0, 1, 1);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    target.dispose();
  }

  dispose() {
    this.gl.deleteProgram(this.program);
  }

  // Sets the uniforms of the program, and draws the complete viewport or some of its rows. If
  // `target` is null, draws to the canvas.
  draw(target, values, width, height, {row = 0, rows = height} = {}) {
    const {gl} = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target ? target.framebuffer : null);
    gl.viewport(0, 0, width, height);
    gl.useProgram(this.program);
    for (const [name, {location, type, unit}] of this.uniforms) {
      const value = values[name];
      if (value === undefined)
        throw new Error(`The uniform ${name} of "${this.name}" has no value.`);
      if (unit >= 0) {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, value);
      } else {
        setUniform(gl, location, type, value);
      }
    }
    gl.activeTexture(gl.TEXTURE0);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, row, width, rows);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.SCISSOR_TEST);
  }
}

function setUniform(gl, location, type, value) {
  switch (type) {
    case gl.FLOAT:
      return gl.uniform1f(location, value);
    case gl.FLOAT_VEC2:
      return gl.uniform2f(location, ...value);
    case gl.FLOAT_VEC3:
      return gl.uniform3f(location, ...value);
    case gl.INT:
    case gl.BOOL:
      return gl.uniform1i(location, value);
    case gl.INT_VEC2:
      return gl.uniform2i(location, ...value);
    case gl.INT_VEC3:
      return gl.uniform3i(location, ...value);
    case gl.UNSIGNED_INT:
      return gl.uniform1ui(location, value);
    default:
      throw new Error(`a uniform has the type ${type}`);
  }
}

const kTexelBytes = {
  RGBA32UI: 16,
  RGBA16F: 8,
  RGBA8: 4,
  R32UI: 4,
  R8: 1
};

// A framebuffer with one texture for each of these formats, such as "RGBA32UI".
export class Target {
  constructor(gl, width, height, formats) {
    this.gl = gl;
    this.width = width;
    this.height = height;
    this.bytes = width * height * formats.reduce((sum, format) => sum + kTexelBytes[format], 0);
    this.framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    this.textures = formats.map((format, i) => {
      const texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      const filter = format === "RGBA16F" || format === "RGBA8" ? gl.LINEAR : gl.NEAREST;
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl[format], width, height);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0);
      return texture;
    });
    gl.drawBuffers(formats.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
  }

  dispose() {
    this.gl.deleteFramebuffer(this.framebuffer);
    for (const texture of this.textures) this.gl.deleteTexture(texture);
  }
}

// Resolves to true when the GPU has finished all commands. Resolves to false if `isOver()` becomes
// true first.
export async function gpuDone(gl, isOver) {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  while (!isOver() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) await pause();
  if (isOver()) return false;
  gl.deleteSync(fence);
  return true;
}

export function pause() {
  return new Promise((resolve) => setTimeout(resolve, 4));
}

// Reads the pixels in the lower left corner of an integer target. Does not wait for the GPU.
export class AsyncReading {
  constructor(gl, target, width, height) {
    this.gl = gl;
    this.length = width * height * 4;
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, this.length * 4, gl.STREAM_READ);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.readPixels(0, 0, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  get ready() {
    return this.gl.getSyncParameter(this.fence, this.gl.SYNC_STATUS) === this.gl.SIGNALED;
  }

  take() {
    const {gl} = this, words = new Uint32Array(this.length);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, words);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.deleteBuffer(this.buffer);
    gl.deleteSync(this.fence);
    return words;
  }
}
