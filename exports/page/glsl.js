// The visible parts as GLSL: `float map(vec3 p)` for any shader, and a `mainImage` that draws it on Shadertoy.
'use strict';

function decimal(value) {
  const text = Math.fround(value).toPrecision(9).replace(/(\.\d*?)0+(e|$)/, '$1$2').replace(/\.(e|$)/, '.0$1');
  return /[.e]/.test(text) ? text : text + '.0';
}
const vector = values => `vec${values.length}(${values.map(decimal).join(', ')})`;
// Names of files may hold anything; in a comment they may not end the line.
const remark = text => text.replace(/[^\x20-\x7e]|\\/g, '?');

// Rows of seven vectors in a table and one loop: a line of code for each part would take minutes to compile.
const ROW = 7;

function tableRow(part, families) {
  const shape = FAMILIES[part.family].parameters.flatMap(entry => part.parameters[entry.name]);
  while (shape.length < 8) shape.push(0);
  const [w, x, y, z] = part.rotation, {centre, radius} = sphere(part);
  const columns = [
    [...part.translation, part.blend], [x, y, z, w], shape.slice(0, 4), shape.slice(4),
    [...centre, radius], [...linear(part.color), 0], [families.indexOf(part.family), stepping(part).slack, 0, 0],
  ];
  return columns.map(vector).join(', ');
}

function assemblyGlsl() {
  const parts = model.visible(), used = FAMILY_NAMES.filter(name => parts.some(part => part.family === name));
  const rows = parts.map((part, i) => `  ${tableRow(part, used)}${i < parts.length - 1 ? ',' : ''} // ${remark(part.name)}`);
  const cases = used.map((name, i) => `  if (family == ${i}) return sdf_${name}(p, s);`);
  const steep = parts.map(stepping).some(step => step.arc > 0 || step.factor < 1);
  return `// Signed distance of an assembly in its normalised frame, negative inside. GLSL ES 3.00, highp floats.
// mesh = ${model.transform.scale} * normalised + (${model.transform.translation.join(', ')})
// On Shadertoy: paste all of this into Image; drag to orbit. Elsewhere: take what is above the line of Shadertoy.
${[...used.map(name => FAMILIES[name].glsl), COMBINE].map(text => text.trim()).join('\n')}
float family_distance(int family, vec3 p, float s[8]) {
${cases.join('\n')}
  return 1e30;
}
// A row: centre and blend; rotation (x, y, z, w), local to world; shape, twice; bounding sphere; colour; family, slack.
const int PARTS = ${parts.length};
const vec4 TABLE[${Math.max(1, ROW * parts.length)}] = vec4[](
${rows.join('\n') || '  vec4(0.0)'}
);
float part_distance(int row, vec3 p) {
  vec4 q = TABLE[row + 1], a = TABLE[row + 2], b = TABLE[row + 3];
  vec3 v = p - TABLE[row].xyz;
  v += 2.0 * cross(q.xyz, cross(q.xyz, v) - q.w * v);
  return family_distance(int(TABLE[row + 6].x), v, float[8](a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w));
}
// The smooth union of all parts in their order, and its colour.
float assembly(vec3 p, out vec3 c) {
  float d = 1e30;
  c = vec3(0.5);
  for (int i = 0; i < PARTS; i++) {
    vec4 ball = TABLE[${ROW} * i + 4];
    float blend = TABLE[${ROW} * i].w;
    // Too far away to change anything: the result is the same without it.
    if (TABLE[${ROW} * i + 6].y * (length(p - ball.xyz) - ball.w) > max(d + blend, 0.0)) continue;
    float f = part_distance(${ROW} * i, p);
    c = mix(TABLE[${ROW} * i + 5].rgb, c, combine_share(d, f, blend, 1.0));
    d = combine(d, f, blend, 1.0);
  }
  return d;
}
float map(vec3 p) { vec3 unused; return assembly(p, unused); }
${mainImage(steep)}`;
}

// A small picture of its own, from where the page's camera stands.
function mainImage(steep) {
  const {right, upward, forward, vertical, key, slope} = camera.view();
  return `
// ---- Shadertoy: a picture of map(), from where the page's camera stood ----
vec3 turned(vec3 v, vec3 axis, float angle) {
  return v * cos(angle) + cross(axis, v) * sin(angle) + axis * dot(axis, v) * (1.0 - cos(angle));
}
vec3 normal_at(vec3 p) {
  vec3 sum = vec3(0.0);
  // A loop whose end the compiler does not know, so that it makes no four copies of all parts.
  for (int i = min(iFrame, 0); i < 4; i++) {
    vec3 corner = vec3((i & 1) == 0 ? -1.0 : 1.0, (i & 2) == 0 ? -1.0 : 1.0, i == 0 || i == 3 ? 1.0 : -1.0);
    sum += corner * map(p + 5e-4 * corner);
  }
  return normalize(sum);
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
