// The assembly that is edited: its state, what can be done to it, undo and redo, and its JSON.
'use strict';

const DATA = JSON.parse(document.getElementById('data').textContent);
const FAMILIES = DATA.families, COMBINE = DATA.combine;
const FAMILY_NAMES = Object.keys(FAMILIES);
const LONGEST_NAME = 128;

const model = {
  transform: DATA.transform,
  primitives: DATA.primitives,
  hidden: new Set(),
  selected: -1,
  explode: 0,
  past: [],
  future: [],

  visible() { return this.primitives.filter((_, i) => !this.hidden.has(i)); },
  get edited() { return this.saved.text !== this.first; },

  now() { return JSON.stringify({primitives: this.primitives, hidden: [...this.hidden].sort((a, b) => a - b)}); },

  // Call once an edit is complete: it becomes one step of undo.
  commit() {
    const text = this.now();
    if (text === this.saved.text) return;
    this.past.push(this.saved);
    this.future = [];
    this.saved = {text, selected: this.selected};
  },

  step(from, to) {
    if (!from.length) return;
    to.push(this.saved);
    this.saved = from.pop();
    const {primitives, hidden} = JSON.parse(this.saved.text);
    // Who edits one part goes on with it; only when parts come or go is the selection of that time the right one.
    if (primitives.length !== this.primitives.length) this.selected = this.saved.selected;
    this.primitives = primitives;
    this.hidden = new Set(hidden);
  },

  undo() { this.commit(); this.step(this.past, this.future); },
  redo() { this.commit(); this.step(this.future, this.past); },

  // Change the list of parts; whoever is hidden or selected stays so.
  rearrange(change) {
    const hidden = new Set([...this.hidden].map(i => this.primitives[i])), chosen = this.primitives[this.selected];
    change(this.primitives);
    this.hidden = new Set(this.primitives.flatMap((part, i) => hidden.has(part) ? [i] : []));
    this.selected = this.primitives.indexOf(chosen);
  },

  hide(index) { if (!this.hidden.delete(index)) this.hidden.add(index); },

  // Hide all others; again: show all.
  isolate(index) {
    const others = this.primitives.map((_, i) => i).filter(i => i !== index);
    const alone = !this.hidden.has(index) && this.hidden.size === others.length;
    this.hidden = new Set(alone ? [] : others);
  },

  // A copy beside the part, right after it in the union; false if no more can be drawn.
  duplicate(index) {
    if (this.primitives.length >= DATA.most) return false;
    const part = structuredClone(this.primitives[index]);
    part.name = this.freeName(part.name);
    part.translation[0] += 0.1;
    this.rearrange(list => list.splice(index + 1, 0, part));
    this.selected = index + 1;
    return true;
  },

  freeName(name) {
    const stem = name.replace(/ copy( \d+)?$/, '').slice(0, LONGEST_NAME - 12), taken = new Set(this.primitives.map(part => part.name));
    for (let count = 1; ; count++) {
      const tried = stem + ' copy' + (count > 1 ? ' ' + count : '');
      if (!taken.has(tried)) return tried;
    }
  },

  remove(index) {
    this.rearrange(list => list.splice(index, 1));
    if (this.selected < 0) this.selected = Math.min(index, this.primitives.length - 1);
  },

  // The union folds in the order of the list, so that a blend joins a part with all before it.
  move(index, by) {
    const to = index + by;
    if (to < 0 || to >= this.primitives.length) return;
    this.rearrange(list => list.splice(to, 0, ...list.splice(index, 1)));
  },

  // Only what a file may hold: printable characters, not too many, not none.
  rename(index, text) {
    const name = text.replace(/\p{Zs}/gu, ' ').replace(/[\p{C}\p{Zl}\p{Zp}]/gu, '').trim().slice(0, LONGEST_NAME);
    if (name) this.primitives[index].name = name.replace(/[\uD800-\uDBFF]$/, '');
  },
};
model.first = model.now();
model.saved = {text: model.first, selected: -1};

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
