// Aiming: sharpness with its best value so far, while the lens is turned.

import { by, make, makeSvg, show, write } from '../dom.js';
import { number, percent } from '../format.js';
import { bar } from './levels.js';

const WIDTH = 200; // values of the history
const HEIGHT = 100;

export function showAim({ aiming, aim, sharpness }) {
  show('aim', aiming);
  if (!aiming || !aim) return;
  const best = Math.max(aim.best_sharpness, aim.sharpness);
  const scale = 1.1 * best || 1;
  const words = `${percent(best ? aim.sharpness / best : 0)} of the best`;
  bar('sharpness', 'Sharpness', words, aim.sharpness / scale, best / scale, 'aim');
  by('sharpness-level').classList.add('sharpness');
  drawHistory(sharpness, best, scale);
  write(
    'best',
    `Now ${number(aim.sharpness, 3)}, best so far ${number(best, 3)}: turn the lens until the bar reaches its mark.`,
  );
}

function drawHistory(values, best, scale) {
  const height = (value) => HEIGHT * (1 - value / scale);
  const points = values
    .map((value, k) => `${WIDTH - values.length + k + 1},${height(value)}`)
    .join(' ');
  const level = { x1: 0, x2: WIDTH, y1: height(best), y2: height(best) };
  history().replaceChildren(makeSvg('line', level), makeSvg('polyline', { points }));
}

function history() {
  const found = by('history');
  if (found) return found;
  const box = {
    id: 'history',
    class: 'history',
    viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
    preserveAspectRatio: 'none',
  };
  const svg = makeSvg('svg', box);
  by('aim').append(svg, make('p', { id: 'best', className: 'soft' }));
  return svg;
}
