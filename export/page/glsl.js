// The visible parts as GLSL: `float map(vec3 p)` for any shader, and a `mainImage` that draws it on Shadertoy.
'use strict';

function decimal(value) {
  const text = Math.fround(value).toPrecision(9).replace(/(\.\d*?)0+(e|$)/, '$1$2').replace(/\.(e|$)/, '.0$1');
  return /[.e]/.test(text) ? text : text + '.0';
}
const vector = values => `vec${values.length}(${values.map(decimal).join(', ')})`;
// Names of files may hold anything; in a comment they may not end the line.
const remark = text => text.replace(/[^\x20-\x7e]|\\/g, '?');

// One line a part. Those too far away to matter are skipped: a sphere tells, and the result is the same.
function joinLine(part, sphere, slack) {
  const shape = FAMILIES[part.family].parameters.flatMap(entry => part.parameters[entry.name]);
  while (shape.length < 8) shape.push(0);
  const [w, x, y, z] = part.rotation;
  return `  if (near(p, ${vector([...sphere.centre, sphere.radius])}, ${decimal(slack)}, d, ${decimal(part.blend)})) // ${remark(part.name)}
    join(d, c, sdf_${part.family}(to_part(p - ${vector(part.translation)}, ${vector([x, y, z, w])}),
      float[8](${shape.map(decimal).join(', ')})), ${vector(linear(part.color))}, ${decimal(part.blend)});`;
}

function assemblyGlsl() {
  const parts = model.visible(), used = FAMILY_NAMES.filter(name => parts.some(part => part.family === name));
  const steps = parts.map(stepping);
  const lines = parts.map((part, i) => joinLine(part, sphere(part), steps[i].slack));
  return `// Signed distance of an assembly in its normalised frame, negative inside. GLSL ES 3.00, highp floats.
// mesh = ${model.transform.scale} * normalised + (${model.transform.translation.join(', ')})
// On Shadertoy: paste all of this into Image; drag to orbit. Elsewhere: take all above mainImage and call map(p).
${used.map(name => FAMILIES[name].glsl.trim()).join('\n')}
vec3 to_part(vec3 v, vec4 q) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) - q.w * v); }
// Whether a part in a sphere can change the union, which is d so far.
bool near(vec3 p, vec4 ball, float slack, float d, float blend) {
  return slack * (length(p - ball.xyz) - ball.w) <= max(d + blend, 0.0);
}
// Smooth union of d with a part at distance f, and its colour.
void join(inout float d, inout vec3 c, float f, vec3 colour, float blend) {
  c = mix(colour, c, clamp(0.5 + (f - d) * 0.5 / max(blend, 1e-12), 0.0, 1.0));
  float close = max(blend - abs(d - f), 0.0);
  d = min(d, f) - close * close * 0.25 / max(blend, 1e-12);
}
float assembly(vec3 p, out vec3 c) {
  float d = 1e30;
  c = vec3(0.5);
${lines.join('\n')}
  return d;
}
float map(vec3 p) { vec3 unused; return assembly(p, unused); }
${mainImage(steps.some(step => step.arc > 0 || step.factor < 1))}`;
}

// A small picture of its own, from where the page's camera stands.
function mainImage(steep) {
  const {right, upward, forward, vertical, key, slope} = camera.view();
  return `
vec3 turned(vec3 v, vec3 axis, float angle) {
  return v * cos(angle) + cross(axis, v) * sin(angle) + axis * dot(axis, v) * (1.0 - cos(angle));
}
vec3 normal_at(vec3 p) {
  vec2 e = vec2(1.0, -1.0) * 5e-4;
  return normalize(e.xyy * map(p + e.xyy) + e.yyx * map(p + e.yyx) + e.yxy * map(p + e.yxy) + e.xxx * map(p + e.xxx));
}
float shadow_at(vec3 p, vec3 towards) {
  float light = 1.0, t = 0.01;
  for (int i = 0; i < 32 && t < 3.0 && light > 0.0; i++) {
    float d = map(p + t * towards);
    light = min(light, 7.0 * d / t);
    t += clamp(d, 0.02, 0.3);
  }
  return smoothstep(0.0, 1.0, light);
}
void mainImage(out vec4 colour, in vec2 at) {
  vec3 target = ${vector(camera.target)}, vertical = ${vector(vertical)}, right = ${vector(right)};
  vec2 turn = iMouse.xy == vec2(0.0) ? vec2(0.0) : vec2(6.28, 1.5) * (0.5 - iMouse.xy / iResolution.xy);
  vec2 xy = (2.0 * at - iResolution.xy) / iResolution.y * ${decimal(slope)};
  vec3 look = turned(${vector(forward)}, right, turn.y), lift = turned(${vector(upward)}, right, turn.y);
  vec3 ray = turned(normalize(look + xy.x * right + xy.y * lift), vertical, turn.x);
  vec3 eye = target - ${decimal(camera.distance)} * turned(look, vertical, turn.x), light = turned(${vector(key)}, vertical, turn.x);
  colour = vec4(vec3(0.86, 0.87, 0.89) - 0.12 * length(at / iResolution.xy - 0.5), 1.0);
  // ${steep ? 'Bent parts are steeper than a distance here and there: short steps, taken back where they went inside.'
    : 'A distance nearly everywhere.'}
  float t = 0.0, before = 0.0;
  for (int i = 0; i < 160 && t < ${decimal(camera.distance + 4)}; i++) {
    float d = map(eye + t * ray);
    if (d < 4e-4 * t) {
      for (int k = 0; k < 8 && d < -4e-4 * t; k++) {
        float middle = 0.5 * (before + t);
        if (map(eye + middle * ray) < 0.0) t = middle; else before = middle;
      }
      vec3 p = eye + t * ray, n = normal_at(p), paint;
      assembly(p, paint);
      float open = clamp(0.4 + 4.0 * map(p + 0.15 * n), 0.0, 1.0), facing = max(dot(n, light), 0.0);
      float sun = facing > 0.0 ? facing * shadow_at(p + 0.004 * n, light) : 0.0;
      vec3 lit = paint * (1.15 * sun + (0.35 + 0.2 * dot(n, vertical)) * open);
      colour.rgb = pow(lit / (1.0 + 0.2 * lit), vec3(1.0 / 2.2));
      return;
    }
    before = t;
    t += ${steep ? '0.6' : '0.95'} * d;
  }
}
`;
}
