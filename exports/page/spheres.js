// What the tracer's table holds for each visible part: its numbers, a bounding sphere, and how far it can be felt.
'use strict';

const COLUMNS = 8;

function rotate(q, v) {
  const [w, x, y, z] = q;
  const a = [y * v[2] - z * v[1] + w * v[0], z * v[0] - x * v[2] + w * v[1], x * v[1] - y * v[0] + w * v[2]];
  return [v[0] + 2 * (y * a[2] - z * a[1]), v[1] + 2 * (z * a[0] - x * a[2]), v[2] + 2 * (x * a[1] - y * a[0])];
}

function sphere(part) {
  const [low, high] = GEOMETRY[part.family].bounds(part.parameters);
  const middle = rotate(part.rotation, low.map((value, axis) => 0.5 * (value + high[axis])));
  return {
    centre: middle.map((value, axis) => value + part.translation[axis]),
    radius: 0.5 * Math.hypot(...high.map((value, axis) => value - low[axis])) * 1.001 + 1e-5,
  };
}

// How far a ray may step: `factor` of the field's value, and by the distance to the line around which the field is bent
// along an arc (see trace.glsl). A field may be less than the distance by `slack`: by 1 / sqrt(2) beside mitred corners,
// and more so beside a bend.
function stepping(part) {
  const {stepping} = GEOMETRY[part.family];
  return {arc: 0, centre: 0, sign: 0, factor: 1, slack: 0.7, ...stepping ? stepping(part.parameters) : {}};
}

// How far from its sphere each part can still be felt where the union is zero.
//
// Say a part's distance is f, so that with it or without it the fold stands at L = f - 5/4 of its blend or more. A later
// part whose share is 1 - h lowers the fold by blend * (1 - h)^2, and passes on h of any difference. To come down from
// L to zero by blends of at most K, the difference is multiplied by exp(-2.45 L / K) at best: 2.45 is the least of
// -ln(h) / (1 - h)^2. At L = 3 K less than 3e-4 K is left in all, far below what a ray resolves; and at L = 5/4 of
// all later blends nothing is. Blends of parts that are nowhere near do not count.
function margins(parts, spheres, slacks) {
  const blends = parts.map((part, i) => i ? part.blend : 0), feel = [];
  for (let i = parts.length - 1, sum = 0, most = 0; i >= 0; i--) {
    sum += blends[i];
    most = Math.max(most, blends[i]);
    feel[i] = Math.min(1.25 * sum, 1.25 * blends[i] + 3 * most);
  }
  for (let round = 0; round < 2; round++) {
    for (let i = 0; i < parts.length; i++) {
      let sum = blends[i], most = 0;
      for (let j = i + 1; j < parts.length; j++) {
        const gap = Math.hypot(...spheres[i].centre.map((value, axis) => value - spheres[j].centre[axis]));
        const reach = feel[i] / slacks[i] + (feel[i] + blends[j]) / slacks[j];
        if (gap - spheres[i].radius - spheres[j].radius > reach) continue;
        sum += blends[j];
        most = Math.max(most, blends[j]);
      }
      feel[i] = Math.min(feel[i], 1.25 * sum, 1.25 * blends[i] + 3 * most);
    }
  }
  return feel.map((value, i) => value / slacks[i] + 1e-4);
}

function linear(hex) {
  return [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16) / 255)
    .map(value => value <= 0.04045 ? value / 12.92 : Math.pow((value + 0.055) / 1.055, 2.4));
}

// The table of the visible parts. `explode` moves parts away from their common middle, and parts what joins them.
function partTable(parts, selected, explode) {
  const middle = [0, 1, 2].map(axis => parts.reduce((sum, part) => sum + part.translation[axis], 0) / (parts.length || 1));
  const placed = parts.map(part => ({
    ...part,
    translation: part.translation.map((value, axis) => value + explode * (value - middle[axis])),
    blend: part.blend * Math.max(0, 1 - 4 * explode),
  }));
  const spheres = placed.map(sphere), steps = placed.map(stepping);
  const feel = margins(placed, spheres, steps.map(step => step.slack));
  const data = new Float32Array(4 * COLUMNS * Math.max(1, placed.length));
  placed.forEach((part, i) => {
    const shape = FAMILIES[part.family].parameters.flatMap(entry => part.parameters[entry.name]);
    const [w, x, y, z] = part.rotation, step = steps[i];
    data.set([
      ...part.translation, part.blend, x, y, z, w, ...shape, ...new Array(8 - shape.length).fill(0),
      ...spheres[i].centre, spheres[i].radius, FAMILY_NAMES.indexOf(part.family), step.arc, step.centre, step.factor,
      ...linear(part.color), step.sign, feel[i], step.slack, parts[i] === selected ? 1 : 0, 0,
    ], 4 * COLUMNS * i);
  });
  return {data, count: placed.length, spheres};
}
