// Puts model, renderer, camera and panel together.
'use strict';

(function start() {
  const canvas = byId('canvas'), renderer = makeRenderer(canvas, camera);
  byId('title').textContent = DATA.title;
  byId('count').textContent = model.primitives.length + (model.primitives.length === 1 ? ' part' : ' parts');
  if (!renderer) {
    byId('sorry').hidden = false;
    document.body.classList.add('bare');
    return;
  }
  // A selected part that is hidden stays selected, so that its sliders stay.
  const refresh = () => renderer.setParts(partTable(model.visible(), model.primitives[model.selected], model.explode));
  const committed = () => { model.commit(); showParts(); };
  const showParts = () => panel.showParts(select, hide, isolate);
  const showAll = () => { showParts(); panel.showFields(refresh, committed); refresh(); };
  const select = index => { model.selected = index; showAll(); };
  const hide = index => { if (!model.hidden.delete(index)) model.hidden.add(index); showAll(); };
  const isolate = index => {
    const others = model.primitives.map((_, i) => i).filter(i => i !== index);
    const alone = !model.hidden.has(index) && model.hidden.size === others.length;
    model.hidden = new Set(alone ? [] : others);
    showAll();
  };
  const frame = () => {
    camera.frame(model.primitives.map(worldBox), canvas.clientWidth / Math.max(1, canvas.clientHeight));
    renderer.draw();
  };

  function worldBox(part) {
    const [low, high] = localBounds(part), box = {low: [9e9, 9e9, 9e9], high: [-9e9, -9e9, -9e9]};
    for (let corner = 0; corner < 8; corner++) {
      const place = rotate(part.rotation, low.map((value, axis) => corner >> axis & 1 ? high[axis] : value));
      for (let axis = 0; axis < 3; axis++) {
        box.low[axis] = Math.min(box.low[axis], place[axis] + part.translation[axis]);
        box.high[axis] = Math.max(box.high[axis], place[axis] + part.translation[axis]);
      }
    }
    return box;
  }

  const pick = (x, y) => {
    const shown = model.primitives.map((_, i) => i).filter(i => !model.hidden.has(i));
    const row = renderer.pick(x, y);
    return row < 0 ? -1 : shown[row];
  };
  followPointers(canvas, () => renderer.draw(), (x, y) => select(pick(x, y)));

  const stepping = move => () => { model[move](); showAll(); };
  byId('undo').addEventListener('click', stepping('undo'));
  byId('redo').addEventListener('click', stepping('redo'));
  document.addEventListener('keydown', event => {
    const typing = event.target instanceof HTMLInputElement && event.target.type === 'number';
    if (typing || !(event.ctrlKey || event.metaKey)) return;
    const key = event.key.toLowerCase(), move = key === 'y' || (key === 'z' && event.shiftKey) ? 'redo' : key === 'z' ? 'undo' : '';
    if (!move) return;
    event.preventDefault();
    stepping(move)();
  });
  byId('view').addEventListener('click', () => { camera.azimuth = 35; camera.elevation = 22; frame(); });
  byId('up').addEventListener('click', () => {
    camera.up = camera.up === 'y' ? 'z' : 'y';
    byId('up').textContent = camera.up + ' up';
    frame();
  });
  byId('up').textContent = camera.up + ' up';
  byId('explode').addEventListener('input', event => { model.explode = Number(event.target.value); refresh(); });

  const copy = async (text, what) => {
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
  };
  byId('json').addEventListener('click', () => copy(assemblyJson(), 'JSON'));
  byId('glsl').addEventListener('click', () => copy(assemblyGlsl(), 'GLSL'));
  byId('download').addEventListener('click', () => {
    const address = URL.createObjectURL(new Blob([assemblyJson()], {type: 'application/json'}));
    make('a', {href: address, download: 'assembly.json'}).click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  });

  if (DATA.mesh) {
    const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer;
    const places = Float32Array.from(new Uint16Array(bytes(DATA.mesh.vertices)),
      (value, i) => DATA.mesh.low[i % 3] + value / 65535 * DATA.mesh.size[i % 3]);
    renderer.setOverlay(places, new Uint16Array(bytes(DATA.mesh.faces)));
    byId('mesh').hidden = false;
    byId('mesh').addEventListener('click', () => {
      camera.overlay = !camera.overlay;
      byId('mesh').classList.toggle('on', camera.overlay);
      renderer.draw();
    });
  }

  new ResizeObserver(() => renderer.fit()).observe(canvas);
  renderer.fit();
  showAll();
  frame();
  // For scripts and tests.
  window.viewer = {model, camera, renderer, pick, select, json: assemblyJson, glsl: assemblyGlsl, refresh: showAll};
})();
