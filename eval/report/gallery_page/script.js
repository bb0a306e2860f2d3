// Search by name and sort; without this, everything is shown in order of names.
'use strict';

(function start() {
  const byId = id => document.getElementById(id), cards = [...document.querySelectorAll('article')];
  const first = {iou: -1, parts: 1, seconds: 1};

  function compare(a, b, key, reversed) {
    const name = a.dataset.name.localeCompare(b.dataset.name, undefined, {numeric: true});
    if (key === 'name') return name;
    const [one, two] = [a.dataset[key], b.dataset[key]];
    // Where there is no number, it comes last.
    if (!one || !two) return (one ? 0 : 1) - (two ? 0 : 1) || name;
    return (Number(one) - Number(two)) * first[key] * (reversed ? -1 : 1) || name;
  }

  function show() {
    const [key, reversed] = byId('order').value.split(' '), words = byId('search').value.toLowerCase().split(/\s+/);
    byId('cards').append(...cards.sort((a, b) => compare(a, b, key, reversed)));
    for (const card of cards) card.hidden = !words.every(word => card.dataset.name.toLowerCase().includes(word));
    byId('shown').textContent = cards.filter(card => !card.hidden).length + ' shown';
  }

  byId('controls').hidden = false;
  byId('controls').addEventListener('submit', event => event.preventDefault());
  byId('controls').addEventListener('input', show);
  show();
})();
