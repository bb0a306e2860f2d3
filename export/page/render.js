// Drawing with WebGL 2: coarse pictures while something moves, fine ones tile by tile once it rests.
'use strict';

const SCREEN = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
const OVERLAY_VERTEX = `#version 300 es
in vec3 place;
uniform vec3 eye, right, upward, forward;
uniform vec2 scale;
void main() {
  vec3 v = place - eye;
  gl_Position = vec4(dot(v, right) * scale.x, dot(v, upward) * scale.y, 0.0, dot(v, forward));
}`;
const OVERLAY_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 colour;
out vec4 result;
void main() { result = colour; }`;
const TILE = 64, BUDGET_MS = 28, REST_MS = 160;

function makeRenderer(canvas, camera) {
  const gl = canvas.getContext('webgl2', {antialias: false, preserveDrawingBuffer: true, alpha: false});
  if (!gl) return null;
  const build = (vertex, fragment) => {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(program).map(shader => gl.getShaderInfoLog(shader));
      throw new Error('the shader was refused: ' + logs.join(' ') + gl.getProgramInfoLog(program));
    }
    const places = {};
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; i++) {
      const name = gl.getActiveUniform(program, i).name;
      places[name] = gl.getUniformLocation(program, name);
    }
    return {program, places};
  };
  const tracer = build(SCREEN, DATA.shader), overlay = build(OVERLAY_VERTEX, OVERLAY_FRAGMENT);
  const table = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, table);
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);

  const target = () => ({buffer: gl.createFramebuffer(), store: gl.createRenderbuffer(), width: 0, height: 0});
  const resize = (made, width, height) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, made.buffer);
    if (made.width === width && made.height === height) return;
    [made.width, made.height] = [width, height];
    gl.bindRenderbuffer(gl.RENDERBUFFER, made.store);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, made.store);
  };
  const copy = (from, width, height, to, filter) => {
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from.buffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to ? to.buffer : null);
    gl.blitFramebuffer(0, 0, from.width, from.height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, filter);
  };
  const fine = target(), coarse = target(), probe = target();
  let scale = 0.35, moved = 0, pass = 0, tile = 0, passBegan = 0, waiting = false, shown = null, lines = null;
  let settings = {count: 0};

  function useTracer(width, height, mode, samples, shadowSteps) {
    const at = tracer.places, view = camera.view();
    gl.useProgram(tracer.program);
    gl.viewport(0, 0, width, height);
    gl.uniform1i(at.parts, 0);
    gl.uniform1i(at.partCount, settings.count);
    for (const name of ['eye', 'right', 'upward', 'forward', 'key', 'fill', 'rim', 'vertical']) gl.uniform3fv(at[name], view[name]);
    gl.uniform1f(at.slope, view.slope);
    gl.uniform2f(at.resolution, width, height);
    gl.uniform1i(at.mode, mode);
    gl.uniform1i(at.samples, samples);
    gl.uniform1i(at.shadowSteps, shadowSteps);
    gl.uniform4fv(at.ground, camera.ground);
  }
  // Reading a pixel is what makes the browser wait for the drawing, so that time can be measured.
  const finish = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));

  function drawCoarse() {
    const width = Math.max(16, Math.round(canvas.width * scale)), height = Math.max(16, Math.round(canvas.height * scale));
    resize(coarse, width, height);
    useTracer(width, height, 0, 1, 14);
    const begin = performance.now();
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    finish();
    const share = BUDGET_MS / Math.max(1, performance.now() - begin);
    scale = Math.min(1, Math.max(0.1, scale * Math.min(1.3, Math.max(0.5, Math.sqrt(share)))));
    resize(fine, canvas.width, canvas.height);
    copy(coarse, canvas.width, canvas.height, fine, gl.LINEAR);
    [pass, tile] = [0, 0];
  }

  // One ray a pixel first, then four: but not where the first pass took long already.
  function drawTiles() {
    const across = Math.ceil(canvas.width / TILE), total = across * Math.ceil(canvas.height / TILE);
    const begin = performance.now();
    resize(fine, canvas.width, canvas.height);
    if (tile === 0) passBegan = begin;
    gl.enable(gl.SCISSOR_TEST);
    while (tile < total && performance.now() - begin < BUDGET_MS) {
      useTracer(canvas.width, canvas.height, 0, pass + 1, 44);
      gl.scissor(TILE * (tile % across), TILE * Math.floor(tile / across), TILE, TILE);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      finish();
      tile += 1;
    }
    gl.disable(gl.SCISSOR_TEST);
    if (tile === total) [pass, tile] = performance.now() - passBegan < 1500 ? [pass + 1, 0] : [2, 0];
  }

  function drawOverlay() {
    if (!lines || !camera.overlay) return;
    const at = overlay.places, view = camera.view(), aspect = canvas.width / canvas.height;
    gl.useProgram(overlay.program);
    for (const name of ['eye', 'right', 'upward', 'forward']) gl.uniform3fv(at[name], view[name]);
    gl.uniform2f(at.scale, 1 / (view.slope * aspect), 1 / view.slope);
    gl.bindVertexArray(lines.array);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.uniform4f(at.colour, 0.10, 0.18, 0.30, 0.05);
    gl.drawElements(gl.TRIANGLES, lines.faceCount, gl.UNSIGNED_INT, 0);
    gl.uniform4f(at.colour, 0.05, 0.10, 0.20, 0.17);
    gl.drawElements(gl.LINES, lines.edgeCount, gl.UNSIGNED_INT, 4 * lines.faceCount);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
  }

  function frame() {
    waiting = false;
    if (!canvas.width || !canvas.height) return;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, table);
    const resting = performance.now() - moved > REST_MS;
    if (shown !== moved) {
      shown = moved;
      drawCoarse();
    } else if (resting && pass < 2) drawTiles();
    copy(fine, canvas.width, canvas.height, null, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    drawOverlay();
    if (pass < 2 || shown !== moved) later();
  }
  function later() {
    if (!waiting) requestAnimationFrame(frame);
    waiting = true;
  }

  return {
    // Draw again, coarse at first.
    draw() {
      moved = performance.now();
      later();
    },
    fit() {
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      canvas.width = Math.round(canvas.clientWidth * ratio);
      canvas.height = Math.round(canvas.clientHeight * ratio);
      this.draw();
    },
    setParts(made) {
      settings = made;
      gl.bindTexture(gl.TEXTURE_2D, table);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, COLUMNS, Math.max(1, made.count), 0, gl.RGBA, gl.FLOAT, made.data);
      this.draw();
    },
    setOverlay(places, faces) {
      const edges = new Set();
      for (let i = 0; i < faces.length; i += 3) {
        for (let k = 0; k < 3; k++) {
          const a = faces[i + k], b = faces[i + (k + 1) % 3];
          edges.add(Math.min(a, b) * 65536 + Math.max(a, b));
        }
      }
      const indices = new Uint32Array([...faces, ...[...edges].flatMap(edge => [Math.floor(edge / 65536), edge % 65536])]);
      lines = {array: gl.createVertexArray(), faceCount: faces.length, edgeCount: 2 * edges.size};
      gl.bindVertexArray(lines.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
      const place = gl.getAttribLocation(overlay.program, 'place');
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
      gl.bindVertexArray(null);
    },
    // Row of the table that is seen at a place of the canvas (CSS pixels from its upper left), or -1.
    pick(x, y) {
      const ratio = canvas.width / canvas.clientWidth;
      gl.bindTexture(gl.TEXTURE_2D, table);
      resize(probe, 1, 1);
      useTracer(canvas.width, canvas.height, 1, 1, 0);
      gl.viewport(0, 0, 1, 1);
      gl.uniform2f(tracer.places.pixel, x * ratio, canvas.height - y * ratio);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      const read = new Uint8Array(4);
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, read);
      return read[0] + 256 * read[1] - 1;
    },
    // The same for all pixels of a picture of this size, upper row first.
    pickAll(width, height) {
      gl.bindTexture(gl.TEXTURE_2D, table);
      resize(probe, width, height);
      useTracer(width, height, 2, 1, 0);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      const read = new Uint8Array(4 * width * height), rows = [];
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, read);
      for (let y = height - 1; y >= 0; y--) {
        for (let x = 0; x < width; x++) rows.push(read[4 * (y * width + x)] + 256 * read[4 * (y * width + x) + 1] - 1);
      }
      return rows;
    },
    get resting() { return pass >= 2 && shown === moved; },
  };
}
