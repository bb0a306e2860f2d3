// Drawing with WebGL 2: coarse pictures while something moves, fine ones tile by tile once it rests.
'use strict';

const SCREEN = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
const TILE = 64, REST_MS = 160;
// While something moves, 60 pictures a second; where that would be coarse, half as many.
const SMOOTH_MS = 13, BUDGET_MS = 28, COARSE = 0.4;

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
  // Each ray keeps one bit a part: the shader is made anew once copies of parts need more words of bits.
  const wordCount = parts => Math.max(1, Math.ceil(parts / 32));
  const makeTracer = () => build(SCREEN, DATA.shader.replace(/#define WORDS \d+/, '#define WORDS ' + words));
  let words = wordCount(DATA.primitives.length), tracer = makeTracer();
  const overlay = makeOverlay(gl, build);
  const table = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, table);
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);

  const target = deep => ({
    buffer: gl.createFramebuffer(), store: gl.createRenderbuffer(), depth: deep && gl.createRenderbuffer(), width: 0, height: 0,
  });
  const resize = (made, width, height) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, made.buffer);
    if (made.width === width && made.height === height) return;
    [made.width, made.height] = [width, height];
    gl.bindRenderbuffer(gl.RENDERBUFFER, made.store);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, made.store);
    if (!made.depth) return;
    gl.bindRenderbuffer(gl.RENDERBUFFER, made.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, made.depth);
  };
  const copy = (from, left, low, width, height, to, filter) => {
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from.buffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to ? to.buffer : null);
    gl.blitFramebuffer(0, 0, from.width, from.height, left, low, left + width, low + height, gl.COLOR_BUFFER_BIT, filter);
  };
  const fine = target(), coarse = target(), probe = target(), beside = target(true);
  let scale = 0.35, moved = 0, pass = 0, tile = 0, passBegan = 0, waiting = false, shown = null, besideShown = null;
  let settings = {count: 0};
  const darkness = matchMedia('(prefers-color-scheme: dark)');

  // Size of the assembly's picture, and its lower left corner; the input's picture is to the left of it or above it.
  const pane = () => {
    const {width, height} = canvas, side = overlay.ready && camera.overlay === 'side', wide = width >= height;
    const made = {side, width: side && wide ? width >> 1 : width, height: side && !wide ? height >> 1 : height};
    return {...made, left: width - made.width, low: 0};
  };

  function useTracer(width, height, mode, samples, shadowSteps, count = settings.count) {
    const at = tracer.places, view = camera.view();
    gl.useProgram(tracer.program);
    gl.viewport(0, 0, width, height);
    gl.uniform1i(at.parts, 0);
    gl.uniform1i(at.partCount, count);
    gl.uniform1f(at.dark, darkness.matches ? 1 : 0);
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
    const whole = pane(), width = Math.max(16, Math.round(whole.width * scale)), height = Math.max(16, Math.round(whole.height * scale));
    resize(coarse, width, height);
    useTracer(width, height, 0, 1, 14);
    const begin = performance.now();
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    finish();
    const share = (scale > COARSE ? SMOOTH_MS : BUDGET_MS) / Math.max(1, performance.now() - begin);
    scale = Math.min(1, Math.max(0.1, scale * Math.min(1.3, Math.max(0.5, Math.sqrt(share)))));
    resize(fine, whole.width, whole.height);
    copy(coarse, 0, 0, whole.width, whole.height, fine, gl.LINEAR);
    [pass, tile] = [0, 0];
  }

  // One ray a pixel first, then four: but not where the first pass took long already.
  function drawTiles() {
    const {width, height} = pane(), across = Math.ceil(width / TILE), total = across * Math.ceil(height / TILE);
    const begin = performance.now();
    resize(fine, width, height);
    if (tile === 0) passBegan = begin;
    gl.enable(gl.SCISSOR_TEST);
    while (tile < total && performance.now() - begin < BUDGET_MS) {
      useTracer(width, height, 0, pass + 1, 44);
      gl.scissor(TILE * (tile % across), TILE * Math.floor(tile / across), TILE, TILE);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      finish();
      tile += 1;
    }
    gl.disable(gl.SCISSOR_TEST);
    if (tile === total) [pass, tile] = performance.now() - passBegan < 1500 ? [pass + 1, 0] : [2, 0];
  }

  // Twice as large as it is shown, so that edges are smooth.
  function drawBeside(whole) {
    const width = 2 * whole.width, height = 2 * whole.height;
    resize(beside, width, height);
    useTracer(width, height, 0, 1, 0, 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    overlay.draw(camera.view(), width / height, 'side', darkness.matches);
    besideShown = moved;
    // Of an odd number of pixels it has one more than the other.
    const low = whole.left ? 0 : whole.height;
    copy(beside, 0, low, whole.left || canvas.width, canvas.height - low, null, gl.LINEAR);
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
    const whole = pane();
    copy(fine, whole.left, whole.low, whole.width, whole.height, null, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    if (whole.side) {
      // It changes only with the view: the tiles of the other picture need not wait for it.
      if (besideShown !== moved) drawBeside(whole);
    } else if (overlay.ready && camera.overlay !== 'off') {
      overlay.draw(camera.view(), canvas.width / canvas.height, camera.overlay, darkness.matches);
    }
    if (pass < 2 || shown !== moved) later();
  }
  function later() {
    if (!waiting) requestAnimationFrame(frame);
    waiting = true;
  }

  darkness.addEventListener('change', () => { moved = performance.now(); later(); });

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
      if (words < wordCount(made.count)) {
        words = wordCount(made.count);
        gl.deleteProgram(tracer.program);
        tracer = makeTracer();
      }
      gl.bindTexture(gl.TEXTURE_2D, table);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, COLUMNS, Math.max(1, made.count), 0, gl.RGBA, gl.FLOAT, made.data);
      this.draw();
    },
    setOverlay: overlay.set,
    get aspect() { return pane().width / Math.max(1, pane().height); },
    // Row of the table that is seen at a place of the canvas (CSS pixels from its upper left), or -1.
    pick(x, y) {
      const ratio = canvas.width / canvas.clientWidth, {width, height} = pane();
      gl.bindTexture(gl.TEXTURE_2D, table);
      resize(probe, 1, 1);
      useTracer(width, height, 1, 1, 0);
      gl.viewport(0, 0, 1, 1);
      // A place of the input's picture is the same place of the assembly's.
      gl.uniform2f(tracer.places.pixel, (x * ratio) % width, (canvas.height - y * ratio) % height);
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
    // Share of the full resolution, along a side, that is drawn while something moves.
    get scale() { return scale; },
    get resting() { return pass >= 2 && shown === moved; },
  };
}
