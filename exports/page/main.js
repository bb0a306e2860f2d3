// Puts model, renderer, camera, panel and keys together.
'use strict';

function worldBox(part) {
  const [low, high] = GEOMETRY[part.family].bounds(part.parameters), box = {low: [9e9, 9e9, 9e9], high: [-9e9, -9e9, -9e9]};
  for (let corner = 0; corner < 8; corner++) {
    const place = rotate(part.rotation, low.map((value, axis) => corner >> axis & 1 ? high[axis] : value));
    for (let axis = 0; axis < 3; axis++) {
      box.low[axis] = Math.min(box.low[axis], place[axis] + part.translation[axis]);
      box.high[axis] = Math.max(box.high[axis], place[axis] + part.translation[axis]);
    }
  }
  return box;
}

async function copyText(text, what) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Pages from disk may not use the clipboard everywhere; a selection may be copied always.
    const area = make('textarea', {value: text});
    document.body.append(area);
    area.select();
    document.execCommand('copy');
    area.remove();
  }
  panel.say(what + ' copied');
}

function saveText(text, name, type) {
  const address = URL.createObjectURL(new Blob([text], {type}));
  make('a', {href: address, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

// The mesh that is embedded: positions, and three vertices a face.
function readMesh({low, size, vertices, faces}) {
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer;
  const positions = Float32Array.from(new Uint16Array(bytes(vertices)), (value, i) => low[i % 3] + value / 65535 * size[i % 3]);
  return [positions, new Uint16Array(bytes(faces))];
}

// What buttons, keys and pointers do.
function makeActions(renderer) {
  // A selected part that is hidden stays selected, so that its sliders stay.
  const edited = () => renderer.setParts(partTable(model.visible(), model.primitives[model.selected], model.explode));
  const committed = () => { model.commit(); panel.showParts(actions); };
  const showAll = () => { panel.showParts(actions); panel.showFields(actions); edited(); };
  const frame = () => { camera.frame(model.primitives.map(worldBox), renderer.aspect); renderer.draw(); };
  const edit = change => (...given) => { change(...given); model.commit(); showAll(); };
  const moved = change => (...given) => { change(...given); renderer.draw(); };
  const actions = {
    edited, committed, showAll, frame,
    select: index => { model.selected = index; showAll(); },
    hide: edit(index => model.hide(index)),
    isolate: edit(index => model.isolate(index)),
    duplicate: edit(index => { if (!model.duplicate(index)) panel.say(`A page draws at most ${DATA.most} parts.`); }),
    remove: edit(index => model.remove(index)),
    move: edit((index, by) => model.move(index, by)),
    rename: edit((index, text) => model.rename(index, text)),
    recolour: (index, colour) => { model.primitives[index].color = colour; edited(); },
    undo: () => { model.undo(); showAll(); },
    redo: () => { model.redo(); showAll(); },
    orbit: moved((dx, dy) => camera.orbit(dx, dy)),
    pan: moved((dx, dy) => camera.pan(dx, dy, 600)),
    zoom: moved(factor => camera.zoom(factor)),
    whole: () => { camera.azimuth = 35; camera.elevation = 22; frame(); },
    turnUp: () => { camera.up = camera.up === 'y' ? 'z' : 'y'; byId('up').textContent = camera.up + ' up'; frame(); },
    overlay: () => {
      if (!DATA.mesh) return;
      const before = camera.overlay;
      camera.overlay = OVERLAYS[(OVERLAYS.indexOf(before) + 1) % OVERLAYS.length];
      byId('mesh').textContent = OVERLAY_NAMES[camera.overlay];
      byId('mesh').classList.toggle('on', camera.overlay !== 'off');
      // The picture of the assembly changes its shape when there is one beside it.
      if (before === 'side' || camera.overlay === 'side') frame(); else renderer.draw();
    },
  };
  return actions;
}

(function start() {
  const canvas = byId('canvas'), renderer = makeRenderer(canvas, camera);
  byId('title').textContent = DATA.title;
  byId('facts').replaceChildren(...DATA.facts.map(fact => make('li', {textContent: fact})));
  if (!renderer) {
    byId('sorry').hidden = false;
    document.body.classList.add('bare');
    return;
  }
  const actions = makeActions(renderer);
  const pick = (x, y) => {
    const shown = model.primitives.map((_, i) => i).filter(i => !model.hidden.has(i)), row = renderer.pick(x, y);
    return row < 0 ? -1 : shown[row];
  };
  followPointers(canvas, () => renderer.draw(), (x, y) => actions.select(pick(x, y)));
  followKeys(actions);
  const buttons = {
    undo: actions.undo, redo: actions.redo, view: actions.whole, up: actions.turnUp, mesh: actions.overlay, keyboard: showHelp,
    json: () => copyText(assemblyJson(), 'JSON'), glsl: () => copyText(assemblyGlsl(), 'GLSL'),
    download: () => saveText(assemblyJson(), 'assembly.json', 'application/json'),
  };
  for (const [name, action] of Object.entries(buttons)) byId(name).addEventListener('click', action);
  byId('up').textContent = camera.up + ' up';
  byId('explode').addEventListener('input', event => { model.explode = Number(event.target.value); actions.edited(); });
  canvas.addEventListener('webglcontextlost', () => {
    panel.say('The graphics driver gave up: download what you have edited, then load the page again.');
  });
  if (DATA.mesh) {
    renderer.setOverlay(...readMesh(DATA.mesh));
    byId('mesh').hidden = false;
  }
  new ResizeObserver(() => renderer.fit()).observe(canvas);
  renderer.fit();
  actions.showAll();
  actions.frame();
  // For scripts and tests.
  window.viewer = {
    model, camera, renderer, pick, actions, select: actions.select, json: assemblyJson, glsl: assemblyGlsl, refresh: actions.showAll,
  };
})();
