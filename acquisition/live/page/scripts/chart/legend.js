// Legend of the chart: a button for each curve hides or shows it; flag, model and counts in words.

import { by, fill, make, write } from '../dom.js';
import { count } from '../format.js';
import { ENDED } from '../words.js';
import { curvesOf, isFlagged } from './curves.js';
import { drawSymbol, flagSwatch, styleOf, swatch } from './symbols.js';

export class Legend {
  constructor(changed) {
    this.hidden = new Set();
    this.changed = changed;
  }

  visible(curves) {
    return curves.filter((curve) => !this.hidden.has(curve.name));
  }

  show(scan) {
    const curves = curvesOf(scan);
    const flags = curves.some((curve) => curve.points.some(isFlagged));
    const theme = document.documentElement.dataset.theme;
    const rows = curves.map(({ name, index }) => ({ name, index, shown: !this.hidden.has(name) }));
    fill(by('legend'), { rows, flags, theme }, () => this.entries(rows, flags));
    write('model', modelInWords(scan));
    write('chart-note', note(scan, curves));
  }

  entries(rows, flags) {
    const flag = make('span', { className: 'key-only' }, flagSwatch(), 'flagged: not fitted');
    const entries = [...rows.map((row) => this.button(row)), ...(flags ? [flag] : [])];
    return entries.map((entry) => make('li', {}, entry));
  }

  button({ name, index, shown }) {
    const button = make(
      'button',
      { type: 'button', title: shown ? 'Hide' : 'Show' },
      key(index),
      name,
    );
    button.setAttribute('aria-pressed', String(shown));
    button.addEventListener('click', () => {
      if (!this.hidden.delete(name)) this.hidden.add(name);
      this.changed();
      by('legend').querySelectorAll('button')[index]?.focus();
    });
    return button;
  }
}

function key(index) {
  const { colour, symbol, dash } = styleOf(index);
  return swatch(36, 14, (context) => {
    Object.assign(context, { strokeStyle: colour, fillStyle: colour, lineWidth: 1.5 });
    context.setLineDash(dash);
    context.beginPath();
    context.moveTo(0, 7);
    context.lineTo(36, 7);
    context.stroke();
    drawSymbol(context, symbol, 18, 7, 4);
  });
}

function modelInWords({ model, progress }) {
  if (!model?.name) return model?.text ?? '';
  const soFar = ENDED.includes(progress?.state) ? '' : ' so far';
  return `Lines: the best model${soFar}, ${model.text}.`;
}

function note(scan, curves) {
  const points = curves.flatMap((curve) => curve.points);
  const flagged = points.filter(isFlagged).length;
  const total = scan.run?.points ?? points.length;
  const counts = `${points.length} of ${count(total, 'point')} measured, ${flagged || 'none'} flagged.`;
  const outside = flagged
    ? ' Flagged points without a value, or beyond the axis, stand at its edge.'
    : '';
  const pale = points.some((point) => point.provisional)
    ? ' Pale points may still change: their white tile is not read yet.'
    : '';
  const side = scan.run?.sweep === 'theta_r' ? ' Positive θᵣ at Δφ = 0 is the lamp’s side.' : '';
  const bars = ' Error bars: standard uncertainty u (k = 1), often smaller than the symbols.';
  return counts + outside + pale + side + bars;
}
