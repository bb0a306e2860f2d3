// The assembly that is edited: its state, undo and redo, and what it becomes as text.
'use strict';

const DATA = JSON.parse(document.getElementById('data').textContent);
const FAMILIES = DATA.families;
const FAMILY_NAMES = Object.keys(FAMILIES);

const model = {
  transform: DATA.transform,
  primitives: DATA.primitives,
  selected: -1,
  hidden: new Set(),
  explode: 0,
  past: [],
  future: [],
  saved: JSON.stringify(DATA.primitives),

  visible() { return this.primitives.filter((_, i) => !this.hidden.has(i)); },

  // Call once an edit is complete: it becomes one step of undo.
  commit() {
    const now = JSON.stringify(this.primitives);
    if (now === this.saved) return;
    this.past.push(this.saved);
    this.future = [];
    this.saved = now;
  },

  step(from, to) {
    if (!from.length) return;
    to.push(this.saved);
    this.saved = from.pop();
    this.primitives = JSON.parse(this.saved);
  },

  undo() { this.commit(); this.step(this.past, this.future); },
  redo() { this.commit(); this.step(this.future, this.past); },
};

// JSON with the spaces that assembly.json has; whole numbers of lengths and ratios are written as 1.0.
function spaced(value) {
  if (Array.isArray(value)) return '[' + value.map(spaced).join(', ') + ']';
  if (value && typeof value === 'object') {
    return '{' + Object.entries(value).map(([key, inner]) => JSON.stringify(key) + ': ' + spaced(inner)).join(', ') + '}';
  }
  if (typeof value === 'number' && Number.isInteger(value) && Math.abs(value) < 1e16) return value.toFixed(1);
  return JSON.stringify(value);
}

function assemblyJson() {
  const lines = model.primitives.map(spaced).join(',\n    ');
  return '{\n' + [
    '  "format": ' + JSON.stringify(DATA.format),
    '  "version": ' + DATA.version,
    '  "transform": ' + spaced(model.transform),
    '  "primitives": ' + (lines ? '[\n    ' + lines + '\n  ]' : '[]'),
    // Kept as the text it was: whole numbers there may have more digits than JavaScript keeps.
    '  "provenance": ' + DATA.provenance,
  ].join(',\n') + '\n}\n';
}

function decimal(value) {
  const text = Math.fround(value).toPrecision(9).replace(/(\.\d*?)0+(e|$)/, '$1$2').replace(/\.(e|$)/, '.0$1');
  return /[.e]/.test(text) ? text : text + '.0';
}

// A stand-alone GLSL function `float map(vec3 p)` of the visible parts, in the normalised frame.
function assemblyGlsl() {
  const parts = model.visible();
  const used = FAMILY_NAMES.filter(name => parts.some(part => part.family === name));
  const lines = parts.map((part, i) => {
    const shape = FAMILIES[part.family].parameters.flatMap(entry => part.parameters[entry.name]);
    while (shape.length < 8) shape.push(0);
    const [w, x, y, z] = part.rotation;
    const local = `to_part(p - vec3(${part.translation.map(decimal).join(', ')}), vec4(${[x, y, z, w].map(decimal).join(', ')}))`;
    const call = `sdf_${part.family}(${local},\n    float[8](${shape.map(decimal).join(', ')}))`;
    return i ? `  d = smooth_minimum(d, ${call}, ${decimal(part.blend)});` : `  float d = ${call};`;
  });
  return `// Signed distance of an assembly in its normalised frame, negative inside.
// mesh = ${model.transform.scale} * normalised + (${model.transform.translation.join(', ')})
// GLSL ES 3.00, highp floats.
${used.map(name => FAMILIES[name].glsl.trim()).join('\n')}
vec3 to_part(vec3 v, vec4 q) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) - q.w * v); }
float smooth_minimum(float a, float b, float blend) {
  float near = max(blend - abs(a - b), 0.0);
  return min(a, b) - near * near * 0.25 / max(blend, 1e-12);
}
float map(vec3 p) {
${lines.join('\n') || '  float d = 1e30;'}
  return d;
}
`;
}
