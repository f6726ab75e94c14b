// The selected reading: its frame, values, counts, exposure and flags.

import { flagSwatch } from '../chart/symbols.js';
import { by, fill, make, show, write } from '../dom.js';
import { degrees, exposure, number, percent, timeOfDay, withU } from '../format.js';
import { frameAddress } from '../requests.js';
import { adviceOn, flagInWords, place } from '../words.js';

export function showSelected(scan, point) {
  show('selected', point !== null);
  if (!point) return;
  write('selected-title', `Selected: ${place(point)}`);
  fill(by('selected-flags'), { flags: point.flags, step: point.step }, () =>
    point.flags.map((flag) => flagRow(flag, point)),
  );
  fill(by('selected-facts'), facts(scan.run, point), (rows) => rows.flatMap(factRow));
  showFrame(point);
}

function flagRow(flag, point) {
  const words = `${flagInWords(flag, point)}. Not fitted. ${adviceOn(flag)}`;
  return make('li', { className: 'flagged' }, flagSwatch(), words);
}

const factRow = ([name, value]) => [make('dt', {}, name), make('dd', {}, value)];

function facts(run, point) {
  const mean = `${number(point.signal_dn)} DN (${percent(point.signal_dn / point.full_scale_dn)} of full scale)`;
  const peak = `${number(point.peak_dn)} of ${point.full_scale_dn} DN (${percent(point.peak_dn / point.full_scale_dn)})`;
  return [
    [valueName(run, point), withU(point.value, point.u, run?.unit ?? '')],
    ['Mean, dark subtracted', mean],
    ['Brightest part', peak],
    ['Saturated pixels', String(point.saturated_pixels)],
    ['Exposure', `${exposure(point.exposure_s)}, ${point.frames} frames`],
    ['Window', `${number(point.window_pixels)} pixels`],
    ['Azimuth Δφ', degrees(point.dphi_deg)],
    ['Time', timeOfDay(point.time_utc)],
    ['Step of the plan', String(point.step)],
  ];
}

// Before the white tile of its lamp setting was read, a BRDF is that of the lamp's earlier level.
function valueName(run, point) {
  const name = run?.quantity ?? 'Value';
  return point.provisional ? `${name}, until its white tile is read` : name;
}

function showFrame(point) {
  const image = by('selected-frame');
  const source = point.has_frame ? frameAddress(point.step) : '';
  if (image.dataset.of === source) return;
  image.dataset.of = source;
  const caption = (words) => write('selected-caption', words);
  image.onload = () => show('selected-frame', true);
  image.onerror = () => caption('The frame of this reading cannot be fetched.');
  show('selected-frame', false);
  caption(source ? `Frame of this reading, ${place(point)}` : 'No frame of this reading was kept.');
  if (source) image.src = source;
  else image.removeAttribute('src');
  image.alt = `Frame of ${place(point)}`;
}
