// The keyboard, and the list of what it and the pointers do.
'use strict';

const HELP = [
  ['drag, arrow keys', 'orbit'],
  ['right-drag, Shift + drag or arrow keys', 'pan'],
  ['wheel, + and −', 'zoom'],
  ['one finger; two fingers', 'orbit; pan and zoom'],
  ['click or tap', 'select a part'],
  ['[ and ]', 'the part before, the next one'],
  ['Escape', 'select none'],
  ['H, I', 'hide or show; show it only'],
  ['D, Delete', 'duplicate, delete'],
  ['Ctrl + Z, Ctrl + Shift + Z', 'undo, redo'],
  ['F', 'see the whole'],
  ['M', 'input mesh: ghost, edges, beside, off'],
  ['?', 'this list'],
];

function showHelp() {
  byId('keys').replaceChildren(...HELP.map(([keys, what]) => make('tr', {}, make('th', {textContent: keys}), make('td', {textContent: what}))));
  byId('help').showModal();
}

// The move that a key with Ctrl or Cmd stands for.
function stepOf(event) {
  const key = event.key.toLowerCase();
  return key === 'y' || (key === 'z' && event.shiftKey) ? 'redo' : key === 'z' ? 'undo' : '';
}

function followKeys(actions) {
  const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
  const chosen = action => () => { if (model.selected >= 0) action(model.selected); };
  const next = by => () => {
    const count = model.primitives.length;
    if (count) actions.select(model.selected < 0 ? (by > 0 ? 0 : count - 1) : (model.selected + by + count) % count);
  };
  const bindings = {
    escape: () => actions.select(-1), '[': next(-1), ']': next(1), '?': showHelp,
    h: chosen(actions.hide), i: chosen(actions.isolate), d: chosen(actions.duplicate),
    delete: chosen(actions.remove), backspace: chosen(actions.remove),
    f: actions.whole, m: actions.overlay, '+': () => actions.zoom(0.85), '=': () => actions.zoom(0.85), '-': () => actions.zoom(1.18),
  };
  document.addEventListener('keydown', event => {
    const slider = event.target instanceof HTMLInputElement && event.target.type === 'range';
    // Text fields keep their keys, an open list of keys its own, and a slider its arrows.
    if (byId('help').open || (event.target instanceof HTMLInputElement && !slider)) return;
    let action = null;
    if (event.ctrlKey || event.metaKey) {
      const step = stepOf(event);
      if (step) action = actions[step];
    } else if (!event.altKey) {
      const arrow = !slider && arrows[event.key];
      action = arrow ? () => (event.shiftKey ? actions.pan : actions.orbit)(30 * arrow[0], 30 * arrow[1]) : bindings[event.key.toLowerCase()];
    }
    if (!action) return;
    event.preventDefault();
    action();
  });
}
