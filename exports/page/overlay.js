// The input mesh: a ghost or its edges over the assembly, or shaded in a picture of its own beside it.
'use strict';

const OVERLAYS = ['off', 'ghost', 'wire', 'side'];
const OVERLAY_NAMES = {off: 'input mesh', ghost: 'input: ghost', wire: 'input: edges', side: 'input: beside'};

const OVERLAY_VERTEX = `#version 300 es
in vec3 place;
uniform vec3 eye, right, upward, forward;
uniform vec2 scale;
out vec3 seen;
void main() {
  seen = place - eye;
  float away = dot(seen, forward);
  gl_Position = vec4(dot(seen, right) * scale.x, dot(seen, upward) * scale.y, away - 0.02, away);
}`;
const OVERLAY_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 colour;
uniform vec3 key, fill, vertical;
uniform bool shaded;
in vec3 seen;
out vec4 result;
void main() {
  result = colour;
  if (!shaded) return;
  vec3 n = normalize(cross(dFdx(seen), dFdy(seen)));
  if (dot(n, seen) > 0.0) n = -n;
  float light = 0.42 + 0.12 * dot(n, vertical) + 0.5 * max(dot(n, key), 0.0) + 0.1 * max(dot(n, fill), 0.0);
  result.rgb *= light;
}`;

// `build` compiles a program and finds its uniforms.
function makeOverlay(gl, build) {
  const {program, places} = build(OVERLAY_VERTEX, OVERLAY_FRAGMENT), array = gl.createVertexArray();
  let faceCount = 0, edgeCount = 0;

  const drawn = (kind, colour, shaded = false) => {
    gl.uniform4f(places.colour, ...colour);
    gl.uniform1i(places.shaded, shaded);
    const lines = kind === gl.LINES;
    gl.drawElements(kind, lines ? edgeCount : faceCount, gl.UNSIGNED_INT, lines ? 4 * faceCount : 0);
  };

  return {
    get ready() { return faceCount > 0; },

    // Positions (x, y, z of each vertex), and three vertices a face.
    set(positions, faces) {
      const edges = new Set();
      for (let i = 0; i < faces.length; i++) {
        const a = faces[i], b = faces[i % 3 === 2 ? i - 2 : i + 1];
        edges.add(Math.min(a, b) * 65536 + Math.max(a, b));
      }
      const indices = new Uint32Array([...faces, ...[...edges].flatMap(edge => [Math.floor(edge / 65536), edge % 65536])]);
      [faceCount, edgeCount] = [faces.length, 2 * edges.size];
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
      const place = gl.getAttribLocation(program, 'place');
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
      gl.bindVertexArray(null);
    },

    // Draw into the bound framebuffer's viewport, whose width is `aspect` times its height.
    draw(view, aspect, mode, dark) {
      gl.useProgram(program);
      for (const name of ['eye', 'right', 'upward', 'forward', 'key', 'fill', 'vertical']) gl.uniform3fv(places[name], view[name]);
      gl.uniform2f(places.scale, 1 / (view.slope * aspect), 1 / view.slope);
      gl.bindVertexArray(array);
      if (mode === 'side') {
        gl.enable(gl.DEPTH_TEST);
        gl.clear(gl.DEPTH_BUFFER_BIT);
        drawn(gl.TRIANGLES, [0.83, 0.80, 0.76, 1], true);
        gl.disable(gl.DEPTH_TEST);
      } else {
        const ink = dark ? [0.85, 0.9, 1] : [0.05, 0.1, 0.2];
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
        if (mode === 'ghost') drawn(gl.TRIANGLES, [...ink, 0.09]);
        else drawn(gl.LINES, [...ink, 0.3]);
        gl.disable(gl.BLEND);
      }
      gl.bindVertexArray(null);
    },
  };
}
