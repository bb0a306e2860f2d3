// The panel: parts, sliders of the selected one, buttons. All that comes from the file is set as text.
'use strict';

const byId = id => document.getElementById(id);

function make(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

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

function fieldRow(field, edited, committed) {
  const step = field.step || 0.001, shown = value => String(Number(value.toFixed(4)));
  const slider = make('input', {type: 'range', min: field.slider[0], max: field.slider[1], step: step, title: field.hint});
  const number = make('input', {type: 'number', step: 'any', title: field.hint});
  const [low, high] = field.legal;
  if (low !== null) number.min = low;
  if (high !== null) number.max = high;
  slider.dataset.field = field.id;
  slider.value = field.get();
  number.value = shown(field.get());
  slider.setAttribute('aria-label', field.label);
  number.setAttribute('aria-label', field.label);
  slider.addEventListener('input', () => {
    field.set(Number(slider.value));
    number.value = shown(field.get());
    edited();
  });
  number.addEventListener('change', () => {
    const value = Number(number.value);
    if (number.value !== '' && Number.isFinite(value)) {
      field.set(Math.max(low ?? -1e3, Math.min(high ?? 1e3, value)));
      slider.value = field.get();
    }
    number.value = shown(field.get());
    edited();
    committed();
  });
  slider.addEventListener('change', committed);
  return make('label', {className: 'field', title: field.hint}, make('span', {textContent: field.label}), slider, number);
}

const panel = {
  showParts(chosen, hide, isolate) {
    byId('parts').replaceChildren(...model.primitives.map((part, index) => {
      const hidden = model.hidden.has(index);
      const dot = make('i', {className: 'dot'});
      dot.style.background = part.color;
      const name = make('button', {className: 'name', type: 'button'}, dot, make('span', {textContent: part.name}));
      name.addEventListener('click', () => chosen(index));
      const eye = make('button', {type: 'button', className: 'small', textContent: hidden ? 'show' : 'hide'});
      eye.addEventListener('click', () => hide(index));
      const only = make('button', {type: 'button', className: 'small', textContent: 'only', title: 'hide all others; again: show all'});
      only.addEventListener('click', () => isolate(index));
      const row = make('li', {}, name, eye, only);
      row.classList.toggle('hidden', hidden);
      row.classList.toggle('selected', index === model.selected);
      return row;
    }));
    byId('parts').querySelector('.selected')?.scrollIntoView({block: 'nearest'});
    byId('undo').disabled = !model.past.length;
    byId('redo').disabled = !model.future.length;
  },

  showFields(edited, committed) {
    const part = model.primitives[model.selected], box = byId('fields');
    byId('hint').hidden = Boolean(part);
    if (!part) return box.replaceChildren();
    const rows = [make('h2', {}, make('span', {textContent: part.name}), make('small', {textContent: part.family}))];
    let group = '';
    for (const field of fields(part, model.selected)) {
      if (field.group !== group) rows.push(make('h3', {textContent: group = field.group}));
      rows.push(fieldRow(field, edited, committed));
    }
    box.replaceChildren(...rows);
  },

  say(text) {
    byId('message').textContent = text;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { byId('message').textContent = ''; }, 4000);
  },
};
