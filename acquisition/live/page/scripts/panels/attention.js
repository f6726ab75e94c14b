// List 'needs attention': each flagged reading, and why, in words, the newest first; then what to do.

import { flagSwatch } from '../chart/symbols.js';
import { by, fill, make, show, write } from '../dom.js';
import { count } from '../format.js';
import { adviceOn, flagInWords, place } from '../words.js';

export function showAttention(scan, selection) {
  const rows = scan.flagged.reverse().map((point) => ({
    step: point.step,
    place: place(point),
    reasons: point.flags.map((flag) => flagInWords(flag, point)).join('; '),
  }));
  const flags = [...new Set(scan.flagged.flatMap((point) => point.flags))].filter(adviceOn);
  show('attention', rows.length > 0);
  write('attention-title', `Needs attention: ${count(rows.length, 'reading')} flagged, not fitted`);
  const theme = document.documentElement.dataset.theme;
  fill(by('attention-list'), { rows, theme }, () => rows.map((row) => entry(row, selection)));
  fill(by('attention-advice'), flags, () =>
    flags.map((flag) => make('li', {}, `${flag}: ${adviceOn(flag)}`)),
  );
}

function entry({ step, place: where, reasons }, selection) {
  const button = make(
    'button',
    { type: 'button', className: 'link', title: 'Show this reading' },
    where,
  );
  button.addEventListener('click', () => selection.select(step));
  return make('li', { className: 'flagged' }, flagSwatch(), button, ` ${reasons}`);
}
