"""What evaluates the GLSL text of a family in a page, and how numbers get there."""

from __future__ import annotations

import base64

import numpy as np

EVALUATE = """
([source, name, shapes, points, shapeCount, pointCount]) => {
  const floats = text => new Float32Array(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
  const canvas = document.createElement('canvas');
  const gl = canvas.getContext('webgl2');
  if (!gl || !gl.getExtension('EXT_color_buffer_float')) return {error: 'no WebGL 2 with float targets'};
  const vertex = `#version 300 es
    void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
  const fragment = `#version 300 es
    precision highp float;
    precision highp sampler2D;
    uniform sampler2D shapes, points;
    out vec4 colour;
    ${source}
    void main() {
      ivec2 at = ivec2(gl_FragCoord.xy);
      vec4 a = texelFetch(shapes, ivec2(0, at.y), 0), b = texelFetch(shapes, ivec2(1, at.y), 0);
      float s[8] = float[8](a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w);
      colour = vec4(sdf_${name}(texelFetch(points, at, 0).xyz, s), 0.0, 0.0, 1.0);
    }`;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) return {error: gl.getShaderInfoLog(shader)};
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return {error: gl.getProgramInfoLog(program)};
  gl.useProgram(program);
  const texture = (unit, width, height, data) => {
    const made = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, data);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return made;
  };
  const target = texture(2, pointCount, shapeCount, null);
  texture(0, 2, shapeCount, floats(shapes));
  texture(1, pointCount, shapeCount, floats(points));
  gl.uniform1i(gl.getUniformLocation(program, 'shapes'), 0);
  gl.uniform1i(gl.getUniformLocation(program, 'points'), 1);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  gl.viewport(0, 0, pointCount, shapeCount);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const read = new Float32Array(4 * pointCount * shapeCount);
  gl.readPixels(0, 0, pointCount, shapeCount, gl.RGBA, gl.FLOAT, read);
  // Infinities and NaN are no JSON: they come back as null.
  return {values: Array.from(read.filter((_, i) => i % 4 == 0)), code: gl.getError()};
}
"""


def encoded(values: np.ndarray) -> str:
    """Float32 values as text that a page can read."""
    return base64.b64encode(np.ascontiguousarray(values, np.float32).tobytes()).decode()
