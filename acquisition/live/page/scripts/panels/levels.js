// Counts of the newest picture relative to full scale, its saturated pixels and exposure.

import { by, make, show, write } from '../dom.js';
import { count, exposure, number, percent } from '../format.js';

export const TRUSTED = 0.97; // of full scale: above it the response is not trusted (radiometry)

export function showLevels(scan) {
  const now = scan.aim ?? scan.picture;
  show('camera-facts', Boolean(now));
  if (!now) return;
  level('window-mean', 'Window mean', now.window_mean_dn, now.full_scale_dn);
  level('peak', 'Brightest pixel', now.peak_dn, now.full_scale_dn);
  write('saturation', saturationInWords(now));
  by('saturation').classList.toggle('bad', now.saturated_pixels > 0);
  write('exposure', exposure(now.exposure_s));
}

function level(id, name, counts, fullScale) {
  const share = counts / fullScale;
  bar(id, name, `${number(counts)} of ${fullScale} DN (${percent(share)})`, share, TRUSTED);
  by(`${id}-level`).classList.toggle('high', share >= TRUSTED);
}

// Bar from 0 to 1 with a mark; made once.
export function bar(id, name, words, share, mark, parent = 'levels') {
  const element = by(`${id}-level`) ?? makeBar(id, name, parent);
  element.querySelector('b').textContent = words;
  element.querySelector('.fill').style.width = `${100 * Math.min(Math.max(share, 0), 1)}%`;
  element.querySelector('.mark').style.left = `calc(${100 * mark}% - 2px)`;
}

function makeBar(id, name, parent) {
  const track = make(
    'div',
    { className: 'track' },
    make('div', { className: 'fill' }),
    make('div', { className: 'mark' }),
  );
  const element = line(`${id}-level`, name, make('b'));
  element.append(track);
  by(parent).append(element);
  return element;
}

function line(id, name, value) {
  return make('div', { className: 'level', id }, make('p', {}, make('span', {}, name), value));
}

function saturationInWords({ saturated_pixels: all, window_saturated_pixels: inWindow }) {
  if (!all) return 'none';
  return `${count(all, 'pixel')}, ${inWindow || 'none'} of them in the window`;
}
