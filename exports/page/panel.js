// The panel: parts, sliders of the selected one, buttons. All that comes from the file is set as text.
'use strict';

const byId = id => document.getElementById(id);

function make(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
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

function smallButton(text, hint, action) {
  const made = make('button', {type: 'button', className: 'small', textContent: text, title: hint});
  made.addEventListener('click', action);
  return made;
}

// Name, colour, and what can be done with the selected part as a whole.
function partHead(part, index, actions) {
  const colour = make('input', {type: 'color', value: part.color, title: 'colour'});
  colour.setAttribute('aria-label', 'colour');
  colour.addEventListener('input', () => actions.recolour(index, colour.value));
  colour.addEventListener('change', actions.committed);
  const name = make('input', {type: 'text', id: 'name', value: part.name, maxLength: LONGEST_NAME, title: 'name'});
  name.setAttribute('aria-label', 'name');
  name.addEventListener('change', () => actions.rename(index, name.value));
  name.addEventListener('keydown', event => { if (event.key === 'Enter') name.blur(); });
  return [
    make('h2', {}, colour, name, make('small', {textContent: part.family})),
    make('div', {className: 'tools'},
      smallButton('duplicate', 'a copy beside it (D)', () => actions.duplicate(index)),
      smallButton('delete', 'take it out (Delete)', () => actions.remove(index)),
      smallButton('earlier', 'one place earlier in the union', () => actions.move(index, -1)),
      smallButton('later', 'one place later in the union', () => actions.move(index, 1)),
    ),
  ];
}

const panel = {
  showParts(actions) {
    byId('count').textContent = model.primitives.length + (model.primitives.length === 1 ? ' part' : ' parts')
      + (model.hidden.size ? `, ${model.hidden.size} hidden` : '') + (model.edited ? ', edited' : '');
    byId('parts').replaceChildren(...model.primitives.map((part, index) => {
      const hidden = model.hidden.has(index);
      const dot = make('i', {className: 'dot'});
      dot.style.background = part.color;
      const name = make('button', {className: 'name', type: 'button'}, dot, make('span', {textContent: part.name}));
      name.addEventListener('click', () => actions.select(index));
      const eye = smallButton(hidden ? 'show' : 'hide', 'in the picture only: files keep it (H)', () => actions.hide(index));
      const only = smallButton('only', 'hide all others; again: show all (I)', () => actions.isolate(index));
      const row = make('li', {}, name, eye, only);
      row.classList.toggle('hidden', hidden);
      row.classList.toggle('selected', index === model.selected);
      return row;
    }));
    byId('parts').querySelector('.selected')?.scrollIntoView({block: 'nearest'});
    byId('undo').disabled = !model.past.length;
    byId('redo').disabled = !model.future.length;
  },

  showFields(actions) {
    const part = model.primitives[model.selected], box = byId('fields');
    byId('hint').hidden = Boolean(part);
    if (!part) return box.replaceChildren();
    const rows = partHead(part, model.selected, actions);
    let group = '';
    for (const field of fields(part, model.selected)) {
      if (field.group !== group) rows.push(make('h3', {textContent: group = field.group}));
      rows.push(fieldRow(field, actions.edited, actions.committed));
    }
    box.replaceChildren(...rows);
  },

  say(text) {
    byId('message').textContent = text;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { byId('message').textContent = ''; }, 4000);
  },
};
