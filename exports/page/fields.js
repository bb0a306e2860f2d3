// Every number of a part that can be edited.
'use strict';

// Turns about x, then y, then z of the normalised frame, in degrees, and the unit quaternion (w, x, y, z) of such.
function toAngles([w, x, y, z]) {
  const sine = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  return [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), Math.asin(sine),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ].map(angle => angle * 180 / Math.PI);
}

function toQuaternion(angles) {
  const [c, s] = [Math.cos, Math.sin].map(f => angles.map(angle => f(angle * Math.PI / 360)));
  return [
    c[0] * c[1] * c[2] + s[0] * s[1] * s[2], s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
    c[0] * s[1] * c[2] + s[0] * c[1] * s[2], c[0] * c[1] * s[2] - s[0] * s[1] * c[2],
  ];
}

// Every number of a part that can be edited: label, unit, slider range, legal range, how to read and write it.
function fields(part, index) {
  const list = [], lengths = `length (× ${Number(model.transform.scale.toPrecision(4))})`;
  for (const entry of FAMILIES[part.family].parameters) {
    const unitName = entry.unit === 'length' ? lengths : entry.unit;
    for (let k = 0; k < entry.count; k++) {
      const many = entry.count > 1;
      list.push({
        id: many ? `${entry.name}.${k}` : entry.name, group: 'Shape', hint: `${entry.description} [${unitName}]`,
        label: many ? `${entry.name} ${entry.count === 3 ? 'xyz'[k] : k + 1}` : entry.name,
        slider: entry.slider, legal: entry.legal,
        get: () => many ? part.parameters[entry.name][k] : part.parameters[entry.name],
        set: value => { if (many) part.parameters[entry.name][k] = value; else part.parameters[entry.name] = value; },
      });
    }
  }
  for (let k = 0; k < 3; k++) {
    list.push({
      id: `translation.${k}`, group: 'Position', label: 'xyz'[k], hint: `centre [${lengths}]`, slider: [-1, 1],
      legal: [null, null], get: () => part.translation[k], set: value => { part.translation[k] = value; },
    });
  }
  const angles = toAngles(part.rotation);
  for (let k = 0; k < 3; k++) {
    list.push({
      id: `rotation.${k}`, group: 'Rotation', label: 'about ' + 'xyz'[k], hint: 'turn [degrees]', slider: [-180, 180],
      legal: [-360, 360], step: 0.5, get: () => angles[k],
      set: value => { angles[k] = value; part.rotation = toQuaternion(angles); },
    });
  }
  if (index > 0) {
    list.push({
      id: 'blend', group: 'Join', label: 'blend', hint: `radius of the smooth union with the parts before it [${lengths}]`,
      slider: [0, 1], legal: [0, null], get: () => part.blend, set: value => { part.blend = value; },
    });
  }
  return list;
}
