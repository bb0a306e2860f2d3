// The camera that orbits a point, the lights that go with it, and the pointers that move it.
'use strict';

const add = (a, b, s = 1) => a.map((value, axis) => value + s * b[axis]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => a.map(value => value / (Math.hypot(...a) || 1));

const camera = {
  up: DATA.up, azimuth: 35, elevation: 22, distance: 4, target: [0, 0, 0], fieldOfView: 30,
  ground: [0, -1, 0, 3], overlay: 'off',

  view() {
    const turn = this.azimuth * Math.PI / 180, lift = this.elevation * Math.PI / 180;
    const side = Math.cos(lift) * Math.sin(turn), front = Math.cos(lift) * Math.cos(turn), top = Math.sin(lift);
    const towards = this.up === 'y' ? [side, top, front] : [side, -front, top];
    const vertical = this.up === 'y' ? [0, 1, 0] : [0, 0, 1];
    const forward = towards.map(value => -value), right = unit(cross(forward, vertical));
    const level = unit(add(forward, vertical, -dot(forward, vertical)));
    const light = (a, b, c) => unit(add(add(right.map(value => a * value), vertical, b), level, -c));
    return {
      eye: add(this.target, towards, this.distance), right, upward: cross(right, forward), forward, vertical,
      slope: Math.tan(this.fieldOfView * Math.PI / 360),
      key: light(-0.55, 0.95, 0.6), fill: light(0.9, 0.25, 0.5), rim: light(0.3, 0.5, -1),
    };
  },

  // See all of the spheres, and stand them on the ground.
  frame(spheres, aspect) {
    if (!spheres.length) return;
    let low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const {low: below, high: above} of spheres) {
      low = low.map((value, axis) => Math.min(value, below[axis]));
      high = high.map((value, axis) => Math.max(value, above[axis]));
    }
    this.target = low.map((value, axis) => 0.5 * (value + high[axis]));
    const half = high.map((value, axis) => 0.5 * (value - low[axis]));
    const {right, upward, forward, slope} = this.view();
    const extent = axis => dot(half, axis.map(Math.abs));
    const across = Math.max(extent(upward) / slope, extent(right) / (slope * aspect));
    this.distance = 1.12 * (across + extent(forward));
    const upAxis = this.up === 'y' ? 1 : 2;
    const foot = this.target.slice();
    foot[upAxis] = low[upAxis] - 0.002;
    this.ground = [...foot, 3.2 * Math.hypot(...half)];
  },

  orbit(dx, dy) {
    this.azimuth -= 0.4 * dx;
    this.elevation = Math.max(-88, Math.min(88, this.elevation + 0.4 * dy));
  },

  pan(dx, dy, height) {
    const {right, upward, slope} = this.view(), size = 2 * slope * this.distance / height;
    this.target = add(add(this.target, right, -dx * size), upward, dy * size);
  },

  zoom(factor) { this.distance = Math.max(0.05, Math.min(40, this.distance * factor)); },
};

// One pointer orbits, or pans with the right button or Shift; two pan and pinch; a click that does not move picks.
function followPointers(canvas, changed, picked) {
  const held = new Map();
  let travelled = 0, fingers = 0;
  // A finger that taps slides a little.
  const still = event => travelled < (event.pointerType === 'touch' ? 10 : 4);
  canvas.addEventListener('contextmenu', event => event.preventDefault());
  canvas.addEventListener('pointerdown', event => {
    canvas.setPointerCapture(event.pointerId);
    if (!held.size) travelled = fingers = 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    fingers = Math.max(fingers, held.size);
  });
  canvas.addEventListener('pointermove', event => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
    travelled += Math.abs(dx) + Math.abs(dy);
    if (still(event)) return;
    if (held.size === 2) {
      const other = [...held].find(([id]) => id !== event.pointerId)[1];
      const apart = place => Math.hypot(place[0] - other[0], place[1] - other[1]);
      camera.zoom(apart(before) / Math.max(1, apart(now)));
      camera.pan(0.5 * dx, 0.5 * dy, canvas.clientHeight);
    } else if (event.buttons & 6 || event.shiftKey) camera.pan(dx, dy, canvas.clientHeight);
    else camera.orbit(dx, dy);
    held.set(event.pointerId, now);
    changed();
  });
  const release = event => {
    if (!held.delete(event.pointerId) || event.type !== 'pointerup') return;
    if (still(event) && fingers === 1 && event.button === 0) {
      const box = canvas.getBoundingClientRect();
      picked(event.clientX - box.left, event.clientY - box.top);
    }
  };
  canvas.addEventListener('pointerup', release);
  canvas.addEventListener('pointercancel', release);
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    camera.zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1)));
    changed();
  }, {passive: false});
}
