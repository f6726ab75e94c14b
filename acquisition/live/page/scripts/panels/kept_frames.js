// Readings whose frame was kept: where the camera shows no picture, as after the scan.

import { by, fill, make, show, write } from '../dom.js';
import { count } from '../format.js';
import { place } from '../words.js';

const MOST = 30;

export function showKeptFrames(scan, selection) {
  const kept = scan.picture ? [] : scan.inOrder.filter((point) => point.has_frame);
  const rows = kept.slice(0, MOST).map((point) => ({ step: point.step, place: place(point) }));
  show('kept', rows.length > 0);
  write('kept-title', `A frame is kept of ${count(kept.length, 'reading')}:`);
  fill(by('kept-list'), rows, (all) => all.map((row) => entry(row, selection)));
}

function entry({ step, place: where }, selection) {
  const button = make('button', { type: 'button', className: 'link' }, where);
  button.addEventListener('click', () => selection.select(step));
  return make('li', {}, button);
}
